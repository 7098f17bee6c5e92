"""The quadratic projection: the light taken as a + b u + c u^2 + d v + e v^2 over the patch.

Like the linear one it is unbiased for such light, needs no shape of the support, and follows the
light more closely; it also asks more of the moments, and can ring beside a sun.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..capture.moments import Moments
from ..light.light import PatchLight
from ..patterns import ONE, UU, VV, U, V


class Quadratic:
    name = "quadratic"
    code = 4
    parameters: tuple[str, ...] = ("mean_u", "square_u", "mean_v", "square_v")
    needs: tuple[int, ...] = (ONE, U, UU, V, VV)

    def fit(self, moments: Moments) -> NDArray:
        return moments.normalised[[U, UU, V, VV]].T

    def average(self, light: PatchLight, k: int, parameters: NDArray) -> NDArray:
        constant, slopes = self.plane(light, k)
        return parameters.astype(np.float32, copy=False) @ slopes.T + constant

    def plane(self, light: PatchLight, k: int) -> tuple[NDArray, NDArray]:
        constant, *slopes = light.polynomial(self.needs)[k].astype(np.float32)
        return constant, np.stack(slopes, axis=-1)
