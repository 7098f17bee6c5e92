"""Environment matting as a baseline: one support over the entire hemicube (paper 2 and 8).

Each pixel sees one cap of directions with one coefficient. The axis of the cap is the mean
direction of the pixel's light. Its width follows from the length of this mean: a uniform cap of
half angle t has a mean of length (1 + cos t) / 2. A cap turns with the sphere and crosses the
edges of faces, as a support on a single backdrop around the scene would.

Examples
--------
>>> from arto.core.patterns import pattern_set
>>> basis = np.zeros((6, 3, 1, 3))
>>> basis[0] = np.array([0.4, 0.2, 0.2])[:, None, None]  # white, u, v of the face "top"
>>> found = fit(basis, pattern_set("linear"), Hemicube(patches=1))
>>> found.axis.round(6).tolist(), found.cosine.round(6).tolist()
([[0.0, 0.0, 1.0]], [1.0])
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..capture.moments import Moments
from ..hemicube import Hemicube
from ..light.light import PatchLight, bin_coordinate
from ..patterns import PatternSet

# Directions that a cap is averaged over.
SAMPLES = 64
BYTES_PER_PIXEL = 3 * 2 + 3 * 2


@dataclass(frozen=True)
class Matte:
    """The caps of n pixels.

    Parameters
    ----------
    coefficient : (n, 3) float
    axis : (n, 3) float
        Unit vectors.
    cosine : (n,) float
        The cosine of the half angle.
    """

    coefficient: NDArray
    axis: NDArray
    cosine: NDArray


def fit(basis: NDArray, patterns: PatternSet, hemicube: Hemicube) -> Matte:
    """Fit a cap to each pixel.

    Parameters
    ----------
    basis : (K, P, n, 3) float
        Basis images, scene-linear radiance.
    patterns : PatternSet
    hemicube : Hemicube

    Returns
    -------
    Matte
    """
    n = basis.shape[2]
    coefficient = np.zeros((n, 3))
    direction = np.zeros((n, 3))
    weight = np.zeros(n)
    for k in range(len(hemicube)):
        m = Moments.from_basis(basis[k], patterns, hemicube.extent(k))
        w = m.coefficient.sum(axis=-1, dtype=np.float64)
        coefficient += m.coefficient
        direction += w[:, None] * hemicube.directions(k, *m.mean)
        weight += w
    length = np.linalg.norm(direction, axis=-1)
    lit = (weight > 0) & (length > 0)
    axis = np.where(lit[:, None], direction / np.where(lit, length, 1)[:, None], [0, 0, 1])
    mean = np.where(lit, length / np.where(lit, weight, 1), 0)
    return Matte(coefficient, axis, np.clip(2 * mean - 1, -1, 1))


def relight(matte: Matte, light: PatchLight) -> NDArray[np.float64]:
    """Compute the pixels under a light.

    Parameters
    ----------
    matte : Matte
    light : PatchLight
        With the same number of bins on every patch.

    Returns
    -------
    (n, 3) float64
        Scene-linear radiance.
    """
    i = np.arange(SAMPLES) + 0.5
    turn = np.pi * (1 + 5**0.5) * i
    # two directions across the axis
    helper = np.where(np.abs(matte.axis[:, :1]) < 0.9, [[1.0, 0, 0]], [[0, 1.0, 0]])
    across = np.cross(matte.axis, helper)
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    other = np.cross(matte.axis, across)
    r = light.resolution
    total = np.zeros((len(matte.axis), 4))
    for share, angle in zip(i / SAMPLES, turn, strict=True):
        cosine = 1 - share * (1 - matte.cosine)
        sine = np.sqrt(np.maximum(1 - cosine**2, 0))
        d = cosine[:, None] * matte.axis
        d += sine[:, None] * (np.cos(angle) * across + np.sin(angle) * other)
        k, u, v = light.hemicube.locate(d)
        there = k >= 0
        a = bin_coordinate(light.hemicube, k, u, 0, r).astype(int).clip(0, r - 1)
        b = bin_coordinate(light.hemicube, k, v, 1, r).astype(int).clip(0, r - 1)
        texel = light.binned[k, b, a]
        radiance = texel[:, :3] / texel[:, 3:]
        total[:, :3] += np.where(there[:, None], radiance, 0)
        total[:, 3] += 1
    return matte.coefficient * total[:, :3] / total[:, 3:]
