"""The reflectance field on disk: for every pixel and patch a coefficient and a support (paper 5).

A folder: `field.json` says in words what it holds, and each tile is a file of arrays that are
mapped, not read, until they are used. docs/field-format.md says enough to write a reader.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..description import Description
from ..errors import FieldError, HemicubeError
from ..hemicube import Hemicube
from ..region import Region
from .tile import OTHERS, SUFFIX, Tile

VERSION = 3
# In fields of the version before, a tile is a folder (see `tile_folder`).
READ = (2, 3)
HEADER = "field.json"
# The arrays of a support model.
OF_A_MODEL = ("coefficient", "parameters", "pixels", "counts")
# What others ask a field's `about` for.
_ABOUT: dict[str, type | tuple[type, ...]] = {
    "shot": dict, "fingerprint": dict, "view_layer": str, "key": str, "route": str, "choice": str,
    "samples": (int, float), "far": bool, "separate": bool, "guides": str, "proxy": int,
    "catchers": list, "take": str, "pair": str,
}  # fmt: skip
LAYERS = ("own", "alpha", "albedo", "normal", "depth", "position")


def proxy_folder(folder: Path, factor: int) -> Path:
    """Where a field's proxy of that factor is: a field of its own."""
    return folder / f"proxy_{factor}"


class Field:
    """A reflectance field, opened: the header is read, the arrays are not.

    Raises FieldError if it is missing, damaged, or of another version.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        path = folder / HEADER
        if not path.is_file():
            raise FieldError(f"there is no reflectance field in {folder}: run Fit first")
        said = Description(path, lambda text: FieldError(f"{text}: fit again"))
        self.head: dict[str, Any] = said.data
        if "version" not in said.data:
            raise said.error(f"{path} cannot be read (it has no version)")
        version = said.data["version"]
        if type(version) is not int or version not in READ:
            raise FieldError(
                f"{folder} is a field of version {version!s:.20}; this ARTO reads version "
                f"{VERSION}: fit again from the capture set"
            )
        try:
            self.hemicube = Hemicube.from_json(said.kind("hemicube", dict, {}))
        except HemicubeError as e:
            raise FieldError(f"{path} is damaged ({e}): fit again") from e
        self.shape = said.shape()
        patches = len(self.hemicube)
        self.tiles = []
        for region, entry in said.tiles():
            kind = "folder" if "folder" in entry else "file"
            name = said.file_name(entry.get(kind), kind)
            if (kind == "file") != name.endswith(SUFFIX):
                raise said.wrong(kind, name)
            used = entry.get("entries")
            if not isinstance(used, dict):
                raise said.wrong("entries", used)
            for model in used:
                said.whole(model, 0, region.pixels * patches, used)
            self.tiles.append(Tile(folder / name, region, used, patches))
        said.check_apart([tile.region for tile in self.tiles])
        about = said.kind("about", dict, {})
        for name, kind in _ABOUT.items():
            value = about.get(name)
            if value is not None and not isinstance(value, kind):
                raise said.wrong(name, value)
        things = about.get("fingerprint") or {}
        if any(not isinstance(text, str) for text in things.values()):
            raise said.wrong("fingerprint", things)

    def __enter__(self) -> Field:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of all files of the field, see `Tile.close`: until then Windows replaces none."""
        for tile in self.tiles:
            tile.close()

    @property
    def about(self) -> dict[str, Any]:
        return self.head.get("about") or {}

    @property
    def region(self) -> Region:
        """The rectangle around all tiles."""
        tiles = [tile.region for tile in self.tiles]
        x, y = min(t.x for t in tiles), min(t.y for t in tiles)
        right, bottom = max(t.x + t.width for t in tiles), max(t.y + t.height for t in tiles)
        return Region(x, y, right - x, bottom - y)

    def proxy(self, factor: int) -> Field:
        """The field at 1 / factor of the size, see `proxy`. Raises FieldError where there is none,
        as of fields with other models than `auto` takes."""
        folder = proxy_folder(self.folder, factor)
        if not (folder / HEADER).is_file():
            raise FieldError(
                f"{self.folder} has no proxy of 1/{factor}: only fields of 'auto', 'whole', "
                "'linear' and 'box' have; take the field itself, or fit again"
            )
        return Field(folder)

    def shares(self) -> dict[str, float]:
        """Which share of all pixel-patch pairs each model took, 'nothing' included."""
        total = max(sum(t.region.pixels for t in self.tiles) * len(self.hemicube), 1)
        out: dict[str, float] = {}
        for tile in self.tiles:
            for name, count in tile.used.items():
                out[name] = out.get(name, 0) + count / total
        out["nothing"] = 1 - sum(out.values())
        return out

    def bytes_per_pixel(self) -> float:
        """What relighting reads: coefficients, supports and codes, on disk."""
        names = {f"{n}_{w}" for n in self.shares() for w in OF_A_MODEL} | {*OTHERS}
        size = sum(n for t in self.tiles for name, n in t.sizes.items() if name in names)
        return size / max(sum(t.region.pixels for t in self.tiles), 1)

    def has_layer(self, name: str) -> bool:
        """Whether every tile has the layer."""
        return bool(self.tiles) and all(t.has_layer(name) for t in self.tiles)

    @property
    def own_layers(self) -> list[str]:
        """The layers of light groups of the scene's own lamps, see `capture.names.own_layer`."""
        found = {name for tile in self.tiles for name in tile.own_layers()}
        return sorted(name for name in found if self.has_layer(name))

    def layer(self, name: str) -> NDArray[np.float32]:
        """A layer of the whole picture, zero outside the tiles -> (H, W) or (H, W, 3)."""
        out: NDArray[np.float32] | None = None
        for tile in self.tiles:
            part = tile.layer(name)
            if out is None:
                out = np.zeros((*self.shape, *part.shape[2:]), np.float32)
            out[tile.region.slices] = part
        if out is None:
            raise FieldError(f"{self.folder} holds no tiles: fit again")
        return out
