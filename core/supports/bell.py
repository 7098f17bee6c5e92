"""The bell: as the box from its moments, but dense in its middle and thin at its rim.

A glossy lobe and a pixel's own filter are round. A box of the same mean and variance ends hard, and
shows the rims of bright windows. A stack of boxes of other widths, about the same middle and of the
same variance, is a bell at a few look-ups of the light's sums. Where the patch's rim cuts a lobe,
it is dense there: towards a rim the bell becomes the box again.

Examples
--------
>>> mean, square = 0.5, 0.5**2 + 0.1**2 / 3
>>> values = np.array([[1.0], [mean], [square], [mean], [square], [mean * mean]])
>>> small = (0.0, 0.01, 0.0, 0.01)  # a patch on which solid angle is as good as area
>>> Bell().fit(Moments(np.ones((1, 3)), values, small)).round(3).tolist()
[[0.4, 0.6, 0.4, 0.6]]
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..capture.moments import Moments
from ..light.light import PatchLight
from ..measure import box_of
from ..patterns import ONE, UU, VV, U, V

# Half widths of the boxes of the stack, as shares of that of the single box. Their squares' mean
# is 1.
STACK = np.sqrt([0.5, 1.5])


class Bell:
    """The bell model; parameters are the edges of the box of the same moments."""

    name = "bell"
    code = 8
    parameters: tuple[str, ...] = ("u0", "u1", "v0", "v1")
    needs: tuple[int, ...] = (ONE, U, UU, V, VV)

    def fit(self, moments: Moments) -> NDArray:
        return box_of(moments.mean, moments.variance, moments.extent)

    def average(self, light: PatchLight, k: int | NDArray, parameters: NDArray) -> NDArray:
        u0, u1, v0, v1 = parameters.astype(np.float64).T
        # what is thinner than a bin of the light, as most mirror images are, is one look-up
        thin = np.maximum(u1 - u0, v1 - v0) * STACK[-1] * light.resolutions[k] < 1
        out = np.empty((len(parameters), 3))
        several = isinstance(k, np.ndarray)
        of = k[thin] if several else k
        out[thin] = light.point(of, ((u0 + u1) / 2)[thin], ((v0 + v1) / 2)[thin])
        wide = ~thin
        u, across, round_u = _middle(u0[wide], u1[wide])
        v, along, round_v = _middle(v0[wide], v1[wide])
        a = np.multiply.outer(STACK - 1, round_u) + 1
        b = np.multiply.outer(STACK - 1, round_v) + 1
        a *= across
        b *= along
        edges = ((u - a).ravel(), (u + a).ravel(), (v - b).ravel(), (v + b).ravel())
        of = np.tile(k[wide], len(STACK)) if several else k
        out[wide] = light.box(of, *edges).reshape(len(STACK), -1, 3).mean(axis=0)
        return out

    def plane(self, light: PatchLight, k: int) -> None:
        return None


def _middle(low: NDArray, high: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Middles and half widths, and how far the stack fits beside the patch's rims, 0 to 1."""
    middle, half = (low + high) / 2, (high - low) / 2
    room = np.minimum(middle, 1 - middle) / np.maximum(half, 1e-9)
    return middle, half, np.clip((room - 1) / (STACK[-1] - 1), 0, 1)
