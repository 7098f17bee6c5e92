"""The reflectance field on disk: for every pixel and patch a coefficient and a support (paper 5).

A folder: `field.json` says in words what it holds, and each tile is a folder of .npy arrays that
are mapped, not read, until they are used. docs/field-format.md says enough to write a reader.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .description import Description
from .errors import FieldError, HemicubeError
from .hemicube import Hemicube
from .region import Region
from .supports import BY_CODE, Support

VERSION = 1
HEADER = "field.json"
# Beside the models' arrays, what relighting reads.
_OTHERS = ("codes", "scales", "rest", "rest_weights")
# What others ask a field's `about` for.
_ABOUT: dict[str, type | tuple[type, ...]] = {
    "shot": dict, "fingerprint": dict, "view_layer": str, "key": str, "route": str, "choice": str,
    "samples": (int, float), "far": bool, "separate": bool, "guides": str,
}  # fmt: skip
LAYERS = ("own", "alpha", "albedo", "normal", "depth")


@dataclass(frozen=True)
class Entries:
    """The entries of one patch that share a support model.

    pixels: (n,) indices into the tile, row by row; coefficient: (n, 3) R; parameters: (n, p).
    """

    support: Support
    pixels: NDArray[np.intp]
    coefficient: NDArray[np.float32]
    parameters: NDArray[np.float32]


class Tile:
    """One tile of an opened field; arrays stay on disk until asked for."""

    def __init__(self, folder: Path, region: Region, used: dict[str, int], patches: int) -> None:
        self.folder, self.region, self.used, self.patches = folder, region, used, patches

    def _load(self, name: str, shape: tuple[int, ...] | None = None) -> NDArray:
        path = self.folder / f"{name}.npy"
        try:
            out = np.load(path, mmap_mode="r")
        except (OSError, ValueError, EOFError) as e:
            raise FieldError(f"{path} is missing or damaged ({e}): fit again") from e
        if shape is not None and out.shape != shape:
            raise FieldError(f"{path} has the shape {out.shape}, not {shape}: fit again")
        return out

    @cached_property
    def codes(self) -> NDArray[np.uint8]:
        """(K, n): which model each entry has; 0 for no light, `REST` for light in the rest."""
        return self._load("codes", (self.patches, self.region.pixels))

    def layer(self, name: str) -> NDArray[np.float32]:
        """One of `LAYERS`, (h, w, ...), float32."""
        out = self._load(name)
        if out.shape[:2] != (self.region.height, self.region.width):
            raise FieldError(f"{self.folder / name}.npy has the wrong size: fit again")
        return out.astype(np.float32)

    def has_layer(self, name: str) -> bool:
        return (self.folder / f"{name}.npy").is_file()

    @cached_property
    def _arrays(self) -> dict[int, tuple[NDArray, NDArray, NDArray[np.intp]]]:
        """By model code: coefficients, parameters, and where in them each patch begins (K + 1,)."""
        out = {}
        for name, count in self.used.items():
            support = next((s for s in BY_CODE.values() if s.name == name), None)
            if support is None:
                raise FieldError(
                    f"{self.folder} uses the support model '{name}', which this version does "
                    "not know: update ARTO, or fit again"
                )
            counts = [np.count_nonzero(row == support.code) for row in self.codes]
            starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.intp)
            if starts[-1] != count:
                raise FieldError(f"{self.folder} is damaged, its counts differ: fit again")
            out[support.code] = (
                self._load(f"{name}_coefficient", (count, 3)),
                self._load(f"{name}_parameters", (count, len(support.parameters))),
                starts,
            )
        return out

    @cached_property
    def _scales(self) -> NDArray[np.float32]:
        return np.asarray(self._load("scales", (self.patches,)))

    @cached_property
    def rest(self) -> tuple[NDArray[np.float32], NDArray[np.float32]] | None:
        """What was too small to be an entry: coefficients (n, 3) of all that a pixel has under the
        code `REST`, and each patch's weight (K,) among them; None in a field without."""
        if not (self.folder / "rest.npy").is_file():
            return None
        return (
            np.asarray(self._load("rest", (self.region.pixels, 3))),
            np.asarray(self._load("rest_weights", (self.patches,))),
        )

    def open(self) -> None:
        """Map all that `entries` needs. Raises FieldError."""
        _ = self.codes, self._arrays, self._scales, self.rest

    def entries(self, k: int) -> list[Entries]:
        """The entries of patch k, model by model."""
        codes = np.asarray(self.codes[k])
        found = []
        for code, (coefficient, parameters, starts) in self._arrays.items():
            rows = slice(starts[k], starts[k + 1])
            if rows.start == rows.stop:
                continue
            found.append(
                Entries(
                    BY_CODE[code],
                    np.flatnonzero(codes == code),
                    coefficient[rows].astype(np.float32) * self._scales[k],
                    parameters[rows].astype(np.float32) / np.float32(65535),
                )
            )
        return found


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
        if type(version) is not int or version != VERSION:
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
            name = said.file_name(entry.get("folder"), "folder")
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

    @property
    def about(self) -> dict[str, Any]:
        return self.head.get("about") or {}

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
        names = [f"{n}_{w}" for n in self.shares() for w in ("coefficient", "parameters")]
        files = [t.folder / f"{name}.npy" for t in self.tiles for name in [*names, *_OTHERS]]
        size = sum(f.stat().st_size for f in files if f.is_file())
        return size / max(sum(t.region.pixels for t in self.tiles), 1)

    def has_layer(self, name: str) -> bool:
        """Whether every tile has the layer."""
        return bool(self.tiles) and all(t.has_layer(name) for t in self.tiles)

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
