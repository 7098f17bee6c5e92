"""The linear projection: the light taken as a plane over the patch, seen at the mean place.

A pixel is a sum of moments, so light that is a + b u + c v over the patch is met exactly with the
first moments alone, however the support looks: unbiased, and best for broad reflection.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..capture.moments import Moments
from ..light.light import PatchLight
from ..patterns import ONE, U, V


class Linear:
    name = "linear"
    code = 2
    parameters: tuple[str, ...] = ("mean_u", "mean_v")
    needs: tuple[int, ...] = (ONE, U, V)

    def fit(self, moments: Moments) -> NDArray:
        return np.stack(moments.mean, axis=-1)

    def average(self, light: PatchLight, k: int, parameters: NDArray) -> NDArray:
        constant, slopes = self.plane(light, k)
        return parameters.astype(np.float32, copy=False) @ slopes.T + constant

    def plane(self, light: PatchLight, k: int) -> tuple[NDArray, NDArray]:
        constant, *slopes = light.polynomial((ONE, U, V))[k].astype(np.float32)
        return constant, np.stack(slopes, axis=-1)
