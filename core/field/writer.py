"""Writing a reflectance field, tile by tile; it is there only when it is complete."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from .. import marked
from ..errors import FieldError
from ..files import PART, replace_folder, write_text
from ..hemicube import Hemicube
from .field import HEADER, VERSION, Field, proxy_folder
from .proxy import FACTORS, proxies
from .tile import SUFFIX
from .tile_file import rewrite, written
from .tile_folder import rewrite_folder
from .tile_writer import TileWriter, stored_layer


def describe(hemicube: Hemicube, shape: tuple[int, int], **about: Any) -> dict[str, Any]:
    """A new `field.json` without tiles. `about` takes whatever else a reader should know."""
    return {
        "format": "ARTO reflectance field",
        "version": VERSION,
        "height": shape[0],
        "width": shape[1],
        "hemicube": hemicube.to_json(),
        "patches": len(hemicube),
        "about": about,
        "tiles": [],
    }


def tile_names(number: int) -> tuple[str, str]:
    """What a tile is called in the folder of its field: its file, and the folder that it was in
    fields of the version before."""
    return f"tile_{number:04d}{SUFFIX}", f"tile_{number:04d}"


def write_tile(
    folder: Path, number: int, tile: TileWriter, hemicube: Hemicube, of: Path | None = None
) -> dict[str, Any]:
    """Write a tile and its proxies into the folder of a field, whole or not at all -> its entry in
    `field.json`.

    number: tiles are written from the top; of: the field that it will be, for messages. Raises
    FieldError.
    """
    name, _ = tile_names(number)

    def write(tile: TileWriter, folder: Path) -> dict[str, Any]:
        r = tile.region
        folder.mkdir(parents=True, exist_ok=True)
        marked.mark(folder, "field")
        with written(folder / name) as out:
            used = tile.write(out)
        return {"file": name, "region": [r.x, r.y, r.width, r.height], "entries": used}

    with _writing(of or folder):
        # the tile itself last: where it is, its proxies are
        smaller = {
            str(factor): write(proxy, proxy_folder(folder, factor))
            for factor, proxy in proxies(tile, hemicube, number == 0).items()
        }
        return write(tile, folder) | {"proxies": smaller}


def write_head(folder: Path, head: dict[str, Any]) -> None:
    """Write `field.json`: with it the field is one. Raises FieldError."""
    with _writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        marked.mark(folder, "field")
        for factor in FACTORS:
            tiles = [t.get("proxies", {}).get(str(factor)) for t in head["tiles"]]
            if tiles and all(tiles):
                size = {side: -(-head[side] // factor) for side in ("height", "width")}
                about = head["about"] | {"proxy": factor}
                own = head | size | {"about": about, "tiles": tiles}
                write_text(proxy_folder(folder, factor) / HEADER, json.dumps(own, indent=1))
        write_text(folder / HEADER, json.dumps(head, indent=1))


def replace_layers(field: Field, layers: dict[str, NDArray]) -> None:
    """Put layers into a field on disk, new ones or in the place of those of their names.

    The file of each tile is written anew, whole or not at all. The field is closed first.

    Parameters
    ----------
    field
        The field; not its proxies, which are fields of their own.
    layers
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

    Raises FieldError where it cannot be written, and FilesError where what is at `folder` was not
    made by ARTO.
    """

    def __init__(self, folder: Path, hemicube: Hemicube, shape: tuple[int, int], **about: Any):
        self.folder, self.hemicube = folder, hemicube
        self.head = describe(hemicube, shape, **about)
        if os.path.lexists(folder):
            marked.check(folder, None, folder.parent)  # before the work, and not after it
        # what the version before left where its process was killed
        marked.remove_quietly(folder.with_name(folder.name + PART), "field", folder.parent)
        with _writing(folder):
            self.partial = marked.scratch(folder, "field")

    def add(self, tile: TileWriter) -> None:
        self.head["tiles"].append(
            write_tile(self.partial, len(self.head["tiles"]), tile, self.hemicube, self.folder)
        )

    def close(self) -> None:
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
