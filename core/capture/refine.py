"""Refinement: small patches where a scene tells their light apart, large patches elsewhere.

A cheap probe shows how each cell of a 16 x 16 grid on every face lights the pixels. From the probe
follows the error of a patch of any size under the linear support (paper 5; `supports.linear`): the
part of the transport over its cells that is not a plane. The environment is unknown when a scene
is captured, but directions a few cells apart have similar light. So an error is measured by its
expected size under such light. Patches are split where this saves most, as long as patches are
left to give, and joined again where joining costs next to nothing.

Examples
--------
>>> start = Hemicube(patches=1)
>>> probe = np.zeros((6 * 256, 1, 1, 3))
>>> probe[0] = 1.0  # all light comes from the cell in a corner of the face "top"
>>> found = refine(start, probe, samples=1e6, most=20)
>>> len(found) <= 20, found.closed, sorted({face for face, n, *_ in found.leaves if n > 1})
(True, True, ['top'])
"""

from __future__ import annotations

import heapq
import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..errors import HemicubeError
from ..faces import FINEST, LEAF_SIDES, Leaf
from ..hemicube import Hemicube
from ..patterns import channel_sum

# Cells (of 5.6 degrees) over which the correlation of light falls to 1/e.
ALIKE = 3.0
# Four patches are joined when that surely adds less than this to a pixel's squared relative error.
# The noise of a capture is far larger.
NOTHING_LOST = 1e-6
# A split that does not surely save more is not worth three patches.
NOTHING_GAINED = 3e-6
# Surely: by so many standard deviations of the probe's own noise.
SURE = 2.0


@lru_cache(maxsize=8)
def _filters(size: int) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """The error of the linear support for a patch of size x size cells.

    Gives F, for which |F t|^2 is the mean squared error over light for a transport t; the increase
    of that by noise of variance 1 in each cell; and the variance of the increase, relative to its
    square, for one pixel.
    """
    x = (np.arange(size) + 0.5) / size - 0.5
    u, v = (t.ravel() for t in np.meshgrid(x, x))
    plane = np.stack([np.ones_like(u), u, v])
    plane /= np.linalg.norm(plane, axis=1, keepdims=True)
    left = np.eye(size * size) - plane.T @ plane
    apart = np.hypot(u[:, None] - u, v[:, None] - v) * size
    kernel = left @ np.exp(-apart / ALIKE) @ left
    values, vectors = np.linalg.eigh(kernel)
    keep = values > 1e-6 * values.max()
    spread = 2 * float(np.square(values).sum() / values.sum() ** 2)
    return (vectors[:, keep] * np.sqrt(values[keep])).T, np.diag(kernel).copy(), spread


class _Costs:
    """The squared relative error, mean over pixels, of each patch of a face."""

    def __init__(self, transport: NDArray[np.float64], noise: NDArray[np.float64]) -> None:
        self.transport = transport  # (16, 16, n)
        self.noise = noise  # (16, 16)
        self.known: dict[tuple[int, int, int], tuple[float, float]] = {}

    def of(self, n: int, row: int, column: int) -> tuple[float, float]:
        """The cost of a patch, n x n of which make up the face, and its standard deviation."""
        key = n, row, column
        if key not in self.known:
            self.known[key] = self._cost(*key)
        return self.known[key]

    def _cost(self, n: int, row: int, column: int) -> tuple[float, float]:
        s = FINEST // n
        if s == 1:
            return 0.0, 0.0
        cells = slice(row * s, (row + 1) * s), slice(column * s, (column + 1) * s)
        t = self.transport[cells].reshape(s * s, -1)
        wrong, noisy, spread = _filters(s)
        pixels = t.shape[1]
        expected = float(noisy @ self.noise[cells].ravel()) / pixels
        found = float(np.square(wrong @ t).sum()) / pixels
        return found - expected, expected * math.sqrt(spread / pixels)

    def gain(self, n: int, row: int, column: int, sure: float) -> float:
        """What splitting a patch in four saves, plus `sure` standard deviations."""
        if n == FINEST:
            return 0.0
        cost, deviation = self.of(n, row, column)
        left = sum(self.of(2 * n, 2 * row + i, 2 * column + j)[0] for i in (0, 1) for j in (0, 1))
        return cost - left + sure * deviation


def check(hemicube: Hemicube) -> None:
    """Check that `refine` can start from a hemicube.

    Parameters
    ----------
    hemicube : Hemicube

    Raises
    ------
    HemicubeError
        The hemicube has leaves or half sides, or a number of patches that is no power of 2.
    """
    if hemicube.leaves or hemicube.half_sides or hemicube.patches not in LEAF_SIDES:
        raise HemicubeError(
            "only whole faces of 1, 2, 4, 8 or 16 patches a side can be refined: choose such a "
            "number, or turn Adaptive Patches off"
        )


def refine(hemicube: Hemicube, probe: NDArray, samples: float, most: int) -> Hemicube:
    """Make a hemicube whose patches are small where a scene needs it.

    Every direction keeps a patch, so the field is also right for light that the probe did not see.

    Parameters
    ----------
    hemicube : Hemicube
        A grid of 1, 2, 4, 8 or 16 patches a side, of whole faces.
    probe : (F * 16 * 16, h, w, 3) float
        Reflection coefficients of the faces cut 16 x 16, row by row.
    samples : float
        Samples a pixel of the probe. They determine its noise, which must not count as detail.
    most : int
        The most patches.

    Returns
    -------
    Hemicube

    Raises
    ------
    HemicubeError
        As `check`, or the probe has another number of patches.

    Source
    ------
    Paper 9, adaptive patches as future work.
    """
    check(hemicube)
    faces = len(hemicube.faces)
    if probe.shape[0] != faces * FINEST**2:
        raise HemicubeError(f"a probe of {probe.shape[0]} patches, not {faces * FINEST**2}")
    light = channel_sum(probe).reshape(faces, FINEST, FINEST, -1)
    # pixels of a broken material tell nothing here; the capture itself reports them
    light = light[..., np.isfinite(light).all(axis=(0, 1, 2))]
    total = light.sum(axis=(0, 1, 2))
    lit = total > 1e-3 * total.mean() if total.any() else np.zeros(total.shape, bool)
    if not lit.any():
        return hemicube
    # relative to each pixel, as errors are; the path of a sample carries about 1/samples
    light = light[..., lit] / total[lit]
    noise = light.sum(axis=-1) / samples
    costs = [_Costs(t, n) for t, n in zip(light, noise, strict=True)]

    start = hemicube.patches
    heap: list[tuple[float, int, int, int, int]] = [
        (-costs[f].gain(start, row, column, -SURE), f, start, row, column)
        for f in range(faces)
        for row in range(start)
        for column in range(start)
    ]
    heapq.heapify(heap)
    kept: set[tuple[int, int, int, int]] = set()
    while heap and len(kept) + len(heap) + 3 <= most:
        gain, f, n, row, column = heapq.heappop(heap)
        if -gain < NOTHING_GAINED:
            kept.add((f, n, row, column))
            continue
        for i in (0, 1):
            for j in (0, 1):
                child = 2 * n, 2 * row + i, 2 * column + j
                heapq.heappush(heap, (-costs[f].gain(*child, -SURE), f, *child))
    kept |= {tuple(patch) for _, *patch in heap}  # type: ignore[misc]
    _join(kept, costs)
    leaves: list[Leaf] = [(hemicube.faces[f], n, r, c) for f, n, r, c in sorted(kept)]
    return replace(hemicube, leaves=tuple(leaves))


def _join(kept: set[tuple[int, int, int, int]], costs: list[_Costs]) -> None:
    """Join four patches, in place, wherever this loses nothing."""
    for n in (FINEST // 2, FINEST // 4, FINEST // 8, FINEST // 16):
        for f, cost in enumerate(costs):
            for row in range(n):
                for column in range(n):
                    four = {(f, 2 * n, 2 * row + i, 2 * column + j) for i in (0, 1) for j in (0, 1)}
                    if four <= kept and cost.gain(n, row, column, SURE) < NOTHING_LOST:
                        kept -= four
                        kept.add((f, n, row, column))
