"""The box: an axis-aligned rectangle, uniform inside, computed from its moments (paper 3 and 5).

A uniform box of centre mu and half width a has E[u] = mu and E[u^2] = mu^2 + a^2 / 3, on a patch
so small that its density is constant. `measure.box_of` finds the box on any patch. The paper's
search (`fit.search`) finds the same minimum where its patterns identify it.

Examples
--------
>>> mean, square = 0.5, 0.5**2 + 0.1**2 / 3
>>> values = np.array([[1.0], [mean], [square], [mean], [square], [mean * mean]])
>>> small = (0.0, 0.01, 0.0, 0.01)  # a patch on which solid angle is as good as area
>>> Box().fit(Moments(np.ones((1, 3)), values, small)).round(3).tolist()
[[0.4, 0.6, 0.4, 0.6]]
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..capture.moments import Moments
from ..light.light import PatchLight
from ..measure import box_of
from ..patterns import ONE, UU, VV, U, V


class Box:
    """The box model; parameters are its edges in patch coordinates."""

    name = "box"
    code = 3
    parameters: tuple[str, ...] = ("u0", "u1", "v0", "v1")
    needs: tuple[int, ...] = (ONE, U, UU, V, VV)

    def fit(self, moments: Moments) -> NDArray:
        return box_of(moments.mean, moments.variance, moments.extent)

    def average(self, light: PatchLight, k: int | NDArray, parameters: NDArray) -> NDArray:
        u0, u1, v0, v1 = parameters.astype(np.float64).T
        return light.box(k, u0, u1, v0, v1)

    def plane(self, light: PatchLight, k: int) -> None:
        return None
