"""A sphere of light as a square: the octahedral map, its smaller levels, and how they are read.

A direction is divided by the sum of its absolute parts. The upper half of the sphere then is a
diamond in the square, and the lower half folds out into the square's corners. No direction is far
larger or smaller than another, and no pole needs care, as on an equirectangular map.

Examples
--------
>>> around = directions(4)
>>> x, y = places(around, 4)
>>> bool(np.allclose(x, np.arange(4) + 0.5)), bool(np.allclose(y[:, 0], np.arange(4) + 0.5))
(True, True)
>>> round(float(solid_angles(64).sum() / np.pi), 3)
4.0
>>> sky = levels(of_environment(Environment.uniform(2.0), 16))
>>> [level.shape[0] for level in sky]
[16, 8, 4]
>>> look(sky, np.array([[0.0, 0.6, 0.8]]), np.array([0.1])).round(6).tolist()
[[2.0, 2.0, 2.0]]
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from ..light.environment import Environment, sample_directions
from ..light.environment import directions as of_map

# The side of the smallest level, in texels.
SMALLEST = 4
# The standard deviation of what a level shows, as a share of a texel: that of a texel's own square,
# 1/12, and of the four that are read about a place, 1/6.
SPREAD = 0.5
# Samples of a map that an octahedral texel gets at least, on average.
SAMPLES = 8


@cache
def directions(side: int) -> NDArray[np.float64]:
    """Compute the directions of the texels' middles.

    Parameters
    ----------
    side : int
        Texels a side.

    Returns
    -------
    (side, side, 3) float64
        Unit vectors; the first index runs along the second coordinate.
    """
    q = (np.arange(side) + 0.5) / side
    out = unfolded(*np.broadcast_arrays(q[None, :], q[:, None]))
    out.flags.writeable = False
    return out


def unfolded(x: NDArray, y: NDArray) -> NDArray[np.float64]:
    """Find the directions of places on the square.

    Parameters
    ----------
    x, y : (...) float
        0 to 1.

    Returns
    -------
    (..., 3) float64
        Unit vectors.
    """
    x, y = 2 * x - 1, 2 * y - 1
    z = 1 - np.abs(x) - np.abs(y)
    below = np.maximum(-z, 0)
    out = np.stack([x - np.copysign(below, x), y - np.copysign(below, y), z], axis=-1)
    return out / np.linalg.norm(out, axis=-1, keepdims=True)


@cache
def solid_angles(side: int) -> NDArray[np.float64]:
    """Compute the solid angles of the texels.

    Parameters
    ----------
    side : int

    Returns
    -------
    (side, side) float64
        Steradians; they sum to 4 pi.
    """
    around = directions(side)
    # a triangle of the octahedron is 1 / sqrt(3) away, and sqrt(3) larger than on the square
    out = np.abs(around).sum(axis=-1) ** 3
    out *= 4 * np.pi / out.sum()
    out.flags.writeable = False
    return out


def places(around: NDArray, side: int) -> tuple[NDArray, NDArray]:
    """Find where directions are on the square.

    Parameters
    ----------
    around : (..., 3) float
        Of any length but 0.
    side : int

    Returns
    -------
    x, y : (...) float
        In texels, 0 to side; a texel's middle is at a half.
    """
    x, y, z = np.moveaxis(around / np.abs(around).sum(axis=-1, keepdims=True), -1, 0)
    folded = z < 0
    u = np.where(folded, np.copysign(1 - np.abs(y), x), x)
    v = np.where(folded, np.copysign(1 - np.abs(x), y), y)
    return (u * 0.5 + 0.5) * side, (v * 0.5 + 0.5) * side


def of_environment(environment: Environment, side: int) -> NDArray[np.float32]:
    """Bring an environment map to the square; no light is lost.

    Parameters
    ----------
    environment : Environment
        With its turn.
    side : int

    Returns
    -------
    (side, side, 3) float32
        Scene-linear radiance: the mean over each texel.
    """
    height, width = environment.image.shape[:2]
    finer = max(1, int(np.ceil(np.sqrt(SAMPLES * side * side / (height * width)))))
    total = np.zeros((side * side, 4))
    azimuth, latitude, weight = sample_directions(height, width, finer, environment.turn)
    rows = max(1, (1 << 20) // (width * finer * finer))
    for top in range(0, height, rows):
        texels = environment.image[top : top + rows].repeat(finer, axis=0).repeat(finer, axis=1)
        some = slice(top * finer, top * finer + len(texels))
        x, y = places(of_map(azimuth, latitude[some]), side)
        at = np.minimum(y.astype(np.intp), side - 1) * side + np.minimum(
            x.astype(np.intp), side - 1
        )
        omega = np.broadcast_to(weight[some, None], at.shape).ravel()
        for c in range(3):
            total[:, c] += np.bincount(at.ravel(), omega * texels[..., c].ravel(), side * side)
        total[:, 3] += np.bincount(at.ravel(), omega, side * side)
    out = np.divide(total[:, :3], total[:, 3:], where=total[:, 3:] > 0, out=np.zeros((side**2, 3)))
    empty = np.flatnonzero(total[:, 3] == 0)
    out[empty] = environment.at(directions(side).reshape(-1, 3)[empty])
    return out.reshape(side, side, 3).astype(np.float32)


def levels(map: NDArray[np.float32]) -> list[NDArray[np.float32]]:
    """Make the smaller levels of a map, each a half of the one before.

    Parameters
    ----------
    map : (side, side, 3) float32
        The side is a power of two, times `SMALLEST`.

    Returns
    -------
    list of (side, side, 3) float32
        The map first, the smallest last. A texel is the mean of four, by solid angle.
    """
    out = [map]
    weight = solid_angles(len(map))[..., None]
    while len(out[-1]) > SMALLEST:
        side = len(out[-1])
        half = (side // 2, 2, side // 2, 2, -1)
        light = (out[-1] * weight).reshape(half).sum(axis=(1, 3))
        weight = weight.reshape(half).sum(axis=(1, 3))
        out.append((light / weight).astype(np.float32))
    return out


def _texels(level: NDArray[np.float32], i: NDArray, j: NDArray) -> NDArray[np.float32]:
    """Texels at (row j, column i), -1 to side: beyond a border the square goes on folded."""
    side = len(level)
    over = (i < 0) | (i >= side)
    i, j = np.where(over, np.clip(i, 0, side - 1), i), np.where(over, side - 1 - j, j)
    over = (j < 0) | (j >= side)
    i, j = np.where(over, side - 1 - i, i), np.clip(j, 0, side - 1)
    return level[j, i]


def read(level: NDArray[np.float32], around: NDArray) -> NDArray[np.float32]:
    """Read a level between its texels.

    Parameters
    ----------
    level : (side, side, 3) float32
    around : (n, 3) float
        Directions.

    Returns
    -------
    (n, 3) float32
    """
    x, y = (p - 0.5 for p in places(around, len(level)))
    i, j = np.floor(x), np.floor(y)
    fx, fy = ((p - q)[:, None].astype(np.float32) for p, q in ((x, i), (y, j)))
    i, j = i.astype(np.intp), j.astype(np.intp)
    low = _texels(level, i, j) * (1 - fx) + _texels(level, i + 1, j) * fx
    high = _texels(level, i, j + 1) * (1 - fx) + _texels(level, i + 1, j + 1) * fx
    return np.asarray(low * (1 - fy) + high * fy, np.float32)


def look(every: list[NDArray[np.float32]], around: NDArray, width: NDArray) -> NDArray[np.float32]:
    """Average a map about directions.

    Parameters
    ----------
    every : list of (side, side, 3) float32
        The levels of the map.
    around : (n, 3) float
        Unit vectors.
    width : (n,) float
        The standard deviation over which to average, in radians.

    Returns
    -------
    (n, 3) float32
        Scene-linear radiance.
    """
    sums = np.abs(around).sum(axis=-1)
    texel = SPREAD * 2 / len(every[0]) * sums * np.sqrt(sums)
    at = np.clip(np.log2(np.maximum(width / texel, 1e-6)), 0, len(every) - 1)
    low = np.minimum(at.astype(np.intp), len(every) - 2)
    part = (at - low)[:, None].astype(np.float32)
    out = np.empty((len(around), 3), np.float32)
    for level in np.unique(low).tolist():
        these = low == level
        fine, coarse = (read(every[level + i], around[these]) for i in (0, 1))
        out[these] = fine * (1 - part[these]) + coarse * part[these]
    return out
