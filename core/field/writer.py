"""Writing a reflectance field, tile by tile; it is there only when it is complete.

>>> import tempfile
>>> with tempfile.TemporaryDirectory() as folder:
...     writer = FieldWriter(Path(folder) / "field", Hemicube(patches=1), (1080, 1920))
...     before = writer.folder.exists()
...     writer.close()
...     print(before, Field(writer.folder).shape)
False (1080, 1920)
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from numpy.typing import NDArray

from .. import marked, signed
from ..errors import FieldError
from ..files import PART, replace_folder
from ..hemicube import Hemicube
from .about import About
from .field import Field, proxy_folder
from .head import HEADER, FieldHead, FieldTile
from .proxy import FACTORS, proxies
from .tile import SUFFIX, checksum_of
from .tile_file import rewrite, written
from .tile_folder import rewrite_folder
from .tile_writer import TileWriter, stored_layer


def tile_names(number: int) -> tuple[str, str]:
    """What a tile is called in the folder of its field.

    Parameters
    ----------
    number : int
        Of the tile, from the top.

    Returns
    -------
    tuple of str
        Its file, and the folder that it was in fields of the version before.
    """
    return f"tile_{number:04d}{SUFFIX}", f"tile_{number:04d}"


def write_tile(
    folder: Path, number: int, tile: TileWriter, hemicube: Hemicube, of: Path | None = None
) -> FieldTile:
    """Write a tile and its proxies into the folder of a field, whole or not at all.

    Parameters
    ----------
    folder : Path
        The field's.
    number : int
        Of the tile; tiles are written from the top.
    tile : TileWriter
        What was fitted.
    hemicube : Hemicube
        Its patches.
    of : Path, optional
        The folder that the field will have, for messages.

    Returns
    -------
    FieldTile
        Its entry in the head of the field.

    Raises
    ------
    FieldError
        If it cannot be written.
    """
    name, _ = tile_names(number)

    def write(tile: TileWriter, folder: Path) -> FieldTile:
        folder.mkdir(parents=True, exist_ok=True)
        marked.mark(folder, "field")
        with written(folder / name) as out:
            entries = tile.write(out)
            return FieldTile(name, tile.region, entries, checksum=checksum_of(out.stored))

    with _writing(of or folder):
        # the tile itself last: where it is, its proxies are
        smaller = {
            factor: write(proxy, proxy_folder(folder, factor))
            for factor, proxy in proxies(tile, hemicube, number == 0).items()
        }
        return replace(write(tile, folder), proxies=smaller)


def write_head(folder: Path, head: FieldHead) -> None:
    """Write `field.json`, and those of the field's proxies: with it the field is one.

    Parameters
    ----------
    folder : Path
        The field's.
    head : FieldHead
        What it says.

    Raises
    ------
    FieldError
        If it cannot be written.
    """
    with _writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        marked.mark(folder, "field")
        for factor in FACTORS:
            tiles = [tile.proxies[factor] for tile in head.tiles if factor in tile.proxies]
            if tiles and len(tiles) == len(head.tiles):
                own = replace(
                    head,
                    height=-(-head.height // factor),
                    width=-(-head.width // factor),
                    about=replace(head.about, proxy=factor),
                    tiles=tuple(tiles),
                )
                signed.write(proxy_folder(folder, factor) / HEADER, own.to_json())
        signed.write(folder / HEADER, head.to_json())


def replace_layers(field: Field, layers: dict[str, NDArray]) -> None:
    """Put layers into a field on disk, new ones or in the place of those of their names.

    The file of each tile is written anew, whole or not at all. The field is closed first.

    Parameters
    ----------
    field : Field
        The field; not its proxies, which are fields of their own.
    layers : dict of str to array
        By their names, of the whole picture, (H, W) or (H, W, 3).

    Raises
    ------
    FieldError
        If a tile is damaged, or cannot be written.
    """
    field.close()
    with _writing(field.folder):
        for tile in field.tiles:
            cut = {n: stored_layer(n, pixels[tile.region.slices]) for n, pixels in layers.items()}
            (rewrite if tile.path.suffix == SUFFIX else rewrite_folder)(tile.path, cut)


class FieldWriter:
    """Writes a field tile by tile. It is there only once `close` has returned.

    Parameters
    ----------
    folder : Path
        Where it will be; a field that is there stays until then.
    hemicube : Hemicube
        Its patches.
    shape : tuple of int
        Height and width of the whole picture.
    about : About, optional
        What it is made from.

    Raises
    ------
    FieldError
        If it cannot be written.
    FilesError
        If what is at `folder` was not made by ARTO.
    """

    def __init__(
        self, folder: Path, hemicube: Hemicube, shape: tuple[int, int], about: About | None = None
    ) -> None:
        self.folder = folder
        self.head = FieldHead(hemicube, *shape, about or About())
        if os.path.lexists(folder):
            marked.check(folder, None, folder.parent)  # before the work, and not after it
        # what the version before left where its process was killed
        marked.remove_quietly(folder.with_name(folder.name + PART), "field", folder.parent)
        with _writing(folder):
            self.partial = marked.scratch(folder, "field")

    def add(self, tile: TileWriter) -> None:
        """Write the next tile, from the top.

        Parameters
        ----------
        tile : TileWriter
            What was fitted.

        Raises
        ------
        FieldError
            If it cannot be written.
        """
        number, hemicube = len(self.head.tiles), self.head.hemicube
        found = write_tile(self.partial, number, tile, hemicube, self.folder)
        self.head = replace(self.head, tiles=(*self.head.tiles, found))

    def close(self, about: About | None = None) -> None:
        """Put the field in its place.

        Parameters
        ----------
        about : About, optional
            What it was made from, where that has changed.

        Raises
        ------
        FieldError
            If it cannot be written, or what is there is in use.
        """
        if about is not None:
            self.head = replace(self.head, about=about)
        write_head(self.partial, self.head)
        with _writing(self.folder):
            replace_folder(self.partial, self.folder)

    def abandon(self) -> None:
        """Remove what was written; a field that was there before stays."""
        marked.remove_quietly(self.partial, "field", self.folder.parent)


class _writing:
    """Turns a failing write into a FieldError that says what to do."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, OSError):
            raise FieldError(
                f"the field {self.folder} cannot be written ({error}): make room on the disk, "
                "or choose a folder that can be written"
            ) from error
