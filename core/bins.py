"""Bins: the small grid on every patch, equal in angle, that an environment map is collected in."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from .environment import Environment, directions, sample_directions
from .hemicube import Hemicube

_CACHE: dict[tuple, tuple[NDArray, NDArray]] = {}


def default_resolution(hemicube: Hemicube, environment: Environment) -> NDArray[np.intp]:
    """Bins a side of each patch (K,): about one texel of the map each, at least 4."""
    return np.maximum(4, environment.image.shape[1] // (4 * hemicube.sides))


def sample_bins(
    hemicube: Hemicube,
    height: int,
    width: int,
    resolutions: NDArray,
    offsets: NDArray,
    turn: float = 0.0,
) -> tuple[NDArray, NDArray]:
    """Bin of every sample of a map of that size, turned by `turn` (-1: no patch), and each sample's
    solid angle.

    The same for every map of a size, so the last one is kept: turning through HDRIs is common.
    """
    key = (hemicube, height, width, resolutions.tobytes(), turn)
    if key in _CACHE:
        return _CACHE[key]
    # two samples a bin and axis on average; a narrow bin may still stay empty
    finer = max(1, int(np.ceil(8 * (resolutions * hemicube.sides).max() / width)))
    azimuth, latitude, weight = sample_directions(height, width, finer, turn)
    # float64: float32 moves a sample on a patch's border to the other side
    bins = np.empty((height * finer, width * finer), np.int32)

    def fill(row: int) -> None:
        k, u, v = hemicube.locate(directions(azimuth, latitude[row : row + 64]))
        r = resolutions[k].astype(np.int32)
        i = bin_coordinate(hemicube, k, u, 0, r).astype(np.int32)
        j = bin_coordinate(hemicube, k, v, 1, r).astype(np.int32)
        np.clip(i, 0, r - 1, out=i)
        np.clip(j, 0, r - 1, out=j)
        bins[row : row + 64] = np.where(k < 0, -1, offsets[k] + j * r + i)

    with ThreadPoolExecutor() as pool:
        list(pool.map(fill, range(0, len(latitude), 64)))
    _CACHE.clear()
    _CACHE[key] = (bins, weight)
    return _CACHE[key]


def bin_coordinate(
    hemicube: Hemicube, k: NDArray | int, t: NDArray, axis: int, r: NDArray | int
) -> NDArray:
    """Patch coordinate (0..1) -> bin coordinate (0..r), where bins are equal in angle."""
    low = hemicube.extents[k, 2 * axis]
    high = hemicube.extents[k, 2 * axis + 1]
    start = np.arctan(low)
    return (np.arctan(low + (high - low) * t) - start) * (r / (np.arctan(high) - start))
