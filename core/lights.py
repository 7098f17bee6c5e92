"""Many lights at once: the sum over patches as a product of matrices.

The light of an entry is linear in a few numbers of the environment on its patch: the mean, and the
slopes for models whose average is a plane. So for many lights the entries of a block of pixels are
unpacked once, into a matrix that is 0 where a pixel has no entry. This matrix is multiplied by the
numbers of all lights.

Examples
--------
>>> entries = np.array([[0.5, 0.0], [0.2, 0.8]])  # (pixels, patches)
>>> radiance = np.array([[1.0, 2.0], [0.0, 1.0]])  # (patches, lights)
>>> (entries @ radiance).round(3).tolist()
[[0.5, 1.0], [0.2, 1.2]]
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .errors import FieldError
from .field.model import Model
from .field.tile import Tile
from .light.light import PatchLight

# Bytes of entries that are unpacked at a time: a few patches of a block.
ROOM = 1 << 26
# Pixels that are multiplied at a time, so that they fit the cache.
COLUMNS = 4096


class Lights:
    """L lights on the patches of a tile, as matrices.

    Parameters
    ----------
    tile : Tile
    lights : sequence of PatchLight
    """

    def __init__(self, tile: Tile, lights: Sequence[PatchLight]) -> None:
        self.tile, self.count = tile, len(lights)
        self._lights = lights
        # by model: (K, 1 + p, 3, L), the factors of its parameters; None where it has no plane
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
        """Say whether `add` can add up the entries of a model.

        Parameters
        ----------
        model : Model

        Returns
        -------
        bool
        """
        return self._of[model.support.code] is not None

    def add(
        self, total: NDArray[np.float32], model: Model, block: int, room: NDArray[np.float32]
    ) -> None:
        """Add the light of a model's entries in a block.

        Parameters
        ----------
        total : (3, L, n) float32
            The sums so far, in units of the tile's `ones`; changed in place.
        model : Model
        block : int
        room : (`ROOM` / 4,) float32
            Memory to work in.

        Raises
        ------
        FieldError
            The counts of the tile contradict each other.
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
        """Compute the light of what was too small to be an entry, see `Tile.rest`.

        Parameters
        ----------
        pixels : slice
            Pixels of the tile, row by row.

        Returns
        -------
        (3, L, n) float32 or None
            None where the tile has no rest.
        """
        if self._rest is None:
            return None
        packed = self.tile.rest_patches[:, pixels]
        bits = np.unpackbits(packed, axis=0, count=self.tile.patches, bitorder="little")
        sums = self._rest @ bits.astype(np.float32)
        means, weight = sums[:-1], sums[-1:]
        np.divide(means, weight, out=means, where=weight > 0)
        by_light = means.reshape(self.count, 3, -1).transpose(1, 0, 2)
        return np.asarray(self.tile.rest(pixels).T[:, None] * by_light, np.float32)
