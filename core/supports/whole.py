"""The whole patch: every direction of it counts the same. This is the Light Stage (paper 8).

Examples
--------
>>> from arto.core.hemicube import Hemicube
>>> from arto.core.light.environment import Environment
>>> light = PatchLight(Environment.uniform(2.0), Hemicube(patches=1))
>>> Whole().average(light, 0, np.empty((1, 0))).round(3).tolist()
[[2.0, 2.0, 2.0]]
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..capture.moments import Moments
from ..light.light import PatchLight


class Whole:
    """The model without parameters."""

    name = "whole"
    code = 1
    parameters: tuple[str, ...] = ()
    needs: tuple[int, ...] = ()

    def fit(self, moments: Moments) -> NDArray:
        return np.empty((len(moments.coefficient), 0), np.float32)

    def average(self, light: PatchLight, k: int | NDArray, parameters: NDArray) -> NDArray:
        return np.broadcast_to(light.whole[k], (len(parameters), 3))

    def plane(self, light: PatchLight, k: int) -> tuple[NDArray, NDArray]:
        return light.whole[k].astype(np.float32), np.zeros((3, 0), np.float32)
