"""A small field in one piece, in memory: what a preview is added up from many times a second.

A field on disk is in tiles, as it was captured, and each patch of each tile is a step of its own:
of a proxy these are thousands of steps of a few pixels. Here the tiles stand together in as many
blocks as there are threads.

>>> import tempfile
>>> from pathlib import Path
>>> from arto.core.hemicube import Hemicube
>>> from arto.core.field.tile_writer import TileWriter
>>> from arto.core.field.writer import FieldWriter
>>> with tempfile.TemporaryDirectory() as folder:
...     writer = FieldWriter(Path(folder) / "field", Hemicube(patches=1), (8, 4))
...     for y in (0, 4):
...         tile = TileWriter(Region(0, y, 4, 4), {})
...         for _ in range(6):
...             tile.add(np.ones(16, np.uint8), np.ones((16, 3)), {1: np.empty((16, 0))})
...         writer.add(tile)
...     writer.close()
...     field = Field(writer.folder)
...     print(len(field.tiles), len(merged(field).tiles))
2 1
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ..region import Region
from ..supports import Support
from .field import Field
from .model import Model
from .tile import Tile

# Blocks: threads that add up, on the machines that artists have at the least.
BLOCKS = 2
# The largest field that is held: pixels times patches.
MOST = 60_000_000


@dataclass(frozen=True)
class _Entries:
    """Of one block and patch: `pixels` (n,), codes (3, n), parameters (p, n)."""

    pixels: NDArray[np.int32]
    codes: NDArray[np.uint8]
    parameters: NDArray


class MergedModel:
    """The entries of one support model, as `tile.Model` has them.

    Parameters
    ----------
    support : Support
        The model.
    found : list of list
        By block and patch, its entries; None where there are none.
    like : Model
        That of one of the tiles.
    """

    def __init__(self, support: Support, found: list[list[_Entries | None]], like: Model) -> None:
        self.path, self.support, self.end = like.path, support, like.end
        patches = len(found[0])
        self.counts = np.array(
            [[len(e.pixels) if e else 0 for e in block] for block in found], np.uint32
        ).reshape(len(found), patches)
        there = [e for block in found for e in block if e is not None]
        self.codes = np.concatenate([e.codes for e in there], axis=1)
        self.parameters = np.concatenate([e.parameters for e in there], axis=1)
        self._pixels = [[e.pixels if e else None for e in block] for block in found]
        ends = np.cumsum(self.counts, dtype=np.int64)
        self.starts = (ends - self.counts.ravel()).reshape(self.counts.shape)

    def at(self, block: int, k: int) -> slice:
        """As `Model.at`.

        Parameters
        ----------
        block, k : int

        Returns
        -------
        slice
        """
        a = int(self.starts[block, k])
        return slice(a, a + int(self.counts[block, k]))

    def pixels(self, block: int, k: int) -> NDArray[np.int32]:
        """As `Model.pixels`.

        Parameters
        ----------
        block, k : int

        Returns
        -------
        (n,) int32
        """
        found = self._pixels[block][k]
        assert found is not None
        return found

    def shares(self, at: slice) -> NDArray[np.float32]:
        """As `Model.shares`.

        Parameters
        ----------
        at : slice

        Returns
        -------
        (3, n) float32
        """
        out = self.codes[:, at].astype(np.float32)
        out *= out
        return out

    def parameters_of(self, at: slice) -> NDArray[np.float32]:
        """As `Model.parameters_of`.

        Parameters
        ----------
        at : slice

        Returns
        -------
        (n, p) float32
        """
        out = self.parameters[:, at].astype(np.float32)
        out /= self.end
        return out.T


class MergedTile:
    """All of a field, as `tile.Tile` has a part of it.

    Parameters
    ----------
    tiles : list of Tile
        That stand below each other, from the top.

    Raises
    ------
    FieldError
        If one is damaged.
    """

    def __init__(self, tiles: list[Tile]) -> None:
        first = tiles[0].region
        rows = sum(t.region.height for t in tiles)
        self.region = Region(first.x, first.y, first.width, rows)
        self.patches = tiles[0].patches
        for tile in tiles:
            tile.open()
        groups = [g for g in np.array_split(np.arange(len(tiles)), BLOCKS) if len(g)]
        self.blocks: list[slice] = []
        self._layers: dict[str, NDArray[np.float32]] = {}
        self._tiles = tiles
        self._tinted = any(t.has_layer("through") for t in tiles)
        self._names = set(tiles[0].sizes).intersection(*(t.sizes for t in tiles))
        begin = 0
        for group in groups:
            end = begin + sum(tiles[i].region.pixels for i in group)
            self.blocks.append(slice(begin, end))
            begin = end
        self.models = self._merged([[tiles[i] for i in group] for group in groups])
        whole = slice(None)
        self._ones = np.concatenate([t.ones(whole) for t in tiles])
        self.rest_weights: NDArray[np.float32] | None = None
        with_rest = [t for t in tiles if t.rest_weights is not None]
        if len(with_rest) == len(tiles):
            self._rest = np.concatenate([t.rest() for t in tiles])
            self.rest_patches = np.concatenate([t.rest_patches for t in tiles], axis=1)
            # a tile weighs the patches of its rest by what of each is in it; their mean will do for
            # what is too small to be an entry
            size = [float(t.rest().sum(dtype=np.float64)) + 1e-12 for t in tiles]
            weights = [cast(NDArray, t.rest_weights) for t in tiles]
            self.rest_weights = np.average(weights, axis=0, weights=size).astype(np.float32)
        # all but the layers is in memory now
        self.close()

    def _merged(self, groups: list[list[Tile]]) -> list[MergedModel]:
        names = sorted({m.support.code for g in groups for t in g for m in t.models})
        out = []
        for code in names:
            found: list[list[_Entries | None]] = []
            like: Model | None = None
            for group in groups:
                parts: list[list[_Entries]] = [[] for _ in range(self.patches)]
                offset = 0
                for tile in group:
                    for model in (m for m in tile.models if m.support.code == code):
                        like = model
                        for b, where in enumerate(tile.blocks):
                            for k in np.flatnonzero(model.counts[b]).tolist():
                                at = model.at(b, k)
                                pixels = offset + where.start + model.pixels(b, k)
                                one = model.codes[:, at], model.parameters[:, at]
                                parts[k].append(_Entries(pixels.astype(np.int32), *one))
                    offset += tile.region.pixels
                found.append([_joined(p) for p in parts])
            assert like
            out.append(MergedModel(like.support, found, like))
        return out

    def ones(self, pixels: slice) -> NDArray[np.float32]:
        """As `Tile.ones`.

        Parameters
        ----------
        pixels : slice

        Returns
        -------
        (n, 3) float32
        """
        return self._ones[pixels]

    def rest(self, pixels: slice = slice(None)) -> NDArray[np.float32]:
        """As `Tile.rest`.

        Parameters
        ----------
        pixels : slice

        Returns
        -------
        (n, 3) float32
        """
        return self._rest[pixels]

    def layer(
        self, name: str, part: tuple[slice, slice] = (slice(None), slice(None))
    ) -> NDArray[np.float32]:
        """As `Tile.layer`, and kept.

        Parameters
        ----------
        name : str
        part : tuple of slice

        Returns
        -------
        (h, w) or (h, w, 3) float32

        Raises
        ------
        FieldError
            If a tile has none.
        """
        if name not in self._layers:
            self._layers[name] = np.concatenate([t.layer(name) for t in self._tiles])
            self.close()
        return self._layers[name][part]

    def through(
        self, part: tuple[slice, slice] = (slice(None), slice(None))
    ) -> NDArray[np.float32]:
        """As `Tile.through`, and kept.

        Parameters
        ----------
        part : tuple of slice

        Returns
        -------
        (h, w, 3) float32

        Raises
        ------
        FieldError
            If a tile is missing or damaged.
        """
        if "through" not in self._layers:
            self._layers["through"] = np.concatenate([t.through() for t in self._tiles])
            self.close()
        return self._layers["through"][part]

    def has_layer(self, name: str) -> bool:
        """Whether every tile has a layer; of `through`, whether any has.

        Parameters
        ----------
        name : str

        Returns
        -------
        bool
        """
        return self._tinted if name == "through" else name in self._names

    def own_layers(self) -> list[str]:
        """Layers of light groups of the scene's own lamps that every tile has.

        Returns
        -------
        list of str
        """
        return [name for name in self._names if name.startswith("own_")]

    def open(self) -> None:
        """Do nothing: all that relighting needs is in memory."""

    def close(self) -> None:
        """Let go of the files of the tiles."""
        for tile in self._tiles:
            tile.close()


def _joined(parts: list[_Entries]) -> _Entries | None:
    if not parts:
        return None
    return _Entries(
        np.concatenate([p.pixels for p in parts]),
        np.concatenate([p.codes for p in parts], axis=1),
        np.concatenate([p.parameters for p in parts], axis=1),
    )


def merged(field: Field) -> Field:
    """The field, its tiles in one piece where they stand below each other and are small enough.

    Parameters
    ----------
    field : Field

    Returns
    -------
    Field
        Another one; the field itself where its tiles stay as they are.

    Raises
    ------
    FieldError
        If a tile is damaged.
    """
    tiles = sorted(field.tiles, key=lambda t: t.region.y)
    first = tiles[0].region
    below = first.y
    for tile in tiles:
        r = tile.region
        if (r.x, r.width, r.y) != (first.x, first.width, below):
            return field
        below += r.height
    pixels = sum(t.region.pixels for t in tiles)
    if len(tiles) < 2 or pixels * len(field.hemicube) > MOST:
        return field
    out = Field(field.folder)
    out.tiles = cast(list[Tile], [MergedTile(tiles)])
    return out
