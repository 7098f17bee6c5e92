"""The capture set: the basis images on disk, and what made them (paper 4).

A folder with `capture.json` and EXR files. A basis image is the part of a file whose name ends in
`Combined_ARTO_<patch>_<pattern>`, as Blender names a light group's pass; other parts are the whole
picture (`Combined`, with alpha) and its albedo, normal and depth: docs/capture-format.md.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import exr
from .errors import ArtoError, CaptureSetError, ExrError
from .files import write_text
from .hemicube import Hemicube
from .patterns import PatternSet, pattern_set
from .region import Region

VERSION = 1
HEADER = "capture.json"
# After ARTO there may be a number, where a light group of the artist's has the name without.
GROUP = re.compile(r"(?:^|\.)Combined_ARTO(?:-\d+)?_(\d{4})_(\w+)$")
# Layers beside the basis images, by the end of their part's name.
GUIDES = {"albedo": "Denoising Albedo", "normal": "Denoising Normal", "depth": "Depth"}
# The pattern that shows the noise: a patch of grains so fine that no reflection resolves them, half
# of them lit, at random. A light path meets a lit grain or a dark one as a coin falls, so twice
# this image less the white one is a sum of the paths' weights with random signs: its square is, on
# average, the sum of their squares, which is the variance of the white image. It is no polynomial
# and no part of the pattern set; it must share its render, and so its paths, with the others.
GRAIN = "grain"
# What is left of Combined when the groups are taken away, as a share of them, when there is no
# other light: float32 sums of a few hundred passes.
ROUNDING = 3e-5


def group_name(k: int, pattern: str) -> str:
    """The light group of patch k under a pattern."""
    return f"ARTO_{k:04d}_{pattern}"


@dataclass(frozen=True)
class TileData:
    """What was captured of one region.

    basis: (K, P, h, w, 3) float32; own: (h, w, 3), the light of the scene's own lamps; alpha:
    (h, w); guides: albedo, normal (h, w, 3), depth (h, w), those that the files hold; grain:
    (K, h, w), the difference of two random halves of the light, summed over channels, where it was
    captured (see `GRAIN`).
    """

    region: Region
    basis: NDArray[np.float32]
    own: NDArray[np.float32]
    alpha: NDArray[np.float32]
    guides: dict[str, NDArray[np.float32]]
    grain: NDArray[np.float32] | None = None


class CaptureSet:
    """A capture set, opened: its description is read, the images are not.

    Raises CaptureSetError if it is missing, damaged, unfinished, or of another version.
    """

    def __init__(self, folder: Path, unfinished: bool = False) -> None:
        self.folder = folder
        path = folder / HEADER
        if not path.is_file():
            raise CaptureSetError(f"there is no capture set in {folder}: run Capture first")
        try:
            self.head: dict[str, Any] = json.loads(path.read_text())
            version = self.head["version"]
        except (OSError, ValueError, KeyError, TypeError) as e:
            raise CaptureSetError(f"{path} cannot be read ({e}): capture again") from e
        if version != VERSION:
            raise CaptureSetError(
                f"{folder} is a capture set of version {version}; this ARTO reads version "
                f"{VERSION}: capture again, or use the ARTO that made it"
            )
        try:
            self.hemicube = Hemicube.from_json(self.head["hemicube"])
            self.patterns: PatternSet = pattern_set(self.head["patterns"])
            self.shape = (int(self.head["height"]), int(self.head["width"]))
            self.regions = [Region(*t["region"]) for t in self.head["tiles"]]
            self.files = [list(t["files"]) for t in self.head["tiles"]]
            done = [bool(t["done"]) for t in self.head["tiles"]]
        except (KeyError, TypeError, ValueError) as e:
            raise CaptureSetError(f"{path} lacks {e}: capture again") from e
        except ArtoError as e:
            raise CaptureSetError(f"{path} is damaged ({e}): capture again") from e
        if not unfinished and not all(done):
            raise CaptureSetError(
                f"{folder} is unfinished ({sum(done)} of {len(done)} tiles): run Capture again, "
                "it goes on from there"
            )

    @property
    def pixels(self) -> int:
        return sum(r.pixels for r in self.regions)

    def read(self, tile: int) -> TileData:
        """Read and check one tile. Raises CaptureSetError for whatever would bend the light."""
        region = self.regions[tile]
        shape = (region.height, region.width)
        # what stays unfilled is refused below
        basis = np.empty((len(self.hemicube), len(self.patterns), *shape, 3), np.float32)
        wanted = {
            (k, name): (k, p)
            for k in range(len(self.hemicube))
            for p, name in enumerate(self.patterns.patterns)
        }
        grain: NDArray | None = None
        if self.head.get("grain"):
            grain = np.zeros((len(self.hemicube), *shape), np.float32)
            wanted |= {(k, GRAIN): (k, -1) for k in range(len(self.hemicube))}
        own: NDArray | None = None
        alpha = np.ones(shape, np.float32)
        guides: dict[str, NDArray] = {}
        for name in self.files[tile]:
            path = self.folder / name
            lit = np.zeros((*shape, 3))
            here = np.zeros(basis.shape[:2], bool)
            combined: NDArray | None = None
            for part, pixels in self._parts(path):
                match = GROUP.search(part)
                if match:
                    key = (int(match[1]), match[2])
                    if key not in wanted:
                        raise CaptureSetError(
                            f"{path} holds the basis image '{part}', which is not of this "
                            "capture set or there twice: capture again"
                        )
                    k, p = wanted.pop(key)
                    image = self._checked(path, part, pixels, (*shape, 3))
                    if p >= 0:
                        basis[k, p] = image
                        here[k, p] = True
                    elif grain is not None:
                        grain[k] = image.sum(axis=-1)
                        lit += image
                elif part == "Combined" or part.endswith(".Combined"):
                    combined = self._checked(path, part, pixels, (*shape, 4))
                else:
                    for guide, ending in GUIDES.items():
                        if part == ending or part.endswith("." + ending):
                            guides.setdefault(
                                guide, pixels[..., 0] if pixels.shape[-1] == 1 else pixels
                            )
            if combined is None:
                raise CaptureSetError(f"{path} has no part 'Combined': capture again")
            if own is None:
                # float64, but for the few images of one patch, which numpy adds faster as they are
                for images, in_file in zip(basis, here, strict=True):
                    lit += images[in_file].sum(axis=0)
                own = np.asarray(combined[..., :3] - lit)
                own[np.abs(own) < ROUNDING * lit] = 0
                alpha = combined[..., 3]
        if wanted:
            k, pattern = next(iter(wanted))
            raise CaptureSetError(
                f"{self.folder} lacks {len(wanted)} basis images, the first that of patch "
                f"{self.hemicube.patch_name(k)} under '{pattern}': capture again"
            )
        assert own is not None  # a set without files lacks its basis images
        if grain is not None:
            for k, image in enumerate(grain):
                white = self.patterns.coefficient(basis[k]).sum(axis=-1)
                np.subtract(2 * image, white, out=image)
        own = np.maximum(own, 0).astype(np.float32)
        return TileData(region, basis, own, alpha, guides, grain)

    @staticmethod
    def _parts(path: Path) -> Iterator[tuple[str, NDArray]]:
        try:
            yield from exr.parts(path)
        except ExrError as e:
            raise CaptureSetError(f"{e} (run Capture again)") from e

    @staticmethod
    def _checked(path: Path, part: str, pixels: NDArray, shape: tuple[int, ...]) -> NDArray:
        say = f"{path}, '{part}'"
        if pixels.shape != shape:
            raise CaptureSetError(
                f"{say} has the size {pixels.shape[1]}x{pixels.shape[0]} with "
                f"{pixels.shape[2]} channels, not {shape[1]}x{shape[0]} with {shape[2]}: "
                "capture again"
            )
        if pixels.dtype != np.float32:
            raise CaptureSetError(
                f"{say} is of {pixels.dtype}: half floats put a floor under small supports; "
                "save it as 32-bit float, or capture again"
            )
        # one pass that NaN fails too
        if not (pixels.min() >= 0 and pixels.max() < np.inf):
            bad = ~(np.isfinite(pixels) & (pixels >= 0)).all(axis=-1)
            y, x = np.argwhere(bad)[0]
            raise CaptureSetError(
                f"{say} has {int(bad.sum())} pixels that are negative, infinite or not a number, "
                f"the first at ({x}, {y}): find the material there, and capture again"
            )
        return pixels


def write_header(folder: Path, head: dict[str, Any]) -> None:
    """Write `capture.json`, whole or not at all."""
    path = folder / HEADER
    try:
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
    layers = {"Combined": combined}
    for k in range(len(hemicube)):
        for p, name in enumerate(patterns.patterns):
            layers[f"Combined_{group_name(k, name)}"] = basis[k, p].astype(np.float32)
    exr.write(folder / "tile_0000.exr", layers)
    head = describe(hemicube, patterns, (shape[0], shape[1]), **about)
    region = [0, 0, shape[1], shape[0]]
    head["tiles"] = [{"region": region, "files": ["tile_0000.exr"], "done": True}]
    write_header(folder, head)
