"""Basis images: one tile's pictures under each patch and pattern, read patch by patch (paper 4.3).

A stack of them is as large as a tile gets, and nothing needs it all at once: the fit reads a patch,
then the next. Only what hangs on all of them, the light that is no patch's, takes a pass over all.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .. import exr
from ..errors import CaptureSetError, ExrError
from ..hemicube import Hemicube
from ..patterns import PatternSet
from ..region import Region
from ..shot import safe_name

# After ARTO there may be a number, where a light group of the artist's has the name without.
GROUP = re.compile(r"(?:^|\.)Combined_ARTO(?:-\d+)?_(\d{4})_(\w+)$")
# Layers beside the basis images, by the end of their part's name.
GUIDES = {
    "albedo": "Denoising Albedo",
    "normal": "Denoising Normal",
    "depth": "Depth",
    "position": "Position",
}
# Of them those that are of one ray through a pixel, its first: a mean of two is no place at all.
OF_ONE_RAY = ("depth", "position")
# The light groups of the scene's own lamps, as their artist named them.
OWN_GROUP = re.compile(r"(?:^|\.)Combined_(.+)$")
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


def own_layer(group: str) -> str:
    """The layer of the light of a group of the scene's own lamps."""
    return f"own_{safe_name(group)}"


@dataclass(frozen=True)
class Around:
    """What a tile shows beside its patches. own: (h, w, 3), the light of the scene's own lamps;
    alpha: (h, w); guides: albedo, normal, position (h, w, 3), depth (h, w), those that were
    captured, and of each light group of the scene's own lamps its `own_layer` (h, w, 3)."""

    own: NDArray[np.float32]
    alpha: NDArray[np.float32]
    guides: dict[str, NDArray[np.float32]]


@dataclass(frozen=True)
class TileData:
    """A tile in memory.

    basis: (K, P, h, w, 3) float32; own, alpha, guides: see `Around`; grain: (K, h, w), the
    difference of two random halves of the light, summed over channels, where it was captured (see
    `GRAIN`).
    """

    region: Region
    basis: NDArray[np.float32]
    own: NDArray[np.float32]
    alpha: NDArray[np.float32]
    guides: dict[str, NDArray[np.float32]]
    grain: NDArray[np.float32] | None = None

    def images(self, k: int) -> NDArray[np.float32]:
        """(P, h, w, 3)."""
        return self.basis[k]

    def coefficient(self, k: int, patterns: PatternSet) -> NDArray[np.float32]:
        """(h, w, 3), R of patch k."""
        return patterns.coefficient(self.basis[k])

    def images_at(self, k: int, pixels: NDArray[np.intp]) -> NDArray[np.float32]:
        """(P, n, 3) of n pixels, by their numbers row by row."""
        return self.basis[k].reshape(len(self.basis[k]), -1, 3)[:, pixels]

    def grain_of(self, k: int) -> NDArray[np.float32] | None:
        return None if self.grain is None else self.grain[k]

    def around(self, look: Callable[[int, NDArray], None]) -> Around:
        """As `BasisImages.around`."""
        for k, images in enumerate(self.basis):
            look(k, images)
        return Around(self.own, self.alpha, self.guides)


class BasisImages:
    """A tile's basis images on disk, opened. To be closed.

    renders: of each seed the share that it has of the samples, and its files' names. Raises
    CaptureSetError for what is missing, twice, or not of this set.
    """

    def __init__(
        self,
        folder: Path,
        renders: list[tuple[float, list[str]]],
        region: Region,
        hemicube: Hemicube,
        patterns: PatternSet,
        grain: bool = False,
    ) -> None:
        self.folder, self.region = folder, region
        self.hemicube, self.patterns, self.grain = hemicube, patterns, grain
        self._files = ExitStack()
        try:
            with self._files as files:
                self._seeds = [_Seed(self, share, names, files) for share, names in renders]
                self._files = files.pop_all()
        except ExrError as e:
            raise CaptureSetError(f"{e} (run Capture again)") from e

    def __enter__(self) -> BasisImages:
        return self

    def __exit__(self, *_: object) -> None:
        self._files.close()

    @property
    def shape(self) -> tuple[int, int]:
        return self.region.height, self.region.width

    def images(self, k: int) -> NDArray[np.float32]:
        """(P, h, w, 3), the images of patch k. Raises CaptureSetError for what bends the light."""
        total, *others = ((s.share, s.images(k)) for s in self._seeds)
        return _mean(total, others)

    def coefficient(self, k: int, patterns: PatternSet) -> NDArray[np.float32]:
        """(h, w, 3), R of patch k: where one pattern shows it, the others are not read."""
        which = patterns.shown_by
        if which is None:
            return patterns.coefficient(self.images(k))
        name = patterns.patterns[which]
        total, *others = ((s.share, s.image(k, name)) for s in self._seeds)
        return _mean(total, others)

    def images_at(self, k: int, pixels: NDArray[np.intp]) -> NDArray[np.float32]:
        """(P, n, 3) of n pixels, by their numbers row by row; of images that were looked at."""
        total, *others = ((s.share, s.images_at(k, pixels)) for s in self._seeds)
        return _mean(total, others)

    def grain_of(self, k: int) -> NDArray[np.float32] | None:
        """(h, w), see `TileData`; None where it was not captured."""
        if not self.grain:
            return None
        white = self.patterns.coefficient(self.images(k)).sum(axis=-1)
        total, *others = ((s.share, s.image(k, GRAIN).sum(axis=-1)) for s in self._seeds)
        return np.asarray(2 * _mean(total, others) - white)

    def around(self, look: Callable[[int, NDArray], None]) -> Around:
        """What hangs on all patches. `look` is told of each one's number and images, (P, h, w, 3),
        on the way; it must not keep them. Raises CaptureSetError."""
        lit = [np.zeros((*self.shape, 3)) for _ in self._seeds]
        for k in range(len(self.hemicube)):
            found = []
            for seed, light in zip(self._seeds, lit, strict=True):
                images = seed.images(k)
                seed.add(k, images, light)
                found.append((seed.share, images))
            look(k, _mean(found[0], found[1:]))
        layers = [s.around(light) for s, light in zip(self._seeds, lit, strict=True)]
        first, shares = layers[0], [s.share for s in self._seeds]
        if len(layers) == 1:
            return first

        def mean(parts: list[NDArray]) -> NDArray:
            total, *others = zip(shares, parts, strict=True)
            return _mean(total, others)

        guides = {
            n: first.guides[n] if n in OF_ONE_RAY else mean([a.guides[n] for a in layers])
            for n in first.guides
            if all(n in a.guides for a in layers)
        }
        return Around(mean([a.own for a in layers]), mean([a.alpha for a in layers]), guides)

    def read(self) -> TileData:
        """All at once."""
        basis = np.empty((len(self.hemicube), len(self.patterns), *self.shape, 3), np.float32)

        def keep(k: int, images: NDArray) -> None:
            basis[k] = images

        found = self.around(keep)
        grain = None
        if self.grain:
            grains = [self.grain_of(k) for k in range(len(self.hemicube))]
            grain = np.stack([g for g in grains if g is not None])
        return TileData(self.region, basis, found.own, found.alpha, found.guides, grain)


def _mean(first: tuple[float, NDArray], others: list[tuple[float, NDArray]]) -> NDArray:
    """The mean of some images by their shares of the samples; one alone is left as it is."""
    share, image = first
    if not others:
        return image
    total = image * np.float32(share)
    for share, image in others:
        total += image * np.float32(share)
    return total


class _Seed:
    """The files of one seed: every patch and pattern once."""

    def __init__(self, of: BasisImages, share: float, names: list[str], opened: ExitStack) -> None:
        self.of, self.share = of, share
        self.files = [opened.enter_context(exr.Layers(of.folder / name)) for name in names]
        self.there: dict[tuple[int, str], tuple[int, str]] = {}
        self.others: dict[str, tuple[int, str]] = {}
        patterns = [*of.patterns.patterns, *([GRAIN] if of.grain else [])]
        wanted = {(k, name) for k in range(len(of.hemicube)) for name in patterns}
        for number, file in enumerate(self.files):
            combined = False
            for layer in file.names:
                if match := GROUP.search(layer):
                    key = (int(match[1]), match[2])
                    if key not in wanted:
                        raise CaptureSetError(
                            f"{file.path} holds the basis image '{layer}', which is not of this "
                            "capture set or there twice: capture again"
                        )
                    wanted.remove(key)
                    self.there[key] = number, layer
                elif layer == "Combined" or layer.endswith(".Combined"):
                    self.others.setdefault("Combined", (number, layer))
                    combined = True
                elif match := OWN_GROUP.search(layer):
                    self.others.setdefault(own_layer(match[1]), (number, layer))
                else:
                    for guide, ending in GUIDES.items():
                        if layer == ending or layer.endswith("." + ending):
                            self.others.setdefault(guide, (number, layer))
            if not combined:
                raise CaptureSetError(f"{file.path} has no part 'Combined': capture again")
        if wanted or not names:
            k, pattern = min(wanted)
            raise CaptureSetError(
                f"{of.folder} lacks {len(wanted)} basis images, the first that of patch "
                f"{of.hemicube.patch_name(k)} under '{pattern}': capture again"
            )
        self._looked: set[tuple[int, str]] = set()

    def image(self, k: int, pattern: str) -> NDArray[np.float32]:
        """(h, w, 3)."""
        number, layer = self.there[k, pattern]
        pixels = self.files[number].read(layer)
        self.files[number].let_go(layer)
        if (k, pattern) not in self._looked:
            self._check(number, layer, pixels, (*self.of.shape, 3))
            self._looked.add((k, pattern))
        return pixels

    def images(self, k: int) -> NDArray[np.float32]:
        """(P, h, w, 3)."""
        out = np.empty((len(self.of.patterns), *self.of.shape, 3), np.float32)
        for image, name in zip(out, self.of.patterns.patterns, strict=True):
            number, layer = self.there[k, name]
            file = self.files[number]
            if file.shape(layer) == image.shape and file.dtype(layer) == image.dtype:
                file.read(layer, image)
                file.let_go(layer)
                if (k, name) not in self._looked:
                    self._check(number, layer, image, image.shape)
                    self._looked.add((k, name))
            else:
                self.image(k, name)  # which says what is wrong
        return out

    def images_at(self, k: int, pixels: NDArray[np.intp]) -> NDArray[np.float32]:
        """(P, n, 3)."""
        out = np.empty((len(self.of.patterns), len(pixels), 3), np.float32)
        at = np.divmod(pixels, self.of.region.width)
        for image, name in zip(out, self.of.patterns.patterns, strict=True):
            number, layer = self.there[k, name]
            for c, plane in enumerate(self.files[number].planes(layer)):
                image[:, c] = plane[at]
            self.files[number].let_go(layer)
        return out

    def add(self, k: int, images: NDArray, lit: NDArray) -> None:
        """Add what of a patch's light is in the first file to `lit`, (h, w, 3) float64."""
        names = self.of.patterns.patterns
        here = [i for i, name in enumerate(names) if self.there[k, name][0] == 0]
        if here:
            # float64, but for the few images of one patch, which numpy adds faster as they are
            lit += images[here].sum(axis=0) if len(here) < len(names) else images.sum(axis=0)
        if self.of.grain and self.there[k, GRAIN][0] == 0:
            lit += self.image(k, GRAIN)

    def around(self, lit: NDArray) -> Around:
        """See `BasisImages.around`; lit: the light of all patches in the first file."""
        number, layer = self.others["Combined"]
        combined = self.files[number].read(layer)
        self._check(number, layer, combined, (*self.of.shape, 4))
        own = np.asarray(combined[..., :3] - lit)
        own[np.abs(own) < ROUNDING * lit] = 0
        guides = {}
        for guide in self.others.keys() - {"Combined"}:
            number, layer = self.others[guide]
            pixels = self.files[number].read(layer)
            guides[guide] = pixels[..., 0] if pixels.shape[-1] == 1 else pixels
        return Around(np.maximum(own, 0).astype(np.float32), combined[..., 3], guides)

    def _check(self, number: int, layer: str, pixels: NDArray, shape: tuple[int, ...]) -> None:
        """Raise CaptureSetError for whatever would bend the light."""
        say = f"{self.files[number].path}, '{layer}'"
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
        # as whole numbers, what is negative is, and infinities and NaN are the largest: one pass
        bits = pixels.view(np.int32) if pixels.flags.c_contiguous else None
        if bits is None or not _within(bits.reshape(-1)):
            bad = ~(np.isfinite(pixels) & (pixels >= 0)).all(axis=-1)
            if not bad.any():
                return
            y, x = np.argwhere(bad)[0]
            raise CaptureSetError(
                f"{say} has {int(bad.sum())} pixels that are negative, infinite or not a number, "
                f"the first at ({x}, {y}): find the material there, and capture again"
            )


_INFINITY = int(np.float32(np.inf).view(np.int32))


def _within(bits: NDArray[np.int32]) -> bool:
    """Whether floats, as the whole numbers of their bits, are from 0 up and finite: compared
    without their signs, negative ones come after all others."""
    return bool(bits.view(np.uint32).max(initial=0) < _INFINITY)
