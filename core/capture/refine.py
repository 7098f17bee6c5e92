"""Which patches a scene needs: small ones where its light is told apart, large ones where not.

A cheap probe shows how each cell of a 16x16 grid on every face lights the pixels. From it follows
what a patch of any size would get wrong with the linear support (paper 5; `supports.linear`): the
part of the transport over its cells that no plane follows. Light itself is not known yet, but it is
alike in directions a few cells apart, so what is wrong counts as its size under such light. Patches
are then split where that saves most, as long as there are patches left to give, and joined again
where it costs next to nothing.
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
from .moments import channel_sum

# Cells (5.6 degrees) over which light stays alike: its correlation falls to 1/e.
ALIKE = 3.0
# Four patches are joined when that surely adds less than this to a pixel's squared relative error:
# far under what a capture's noise has.
NOTHING_LOST = 1e-6
# A split that does not surely save more is not worth three patches.
NOTHING_GAINED = 3e-6
# Surely: by so many standard deviations of the probe's own noise.
SURE = 2.0


@lru_cache(maxsize=8)
def _filters(size: int) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """For a patch of size x size cells: F with |F t|^2 the squared error, on average over light, of
    the linear support for a transport t; what noise of variance 1 in each cell adds to it; and the
    variance of that, in its own square, for one pixel."""
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
        """The cost of a patch, of which there would be n x n on the face, and the standard
        deviation of that."""
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
        """What splitting a patch in four saves, give or take `sure` standard deviations."""
        if n == FINEST:
            return 0.0
        cost, deviation = self.of(n, row, column)
        left = sum(self.of(2 * n, 2 * row + i, 2 * column + j)[0] for i in (0, 1) for j in (0, 1))
        return cost - left + sure * deviation


def check(hemicube: Hemicube) -> None:
    """Raise HemicubeError for a hemicube that `refine` cannot start from."""
    if hemicube.leaves or hemicube.half_sides or hemicube.patches not in LEAF_SIDES:
        raise HemicubeError(
            "only whole faces of 1, 2, 4, 8 or 16 patches a side can be refined: choose such a "
            "number, or turn Adaptive Patches off"
        )


def refine(hemicube: Hemicube, probe: NDArray, samples: float, most: int) -> Hemicube:
    """A hemicube whose patches are where a scene needs them.

    hemicube: a grid of 1, 2, 4, 8 or 16 patches a side, whole faces; probe: (F * 16 * 16, h, w, 3)
    reflection coefficients of the same faces cut 16x16, row by row; samples: of the probe, whose
    noise is not taken for detail; most: as many patches at the most. Every direction keeps a patch:
    the field stays right for light that the probe did not see. Raises HemicubeError.
    """
    check(hemicube)
    faces = len(hemicube.faces)
    if probe.shape[0] != faces * FINEST**2:
        raise HemicubeError(f"a probe of {probe.shape[0]} patches, not {faces * FINEST**2}")
    light = channel_sum(probe).reshape(faces, FINEST, FINEST, -1)
    # a broken material's pixels tell nothing; the capture itself will name them
    light = light[..., np.isfinite(light).all(axis=(0, 1, 2))]
    total = light.sum(axis=(0, 1, 2))
    lit = total > 1e-3 * total.mean() if total.any() else np.zeros(total.shape, bool)
    if not lit.any():
        return hemicube
    # relative to each pixel, as errors are counted; a path of a sample carries about 1/samples
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
    """Put four patches together, in place, wherever nothing is lost by it."""
    for n in (FINEST // 2, FINEST // 4, FINEST // 8, FINEST // 16):
        for f, cost in enumerate(costs):
            for row in range(n):
                for column in range(n):
                    four = {(f, 2 * n, 2 * row + i, 2 * column + j) for i in (0, 1) for j in (0, 1)}
                    if four <= kept and cost.gain(n, row, column, SURE) < NOTHING_LOST:
                        kept -= four
                        kept.add((f, n, row, column))
