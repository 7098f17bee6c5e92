"""The linear projection: the light as a plane over the patch, looked up at the mean place.

A pixel is a sum of moments. So light of the form a + b u + c v is reproduced exactly by the first
moments, whatever the shape of the support: unbiased, and best for broad reflection.

Examples
--------
>>> from arto.core.hemicube import Hemicube
>>> from arto.core.light.environment import Environment
>>> light = PatchLight(Environment.uniform(2.0), Hemicube(patches=1))
>>> Linear().average(light, 0, np.array([[0.3, 0.8]])).round(4).tolist()
[[2.0, 2.0, 2.0]]
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..capture.moments import Moments
from ..light.light import PatchLight
from ..patterns import ONE, U, V


class Linear:
    """The linear model; parameters are the mean place on the patch."""

    name = "linear"
    code = 2
    parameters: tuple[str, ...] = ("mean_u", "mean_v")
    needs: tuple[int, ...] = (ONE, U, V)

    def fit(self, moments: Moments) -> NDArray:
        return np.stack(moments.mean, axis=-1)

    def average(self, light: PatchLight, k: int | NDArray, parameters: NDArray) -> NDArray:
        of = light.polynomial((ONE, U, V))[k].astype(np.float32)
        slopes = np.matmul(parameters[:, None].astype(np.float32, copy=False), of[..., 1:, :])
        return slopes[:, 0] + of[..., 0, :]

    def plane(self, light: PatchLight, k: int) -> tuple[NDArray, NDArray]:
        constant, *slopes = light.polynomial((ONE, U, V))[k].astype(np.float32)
        return constant, np.stack(slopes, axis=-1)
