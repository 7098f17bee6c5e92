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

    def average(self, light: PatchLight, k: int, parameters: NDArray) -> NDArray:
        u0, u1, v0, v1 = parameters.astype(np.float64).T
        # what is thinner than a bin of the light, as most mirror images are, is one look-up
        thin = np.maximum(u1 - u0, v1 - v0) * STACK[-1] * light.resolutions[k] < 1
        out = np.empty((len(parameters), 3))
        out[thin] = light.point(k, ((u0 + u1) / 2)[thin], ((v0 + v1) / 2)[thin])
        wide = ~thin
        u, across, round_u = _middle(u0[wide], u1[wide])
        v, along, round_v = _middle(v0[wide], v1[wide])
        total: NDArray[np.float64] = np.zeros((len(u), 3))
        for share in STACK:
            a = across * (1 + round_u * (share - 1))
            b = along * (1 + round_v * (share - 1))
            total += light.box(k, u - a, u + a, v - b, v + b)
        out[wide] = total / len(STACK)
        return out

    def plane(self, light: PatchLight, k: int) -> None:
        return None


def _middle(low: NDArray, high: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Middles and half widths, and how far the stack fits beside the patch's rims, 0 to 1."""
    middle, half = (low + high) / 2, (high - low) / 2
    room = np.minimum(middle, 1 - middle) / np.maximum(half, 1e-9)
    return middle, half, np.clip((room - 1) / (STACK[-1] - 1), 0, 1)
