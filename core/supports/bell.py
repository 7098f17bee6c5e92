"""The bell: dense in its middle and thin at its rim, or at the patch's rim and thin inside.

A glossy lobe and a pixel's own filter are round. A box of the same mean and variance ends hard, and
shows the rims of bright windows. A stack of boxes of other widths, about the same middle and of the
same variance, is a bell at a few look-ups of the light's sums.

Where the patch's rim cuts a lobe, what is left is densest at the rim. A box that ends there has a
wrong mean if it has the variance, and a wrong variance if it has the mean. A stack of two boxes
that begin at the rim has both.

Examples
--------
>>> mean, square = 0.5, 0.5**2 + 0.1**2 / 3
>>> values = np.array([[1.0], [mean], [square], [mean], [square], [mean * mean]])
>>> small = (0.0, 0.01, 0.0, 0.01)  # a patch on which solid angle is as good as area
>>> Bell().fit(Moments(np.ones((1, 3)), values, small)).round(3).tolist()
[[0.5, 0.1, 0.5, 0.1]]

The boxes about a middle, and those of a lobe at the rim whose mean is 0.2:

>>> [edges.ravel().round(3).tolist() for edges in stacked(np.array([0.5]), np.array([0.1]))]
[[0.429, 0.378], [0.571, 0.622]]
>>> [edges.ravel().round(3).tolist() for edges in stacked(np.array([0.2]), np.array([0.25]))]
[[0.0, 0.0], [0.25, 0.55]]
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..capture.moments import Moments
from ..light.light import PatchLight
from ..measure import Extent, box_averages, box_of, uniform_moments
from ..patterns import ONE, UU, VV, U, V

# By how much the squares of the half widths of a stack's boxes differ from that of the single box,
# as a share of it. Their mean is 0, so that the variance is that of the single box.
APART = np.array([-0.5, 0.5])
# The rounding of parameters in files.
CLOSE = 1e-4


class Bell:
    """The bell model; parameters are its middle and the root of three variances, by axis."""

    name = "bell"
    code = 9
    parameters: tuple[str, ...] = ("u", "half_u", "v", "half_v")
    needs: tuple[int, ...] = (ONE, U, UU, V, VV)

    def fit(self, moments: Moments) -> NDArray:
        return bells_of(moments.mean, moments.variance, moments.extent)

    def average(self, light: PatchLight, k: int | NDArray, parameters: NDArray) -> NDArray:
        u, across, v, along = parameters.astype(np.float64).T
        # what is thinner than a bin of the light, as most mirror images are, is one look-up
        widest = 2 * np.sqrt(1 + APART[-1]) * np.maximum(across, along)
        thin = widest * light.resolutions[k] < 1
        out = np.empty((len(parameters), 3))
        several = isinstance(k, np.ndarray)
        out[thin] = light.point(k[thin] if several else k, u[thin], v[thin])
        wide = ~thin
        u0, u1 = stacked(u[wide], across[wide])
        v0, v1 = stacked(v[wide], along[wide])
        of = np.tile(k[wide], len(APART)) if several else k
        found = light.box(of, u0.ravel(), u1.ravel(), v0.ravel(), v1.ravel())
        out[wide] = found.reshape(len(APART), -1, 3).mean(axis=0)
        return out

    def plane(self, light: PatchLight, k: int) -> None:
        return None


def bells_of(
    mean: tuple[NDArray, NDArray], variance: tuple[NDArray, NDArray], extent: Extent
) -> NDArray[np.float64]:
    """Find the bells that have some means and variances.

    Parameters
    ----------
    mean, variance : pair of (n,) float
        Along u and along v, in patch coordinates.
    extent : tuple of 4 float
        The place of the patch on its face.

    Returns
    -------
    (n, 4) float64
        Middle and half width along u, and along v.
    """
    boxes, even = box_of(mean, variance, extent), uniform_moments(extent)
    out = []
    for axis, (first, second) in enumerate(((U, UU), (V, VV))):
        low, high = boxes[:, 2 * axis], boxes[:, 2 * axis + 1]
        free = (low > 0) & (high < 1)
        # Light that is even over the patch must stay so. Its mean is not quite the patch's middle,
        # because directions are not even over a patch.
        whole = np.sqrt(3 * (even[second] - even[first] ** 2))
        middle = mean[axis] - (even[first] - 0.5) * 4 * mean[axis] * (1 - mean[axis])
        half = np.sqrt(3 * np.maximum(variance[axis], 0))
        half = half * (1 + (0.5 / whole - 1) * np.minimum(half / whole, 1) ** 2)
        out.append(np.where(free, (low + high) / 2, np.clip(middle, 0, 1)))
        out.append(np.where(free, (high - low) / 2, np.minimum(half, 1)))
    return np.stack(out, axis=-1)


def moments_of(parameters: NDArray, extent: Extent) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Compute the means and the mean squares of bells, by solid angle.

    Parameters
    ----------
    parameters : (n, 4) float
    extent : tuple of 4 float
        The place of the patch on its face.

    Returns
    -------
    u, uu, v, vv : (n,) float64
    """
    u, across, v, along = parameters.astype(np.float64).T
    u0, u1 = stacked(u, across)
    v0, v1 = stacked(v, along)
    found = box_averages(np.stack([u0, u1, v0, v1], axis=-1), extent).mean(axis=1)
    return found[U], found[UU], found[V], found[VV]


def stacked(middle: NDArray, half: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Find the edges of the boxes of a stack along an axis.

    Parameters
    ----------
    middle, half : (n,) float

    Returns
    -------
    low, high : (boxes, n) float64
    """
    room = np.minimum(middle, 1 - middle)
    free = half <= room + CLOSE
    # how far the stack's boxes fit beside the rim, 0 to 1
    fits = np.clip((np.square(room / np.maximum(half, 1e-9)) - 1) / APART[-1], 0, 1)
    reach = half * np.sqrt(1 + np.multiply.outer(APART, fits))
    # two boxes from the rim to a and to b: their mean is (a + b) / 4, their mean square is
    # (a^2 + b^2) / 6
    apart = np.sqrt(np.maximum(half * half - room * room, 0))
    far = np.minimum(2 * room + apart, 1)
    from_rim = np.stack([np.clip(4 * room - far, CLOSE, far), far])
    left = middle <= 0.5
    low = np.where(free, middle - reach, np.where(left, 0, 1 - from_rim))
    high = np.where(free, middle + reach, np.where(left, from_rim, 1))
    return low, high
