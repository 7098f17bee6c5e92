"""The quadratic projection: the light as a + b u + c u^2 + d v + e v^2 over the patch.

Like the linear projection it is unbiased for such light and needs no shape of the support. It
follows the light more closely. In return it needs more moments, and can ring beside a sun.

Examples
--------
>>> from arto.core.hemicube import Hemicube
>>> from arto.core.light.environment import Environment
>>> light = PatchLight(Environment.uniform(2.0), Hemicube(patches=1))
>>> Quadratic().average(light, 0, np.array([[0.3, 0.1, 0.8, 0.7]])).round(3).tolist()
[[2.0, 2.0, 2.0]]
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..capture.moments import Moments
from ..light.light import PatchLight
from ..patterns import ONE, UU, VV, U, V


class Quadratic:
    """The quadratic model; parameters are the first two moments along u and along v."""

    name = "quadratic"
    code = 4
    parameters: tuple[str, ...] = ("mean_u", "square_u", "mean_v", "square_v")
    needs: tuple[int, ...] = (ONE, U, UU, V, VV)

    def fit(self, moments: Moments) -> NDArray:
        return moments.normalised[[U, UU, V, VV]].T

    def average(self, light: PatchLight, k: int | NDArray, parameters: NDArray) -> NDArray:
        of = light.polynomial(self.needs)[k].astype(np.float32)
        slopes = np.matmul(parameters[:, None].astype(np.float32, copy=False), of[..., 1:, :])
        return slopes[:, 0] + of[..., 0, :]

    def plane(self, light: PatchLight, k: int) -> tuple[NDArray, NDArray]:
        constant, *slopes = light.polynomial(self.needs)[k].astype(np.float32)
        return constant, np.stack(slopes, axis=-1)
