"""The box: an axis-aligned rectangle, uniform inside (paper 3 and 5), in closed form.

A uniform box of centre mu and half width a has E[u] = mu and E[u^2] = mu^2 + a^2 / 3: the paper's
search finds the same minimum where its patterns can see it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..light import PatchLight
from ..moments import Moments
from ..patterns import ONE, UU, VV, U, V


class Box:
    name = "box"
    code = 3
    parameters: tuple[str, ...] = ("u0", "u1", "v0", "v1")
    needs: tuple[int, ...] = (ONE, U, UU, V, VV)

    def fit(self, moments: Moments) -> NDArray:
        edges = []
        for mean, variance in zip(moments.mean, moments.variance, strict=True):
            half = np.sqrt(3 * variance)
            edges += [mean - half, mean + half]
        # light that comes from both rims is spread wider than any box: cut at the patch
        return np.clip(np.stack(edges, axis=-1), 0, 1)

    def average(self, light: PatchLight, k: int, parameters: NDArray) -> NDArray:
        u0, u1, v0, v1 = parameters.astype(np.float64).T
        return light.box(k, u0, u1, v0, v1)
