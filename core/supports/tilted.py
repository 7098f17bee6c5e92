"""Tilted supports: the oriented box and the elliptical Gaussian.

The oriented box is the paper's future work, the Gaussian is Chuang's filter of environment
matting. Both need the moment uv, which shows the tilt. The five normalised moments are a mean and
a covariance: the sides of the box and the axes of the ellipse lie along the covariance's axes.
Both are evaluated as a small grid of axis-aligned boxes along these axes, with the summed-area
table that exists already.

Examples
--------
>>> places, weights, half = _uniform_grid()
>>> round(float(weights @ places**2 + half**2 / 3), 6)  # the grid has variance 1
1.0

Source
------
Chuang et al. 2000, "Environment matting extensions: towards higher accuracy and real-time capture".
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..capture.moments import Moments
from ..light.light import PatchLight
from ..patterns import ONE, UU, UV, VV, U, V

# The grid: places and weights along each axis, in standard deviations. Each keeps variance 1
# together with the width of its cells.
_UNIFORM_CELLS = 4
_GAUSSIAN_PLACES = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])


def _uniform_grid() -> tuple[NDArray, NDArray, float]:
    """Places, weights and half width of the cells of a uniform density of variance 1."""
    half = np.sqrt(3) / _UNIFORM_CELLS
    places = -np.sqrt(3) + half * (2 * np.arange(_UNIFORM_CELLS) + 1)
    return places, np.full(_UNIFORM_CELLS, 1 / _UNIFORM_CELLS), half


def _gaussian_grid() -> tuple[NDArray, NDArray, float]:
    """The same for a Gaussian, cut at 2.5 deviations."""
    weights = np.exp(-(_GAUSSIAN_PLACES**2) / 2)
    weights /= weights.sum()
    half = 0.5
    variance = weights @ _GAUSSIAN_PLACES**2 + half**2 / 3
    return _GAUSSIAN_PLACES / np.sqrt(variance), weights, half / np.sqrt(variance)


class _Tilted:
    parameters: tuple[str, ...] = ("mean_u", "mean_v", "deviation_u", "deviation_v", "tilt")
    needs: tuple[int, ...] = (ONE, U, UU, V, VV, UV)
    _grid: tuple[NDArray, NDArray, float]

    def fit(self, moments: Moments) -> NDArray:
        """Deviations are in halves of the patch; tilt is (correlation + 1) / 2."""
        mu, mv = moments.mean
        du, dv = (np.sqrt(v) for v in moments.variance)
        product = du * dv
        safe = np.where(product > 0, product, 1)
        correlation = np.where(product > 0, moments.covariance / safe, 0)
        correlation = np.clip(correlation, -1, 1)
        return np.stack([mu, mv, 2 * du, 2 * dv, (correlation + 1) / 2], axis=-1)

    def average(self, light: PatchLight, k: int | NDArray, parameters: NDArray) -> NDArray:
        mu, mv, du, dv, tilt = parameters.astype(np.float64).T
        a, c = (du / 2) ** 2, (dv / 2) ** 2
        b = (2 * tilt - 1) * np.sqrt(a * c)
        # axes of the covariance [[a, b], [b, c]]
        spread = np.hypot((a - c) / 2, b)
        major = np.sqrt(np.maximum((a + c) / 2 + spread, 0))
        minor = np.sqrt(np.maximum((a + c) / 2 - spread, 0))
        # a nearly round spread has no axes of its own, and upright ones stay on the patch
        tilted = np.abs(b) > 0.02 * (a + c)
        angle = np.where(tilted, np.arctan2(2 * b, a - c) / 2, np.where(a < c, np.pi / 2, 0))
        cos, sin = np.cos(angle), np.sin(angle)
        places, weights, half = self._grid
        # a cell's own extent along u and v: the bounding box of its tilted square, shrunk to the
        # same variance
        cell_u = half * np.hypot(major * cos, minor * sin)
        cell_v = half * np.hypot(major * sin, minor * cos)
        total = np.zeros((len(parameters), 3))
        weight = np.zeros((len(parameters), 1))
        for p, wp in zip(places, weights, strict=True):
            for q, wq in zip(places, weights, strict=True):
                u = mu + p * major * cos - q * minor * sin
                v = mv + p * major * sin + q * minor * cos
                u0, u1 = np.clip(u - cell_u, 0, 1), np.clip(u + cell_u, 0, 1)
                v0, v1 = np.clip(v - cell_v, 0, 1), np.clip(v + cell_v, 0, 1)
                # what of a cell lies off the patch belongs to no light of it
                there = np.maximum((u1 - u0) * (v1 - v0), 1e-12)
                there /= np.maximum(4 * cell_u * cell_v, 1e-12)
                w = (wp * wq * np.minimum(there, 1))[:, None]
                total += w * light.box(k, u0, u1, v0, v1)
                weight += w
        return total / weight

    def plane(self, light: PatchLight, k: int) -> None:
        return None


class OrientedBox(_Tilted):
    """The tilted box; parameters are mean, deviations in halves of the patch, and tilt."""

    name = "oriented_box"
    code = 5
    _grid = _uniform_grid()


class Gaussian(_Tilted):
    """The elliptical Gaussian; parameters are those of `OrientedBox`."""

    name = "gaussian"
    code = 6
    _grid = _gaussian_grid()
