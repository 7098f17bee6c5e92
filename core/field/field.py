"""The reflectance field on disk: for every pixel and patch a coefficient and a support (paper 5).

A folder: `field.json` says in words what it holds, and each tile is a file of arrays that are
mapped, not read, until they are used. docs/field-format.md says enough to write a reader.

>>> proxy_folder(Path("field"), 4).name
'proxy_4'
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import FieldError
from ..hemicube import Hemicube
from ..region import Region
from . import head as heads
from .about import About
from .head import HEADER
from .tile import OF_A_MODEL, OTHERS, Tile

LAYERS = ("own", "alpha", "through", "albedo", "normal", "depth", "position")


def proxy_folder(folder: Path, factor: int) -> Path:
    """Where a field's proxy is: a field of its own.

    Parameters
    ----------
    folder : Path
        The field's.
    factor : int
        How many pixels a side one of the proxy covers.

    Returns
    -------
    Path
    """
    return folder / f"proxy_{factor}"


class Field:
    """A reflectance field, opened: the head is read, the arrays are not.

    `with Field(folder) as field:` lets go of its files at the end.

    Parameters
    ----------
    folder : Path

    Raises
    ------
    FieldError
        If it is missing, damaged, or of another version.

    Source
    ------
    Section 5 of the paper.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.head = heads.read(folder)
        patches = len(self.head.hemicube)
        self.tiles = [
            Tile(folder / t.name, t.region, dict(t.entries), patches, t.checksum)
            for t in self.head.tiles
        ]

    def __enter__(self) -> Field:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of all files of the field, see `Tile.close`: until then Windows replaces none."""
        for tile in self.tiles:
            tile.close()

    @property
    def hemicube(self) -> Hemicube:
        """Its patches."""
        return self.head.hemicube

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the whole picture."""
        return self.head.height, self.head.width

    @property
    def about(self) -> About:
        """What it was made from."""
        return self.head.about

    @property
    def region(self) -> Region:
        """The rectangle around all tiles."""
        tiles = [tile.region for tile in self.tiles]
        x, y = min(t.x for t in tiles), min(t.y for t in tiles)
        right, bottom = max(t.x + t.width for t in tiles), max(t.y + t.height for t in tiles)
        return Region(x, y, right - x, bottom - y)

    def proxy(self, factor: int) -> Field:
        """The field at 1 / factor of the size, see `proxy`.

        Parameters
        ----------
        factor : int
            One of `proxy.FACTORS`.

        Returns
        -------
        Field

        Raises
        ------
        FieldError
            If there is none, as of fields with other models than `auto` takes.
        """
        folder = proxy_folder(self.folder, factor)
        if not (folder / HEADER).is_file():
            raise FieldError(
                f"{self.folder} has no proxy of 1/{factor}: only fields of 'auto', 'whole', "
                "'linear' and 'box' have; take the field itself, or fit again"
            )
        found = Field(folder)
        mine, its = ((about.key, about.take) for about in (self.about, found.about))
        if mine != its:
            raise FieldError(f"{folder} is a proxy of another field: fit again")
        return found

    def shares(self) -> dict[str, float]:
        """Which share of all pairs of a pixel and a patch each model took.

        Returns
        -------
        dict of str to float
            By the names of the models, and 'nothing'; together 1.
        """
        total = max(sum(t.region.pixels for t in self.tiles) * len(self.hemicube), 1)
        out: dict[str, float] = {}
        for tile in self.tiles:
            for name, count in tile.used.items():
                out[name] = out.get(name, 0) + count / total
        out["nothing"] = 1 - sum(out.values())
        return out

    def bytes_per_pixel(self) -> float:
        """What relighting reads: coefficients, supports and codes, on disk.

        Returns
        -------
        float
            Bytes of a pixel, in the mean.

        Raises
        ------
        FieldError
            If a tile is missing or damaged.
        """
        names = {f"{n}_{w}" for n in self.shares() for w in OF_A_MODEL} | {*OTHERS}
        size = sum(n for t in self.tiles for name, n in t.sizes.items() if name in names)
        return size / max(sum(t.region.pixels for t in self.tiles), 1)

    def has_layer(self, name: str) -> bool:
        """Whether every tile has a layer.

        Parameters
        ----------
        name : str
            One of `LAYERS`, or of a light group.

        Returns
        -------
        bool

        Raises
        ------
        FieldError
            If a tile is missing or damaged.
        """
        return bool(self.tiles) and all(t.has_layer(name) for t in self.tiles)

    @property
    def own_layers(self) -> list[str]:
        """The layers of light groups of the scene's own lamps, see `capture.names.own_layer`."""
        found = {name for tile in self.tiles for name in tile.own_layers()}
        return sorted(name for name in found if self.has_layer(name))

    def layer(self, name: str) -> NDArray[np.float32]:
        """A layer of the whole picture, zero outside the tiles.

        Parameters
        ----------
        name : str
            One of `LAYERS`, or of a light group.

        Returns
        -------
        (H, W) or (H, W, 3) float32
            Light scene-linear, in the field's colour space; alpha, depth, normals and places as
            Cycles has them.

        Raises
        ------
        FieldError
            If a tile has none, or is missing or damaged.
        """
        out: NDArray[np.float32] | None = None
        for tile in self.tiles:
            part = tile.layer(name)
            if out is None:
                out = np.zeros((*self.shape, *part.shape[2:]), np.float32)
            out[tile.region.slices] = part
        if out is None:
            raise FieldError(f"{self.folder} holds no tiles: fit again")
        return out

    @property
    def tinted(self) -> bool:
        """Whether a tile tells more of what is seen behind than alpha does, see `through`."""
        return any(tile.has_layer("through") for tile in self.tiles)

    def through(self) -> NDArray[np.float32] | None:
        """How much of the world behind is seen in the whole picture, 0 outside the tiles.

        Returns
        -------
        (H, W, 3) float32, or None
            By channel; None where it is 1 - alpha in all of them.

        Raises
        ------
        FieldError
            If a tile is missing or damaged.
        """
        if not self.tinted:
            return None
        out = np.zeros((*self.shape, 3), np.float32)
        for tile in self.tiles:
            out[tile.region.slices] = tile.through()
        return out
