"""The box: an axis-aligned rectangle, uniform inside (paper 3 and 5), from its moments.

A uniform box of centre mu and half width a has E[u] = mu and E[u^2] = mu^2 + a^2 / 3, where its
patch is so small that area and solid angle are one; `measure.box_of` finds the box on any. The
paper's search finds the same minimum where its patterns can see it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..capture.moments import Moments
from ..light.light import PatchLight
from ..measure import box_of
from ..patterns import ONE, UU, VV, U, V


class Box:
    name = "box"
    code = 3
    parameters: tuple[str, ...] = ("u0", "u1", "v0", "v1")
    needs: tuple[int, ...] = (ONE, U, UU, V, VV)

    def fit(self, moments: Moments) -> NDArray:
        return box_of(moments.mean, moments.variance, moments.extent)

    def average(self, light: PatchLight, k: int, parameters: NDArray) -> NDArray:
        u0, u1, v0, v1 = parameters.astype(np.float64).T
        return light.box(k, u0, u1, v0, v1)

    def plane(self, light: PatchLight, k: int) -> None:
        return None
