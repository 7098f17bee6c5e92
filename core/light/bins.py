"""Bins: the small grid on every patch, equal in angle, that collects an environment map.

Examples
--------
>>> u, v = bin_centres(Hemicube(patches=1), 0, 2)
>>> [round(float(x), 3) for x in u]  # a face spans 90 degrees: +-22.5 degrees at tan 22.5
[0.293, 0.707]
"""

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

# Samples of a map that are worked on at a time, and the most samples whose bins are kept.
BLOCK = 1 << 20
KEPT = 1 << 22
_KEPT: dict[tuple, list[Samples]] = {}
_MONOMIALS: dict[tuple, NDArray[np.float64]] = {}


@dataclass(frozen=True)
class Samples:
    """Some rows of a map's texels, sampled.

    Parameters
    ----------
    rows : slice
        The rows of texels.
    finer : int
        Samples along the side of a texel.
    bins : (rows * finer, columns * finer) int32
        The bin of each sample; -1 where no patch is.
    weight : (rows * finer,) float64
        The solid angle of one sample of each row, in steradians.
    """

    rows: slice
    finer: int
    bins: NDArray[np.int32]
    weight: NDArray[np.float64]

    @cached_property
    def lit(self) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """The bins of the samples that have one, (n,) int, and the solid angles of these samples,
        (n,).
        """
        lit = self.bins.ravel() >= 0
        index = self.bins.ravel()[lit].astype(np.intp)
        return index, np.repeat(self.weight, self.bins.shape[1])[lit]

    @cached_property
    def solid_angles(self) -> NDArray[np.float64]:
        """(n,) float64: the summed solid angles of the samples in each bin, up to the last bin used
        here.
        """
        return np.bincount(*self.lit)


def default_resolution(hemicube: Hemicube, environment: Environment) -> NDArray[np.intp]:
    """Choose the bins a side of each patch: about one texel of the map each, and at least 4.

    A lamp's cell has one bin: nothing is known of the light within it.

    Parameters
    ----------
    hemicube : Hemicube
    environment : Environment

    Returns
    -------
    (K,) int
    """
    if hemicube.lamps:
        return np.ones(len(hemicube), np.intp)
    return np.maximum(4, environment.image.shape[1] // (4 * hemicube.sides))


def sample_bins(
    hemicube: Hemicube,
    height: int,
    width: int,
    resolutions: NDArray,
    offsets: NDArray,
) -> Iterator[Samples]:
    """Find the bin of every sample of a map, block by block of rows.

    The bins depend on the size of the map alone. Those of the last map are kept unless it is large,
    because an artist often goes through HDRIs of one size.

    Parameters
    ----------
    hemicube : Hemicube
    height, width : int
        The size of the map in texels.
    resolutions : (K,) int
        Bins a side of each patch.
    offsets : (K + 1,) int
        The number of the first bin of each patch.

    Yields
    ------
    Samples
    """
    key = (hemicube, height, width, resolutions.tobytes())
    if key in _KEPT:
        yield from _KEPT[key]
        return
    # two samples a bin and axis on average; a narrow bin may still have none
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
    """Compute the centres of a patch's bins.

    Parameters
    ----------
    hemicube : Hemicube
    k : int
        The number of the patch.
    resolution : int
        Bins a side, r.

    Returns
    -------
    u, v : (r,) float64
        Patch coordinates along u and along v.
    """
    x = hemicube.extents[k]
    mid = (np.arange(resolution) + 0.5) / resolution
    out = []
    for low, high in ((x[0], x[1]), (x[2], x[3])):
        angle = np.arctan(low) + (np.arctan(high) - np.arctan(low)) * mid
        out.append((np.tan(angle) - low) / (high - low))
    return out[0], out[1]


def bin_monomials(hemicube: Hemicube, resolutions: NDArray) -> NDArray[np.float64] | None:
    """Evaluate the monomials at the centres of all patches' bins.

    They depend on the resolutions alone, so the last ones are kept.

    Parameters
    ----------
    hemicube : Hemicube
    resolutions : (K,) int
        Bins a side of each patch.

    Returns
    -------
    (6, bins) float64 or None
        Patch by patch, row by row of v. None where this would take too much memory.
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
    """Turn patch coordinates into bin coordinates, in which bins are equal in angle.

    Parameters
    ----------
    hemicube : Hemicube
    k : int or (n,) int
        The numbers of the patches.
    t : (n,) float
        Patch coordinates, 0 to 1.
    axis : int
        0 for u, 1 for v.
    r : int or (n,) int
        Bins a side.

    Returns
    -------
    (n,) float
        0 to r.
    """
    low = hemicube.extents[k, 2 * axis]
    high = hemicube.extents[k, 2 * axis + 1]
    start = np.arctan(low)
    return (np.arctan(low + (high - low) * t) - start) * (r / (np.arctan(high) - start))
