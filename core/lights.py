"""Many lights at once: the sum over patches as a product of matrices.

What a patch's entry gives is linear in a few numbers of the light there (its mean, and its slopes
for models whose average is a plane). So for many lights the entries of a block of pixels are
unpacked once, as a matrix in which what is no entry is 0, and multiplied by what the lights are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .errors import FieldError
from .field.tile import Model, Tile
from .light.light import PatchLight

# Of the unpacked entries, bytes at a time: a few patches of a block.
ROOM = 1 << 26
# Pixels that are multiplied at a time: what is in the cache is quicker.
COLUMNS = 4096


class Lights:
    """Some lights (L) on a tile's patches, as matrices."""

    def __init__(self, tile: Tile, lights: Sequence[PatchLight]) -> None:
        self.tile, self.count = tile, len(lights)
        self._lights = lights
        # by model: (K, 1 + p, 3, L), what its parameters are multiplied by; None for no plane
        self._of = {model.support.code: self._planes(model) for model in tile.models}
        weights = tile.rest_weights
        self._rest: NDArray[np.float32] | None = None
        if weights is not None:
            means = np.concatenate([light.whole.T for light in lights])
            self._rest = np.vstack([means, np.ones(tile.patches)]).astype(np.float32) * weights

    def _planes(self, model: Model) -> NDArray[np.float32] | None:
        p = len(model.parameters)
        out = np.zeros((self.tile.patches, 1 + p, 3, self.count), np.float32)
        for k in np.flatnonzero(model.counts.any(axis=0)).tolist():
            for i, light in enumerate(self._lights):
                plane = model.support.plane(light, k)
                if plane is None:
                    return None
                constant, slopes = plane
                out[k, 0, :, i] = constant
                out[k, 1:, :, i] = slopes.T / model.end
        return out

    def has(self, model: Model) -> bool:
        """Whether a model's entries can be added by `add`."""
        return self._of[model.support.code] is not None

    def add(
        self, total: NDArray[np.float32], model: Model, block: int, room: NDArray[np.float32]
    ) -> None:
        """Add a model's entries in a block to (3, L, n), in units of the tile's `ones`.

        room: `ROOM` bytes to work in.
        """
        of = self._of[model.support.code]
        assert of is not None
        n = total.shape[-1]
        row = -(-n // 8) * 8
        there = np.flatnonzero(model.counts[block])
        p = of.shape[1]
        step = max(1, room.size // (p * row))
        for first in range(0, len(there), step):
            some = there[first : first + step]
            begin, end = (model.at(block, k) for k in (int(some[0]), int(some[-1])))
            at = slice(begin.start, end.stop)
            bits = model.bits[model.rows[block, some[0]] :][: len(some) * row // 8]
            places = np.flatnonzero(np.unpackbits(bits).view(bool))
            if len(places) != at.stop - at.start:
                raise FieldError(f"{model.path} is damaged, its counts differ: fit again")
            if p * len(some) * row > room.size:  # one patch of a block, larger than usual
                room = np.empty(p * len(some) * row, np.float32)
            dense = room[: p * len(some) * row].reshape(p, len(some) * row)
            dense[...] = 0
            parameters = model.parameters[:, at].astype(np.float32)
            matrix = of[some].transpose(2, 3, 1, 0).reshape(3, self.count, -1)
            for c in range(3):
                shares = model.codes[c, at].astype(np.float32)
                shares *= shares
                dense[0][places] = shares
                for line, values in zip(dense[1:], parameters, strict=True):
                    line[places] = shares * values
                for x in range(0, n, COLUMNS):
                    these = slice(x, min(x + COLUMNS, n))
                    total[c][:, these] += matrix[c] @ dense.reshape(-1, row)[:, these]

    def rest(self, pixels: slice) -> NDArray[np.float32] | None:
        """(3, L, n): the light of what was too small to be entries, see `Tile.rest`; None where
        nothing was."""
        if self._rest is None:
            return None
        packed = self.tile.rest_patches[:, pixels]
        bits = np.unpackbits(packed, axis=0, count=self.tile.patches, bitorder="little")
        sums = self._rest @ bits.astype(np.float32)
        means, weight = sums[:-1], sums[-1:]
        np.divide(means, weight, out=means, where=weight > 0)
        by_light = means.reshape(self.count, 3, -1).transpose(1, 0, 2)
        return np.asarray(self.tile.rest(pixels).T[:, None] * by_light, np.float32)
