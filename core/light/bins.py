"""Bins: the small grid on every patch, equal in angle, that an environment map is collected in."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..hemicube import Hemicube
from ..patterns import MONOMIALS, monomials
from .environment import Environment, directions, sample_directions

# Samples of a map that are worked on at a time, and of one whose bins are kept.
BLOCK = 1 << 20
KEPT = 1 << 22
_KEPT: dict[tuple, list[Samples]] = {}
_MONOMIALS: dict[tuple, NDArray[np.float64]] = {}


@dataclass(frozen=True)
class Samples:
    """Some rows of a map's texels, sampled: which rows, how many samples a texel's side has, the
    bin of each sample (rows * finer, columns * finer; -1: no patch), and the solid angle of one of
    each row of samples."""

    rows: slice
    finer: int
    bins: NDArray[np.int32]
    weight: NDArray[np.float64]

    @cached_property
    def lit(self) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Of the samples that have a bin: which, and their solid angles."""
        lit = self.bins.ravel() >= 0
        index = self.bins.ravel()[lit].astype(np.intp)
        return index, np.repeat(self.weight, self.bins.shape[1])[lit]

    @cached_property
    def solid_angles(self) -> NDArray[np.float64]:
        """Of each bin up to the last that has samples here, (n,), what they sum to."""
        return np.bincount(*self.lit)


def default_resolution(hemicube: Hemicube, environment: Environment) -> NDArray[np.intp]:
    """Bins a side of each patch (K,): about one texel of the map each, at least 4."""
    return np.maximum(4, environment.image.shape[1] // (4 * hemicube.sides))


def sample_bins(
    hemicube: Hemicube,
    height: int,
    width: int,
    resolutions: NDArray,
    offsets: NDArray,
) -> Iterator[Samples]:
    """The bins of every sample of a map of that size, block by block.

    The same for every map of a size, so those of the last one are kept unless it is large: turning
    through HDRIs is common.
    """
    key = (hemicube, height, width, resolutions.tobytes())
    if key in _KEPT:
        yield from _KEPT[key]
        return
    # two samples a bin and axis on average; a narrow bin may still stay empty
    finer = max(1, int(np.ceil(8 * (resolutions * hemicube.sides).max() / width)))
    azimuth, latitude, weight = sample_directions(height, width, finer)

    def fill(bins: NDArray, row: int) -> None:
        # float64: float32 moves a sample on a patch's border to the other side
        k, u, v = hemicube.locate(directions(azimuth, latitude[row : row + len(bins)]))
        r = resolutions[k].astype(np.int32)
        i = bin_coordinate(hemicube, k, u, 0, r).astype(np.int32)
        j = bin_coordinate(hemicube, k, v, 1, r).astype(np.int32)
        np.clip(i, 0, r - 1, out=i)
        np.clip(j, 0, r - 1, out=j)
        bins[:] = np.where(k < 0, -1, offsets[k] + j * r + i)

    keep = [] if height * width * finer * finer <= KEPT else None
    if keep is not None:
        _KEPT.clear()
    step = max(1, BLOCK // (width * finer * finer))
    with ThreadPoolExecutor() as pool:
        for first in range(0, height, step):
            rows = slice(first, min(first + step, height))
            lines = slice(rows.start * finer, rows.stop * finer)
            bins = np.empty((lines.stop - lines.start, width * finer), np.int32)
            at = range(0, len(bins), 64)
            list(pool.map(fill, [bins[i : i + 64] for i in at], [lines.start + i for i in at]))
            block = Samples(rows, finer, bins, weight[lines])
            if keep is not None:
                keep.append(block)
            yield block
    if keep is not None:
        _KEPT[key] = keep


def bin_centres(hemicube: Hemicube, k: int, resolution: int) -> tuple[NDArray, NDArray]:
    """Patch coordinates of a patch's bins' centres along u and along v -> (r,), (r,)."""
    x = hemicube.extents[k]
    mid = (np.arange(resolution) + 0.5) / resolution
    out = []
    for low, high in ((x[0], x[1]), (x[2], x[3])):
        angle = np.arctan(low) + (np.arctan(high) - np.arctan(low)) * mid
        out.append((np.tan(angle) - low) / (high - low))
    return out[0], out[1]


def bin_monomials(hemicube: Hemicube, resolutions: NDArray) -> NDArray[np.float64] | None:
    """The monomials at the centres of all patches' bins, (6, bins), patch by patch and row by row.

    The same for every map of a size, so those of the last one are kept. None where they are many.
    """
    if len(MONOMIALS) * int((resolutions**2).sum()) > KEPT:
        return None
    key = (hemicube, resolutions.tobytes())
    found = _MONOMIALS.get(key)
    if found is None:
        parts = []
        for k, r in enumerate(resolutions.tolist()):
            u, v = bin_centres(hemicube, k, r)
            parts.append(monomials(u[None, :], v[:, None]).reshape(len(MONOMIALS), -1))
        found = np.concatenate(parts, axis=1)
        _MONOMIALS.clear()
        _MONOMIALS[key] = found
    return found


def bin_coordinate(
    hemicube: Hemicube, k: NDArray | int, t: NDArray, axis: int, r: NDArray | int
) -> NDArray:
    """Patch coordinate (0..1) -> bin coordinate (0..r), where bins are equal in angle."""
    low = hemicube.extents[k, 2 * axis]
    high = hemicube.extents[k, 2 * axis + 1]
    start = np.arctan(low)
    return (np.arctan(low + (high - low) * t) - start) * (r / (np.arctan(high) - start))
