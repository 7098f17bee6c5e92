"""The capture set: the basis images on disk, and what made them (paper 4).

A folder with `capture.json` and EXR files. A basis image is the part of a file whose name ends in
`Combined_ARTO_<patch>_<pattern>`, as Blender names a light group's pass; other parts are the whole
picture (`Combined`, with alpha) and its albedo, normal and depth: docs/capture-format.md.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import exr, marked
from ..description import Description
from ..errors import CaptureSetError, HemicubeError, PatternError
from ..files import write_text
from ..hemicube import Hemicube
from ..patterns import PatternSet, pattern_set
from .basis_images import BasisImages
from .names import COMBINED, group_name
from .tile_data import TileData

VERSION = 1
HEADER = "capture.json"


class CaptureSet:
    """A capture set, opened: its description is read, the images are not.

    Raises CaptureSetError if it is missing, damaged, unfinished, or of another version.
    """

    def __init__(self, folder: Path, unfinished: bool = False) -> None:
        self.folder = folder
        path = folder / HEADER
        if not path.is_file():
            raise CaptureSetError(f"there is no capture set in {folder}: run Capture first")
        said = Description(path, lambda text: CaptureSetError(f"{text}: capture again"))
        self.head: dict[str, Any] = said.data
        if "version" not in said.data:
            raise said.error(f"{path} cannot be read (it has no version)")
        version = said.data["version"]
        if type(version) is not int or version != VERSION:
            raise CaptureSetError(
                f"{folder} is a capture set of version {version!s:.20}; this ARTO reads version "
                f"{VERSION}: capture again, or use the ARTO that made it"
            )
        try:
            self.hemicube = Hemicube.from_json(said.kind("hemicube", dict, {}))
            self.patterns: PatternSet = pattern_set(said.kind("patterns", str, ""))
        except (HemicubeError, PatternError) as e:
            raise CaptureSetError(f"{path} is damaged ({e}): capture again") from e
        self.shape = said.shape()
        self.regions, self.files, done = [], [], []
        for region, entry in said.tiles():
            files = entry.get("files")
            if not isinstance(files, list) or not isinstance(entry.get("done"), bool):
                raise said.wrong("tiles", entry)
            _check_seeds(said, entry)
            self.regions.append(region)
            self.files.append([said.file_name(name, "files") for name in files])
            done.append(entry["done"])
        self.samples: float | None = said.number("samples", 0.0) or None
        said.texts("fingerprint")
        for name, kind in (
            ("key", str), ("view_layer", str), ("shot", dict), ("route", str), ("grain", bool),
            ("kept", bool), ("choice", str), ("separate", bool),
        ):  # fmt: skip
            said.kind(name, kind)
        if not unfinished and not all(done):
            raise CaptureSetError(
                f"{folder} is unfinished ({sum(done)} of {len(done)} tiles): run Capture again, "
                "it goes on from there"
            )
        if all(done):
            said.check_apart(self.regions)

    @property
    def pixels(self) -> int:
        return sum(r.pixels for r in self.regions)

    @property
    def kept(self) -> bool:
        """Whether the basis images are still there: once fitted, they may go."""
        return self.head.get("kept") is not False

    def open(self, tile: int) -> BasisImages:
        """The basis images of a tile, to be read patch by patch; to be closed. Raises
        CaptureSetError for whatever would bend the light, here or when it is read."""
        if not self.kept and not self.files[tile]:
            raise CaptureSetError(
                f"the basis images of {self.folder} were not kept: capture again, with Keep Basis "
                "Images on Always"
            )
        return BasisImages(
            self.folder,
            self.renders(tile),
            self.regions[tile],
            self.hemicube,
            self.patterns,
            bool(self.head.get("grain")),
        )

    def renders(self, tile: int) -> list[tuple[float, list[str]]]:
        """Of each seed that a tile was rendered with its share of the samples, and its files."""
        seeds = self.head["tiles"][tile].get("seeds")
        if not seeds:
            return [(1.0, self.files[tile])]
        total = sum(samples for samples, _ in seeds)
        return [(samples / total, names) for samples, names in seeds]

    def read(self, tile: int) -> TileData:
        """All of a tile at once. Raises CaptureSetError."""
        with self.open(tile) as images:
            return images.read()


def _check_seeds(said: Description, entry: dict[str, Any]) -> None:
    """Of a tile that several seeds rendered: [[samples, files], ...], of the tile's files."""
    seeds = entry.get("seeds", [])
    if not isinstance(seeds, list):
        raise said.wrong("seeds", seeds)
    for seed in seeds:
        if not (isinstance(seed, list) and len(seed) == 2 and isinstance(seed[1], list)):
            raise said.wrong("seeds", seed)
        if type(seed[0]) is not int or seed[0] < 1:
            raise said.wrong("seeds", seed)
        if any(name not in entry["files"] for name in seed[1]):
            raise said.wrong("seeds", seed)


def write_header(folder: Path, head: dict[str, Any]) -> None:
    """Write `capture.json`, whole or not at all."""
    path = folder / HEADER
    try:
        folder.mkdir(parents=True, exist_ok=True)
        marked.mark(folder, "capture")
        write_text(path, json.dumps(head, indent=1))
    except OSError as e:
        raise CaptureSetError(
            f"{path} cannot be written ({e}): make room on the disk, or choose a folder that can "
            "be written"
        ) from e


def describe(
    hemicube: Hemicube, patterns: PatternSet, shape: tuple[int, int], **about: Any
) -> dict[str, Any]:
    """A new `capture.json` without tiles. `about` takes whatever else a reader should know."""
    return {
        "format": "ARTO capture set",
        "version": VERSION,
        "height": shape[0],
        "width": shape[1],
        "hemicube": hemicube.to_json(),
        "patches": len(hemicube),
        "patterns": patterns.name,
        "pattern_polynomials": dict(zip(patterns.patterns, patterns.coefficients, strict=True)),
        **about,
        "tiles": [],
    }


def write(
    folder: Path,
    hemicube: Hemicube,
    patterns: PatternSet,
    basis: NDArray,
    own: NDArray | None = None,
    alpha: NDArray | None = None,
    **about: Any,
) -> None:
    """Write basis images (K, P, H, W, 3), photographs for example, as a capture set of one tile.

    own: (H, W, 3), the light that is always there (default none); alpha: (H, W) (default 1).
    """
    shape = basis.shape[2:4]
    combined = np.ones((*shape, 4), np.float32)
    # summed as it is subtracted when read
    combined[..., :3] = basis.sum(axis=(0, 1), dtype=np.float64)
    if own is not None:
        combined[..., :3] += own
    if alpha is not None:
        combined[..., 3] = alpha
    layers = {COMBINED: combined}
    for k in range(len(hemicube)):
        for p, name in enumerate(patterns.patterns):
            layers[f"Combined_{group_name(k, name)}"] = basis[k, p].astype(np.float32)
    exr.write(folder / "tile_0000.exr", layers)
    head = describe(hemicube, patterns, (shape[0], shape[1]), **about)
    region = [0, 0, shape[1], shape[0]]
    head["tiles"] = [{"region": region, "files": ["tile_0000.exr"], "done": True}]
    write_header(folder, head)
