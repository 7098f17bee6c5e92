"""One seed of a tile: the files of a render that holds every patch and pattern once.

Examples
--------
>>> _within(np.array([0.0, 1.0], np.float32).view(np.int32), BRIGHTEST)
True
>>> [_within(np.array([x], np.float32).view(np.int32), np.inf) for x in (-1.0, np.inf, np.nan)]
[False, False, False]
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .. import exr
from ..errors import CaptureSetError
from ..hemicube import Hemicube
from ..patterns import PatternSet
from .names import (
    BEHIND_LIGHT,
    COMBINED,
    GRAIN,
    GROUP,
    GUIDES,
    OWN_GROUP,
    is_behind,
    is_combined,
    own_layer,
)
from .tile_data import Around

# What remains of Combined without the light groups, as a share of them, where there is no other
# light. It is the rounding of float32 sums over a few hundred passes.
ROUNDING = 3e-5
# No pixel gets more from a patch whose radiance is 1: things that add no light of their own give
# back at most what falls on them, and even a firefly of a few samples has far less. The others of
# its tile would lose their precision beside such a pixel (see `field.tile.LARGEST`).
BRIGHTEST = 1e6


@dataclass(frozen=True)
class Expected:
    """What the files of each seed of a tile must hold.

    Parameters
    ----------
    folder : Path
        The capture set's folder.
    shape : tuple of int
        (height, width) of the tile.
    hemicube : Hemicube
    patterns : PatternSet
    grain : bool
        Whether there is a grain for each patch, see `names.GRAIN`.
    radiance : float
        Of the patches in the files, where a pattern is 1.
    """

    folder: Path
    shape: tuple[int, int]
    hemicube: Hemicube
    patterns: PatternSet
    grain: bool
    radiance: float = 1.0

    @property
    def times(self) -> np.float32:
        """By how much the files are brighter where the patches have radiance 1."""
        return np.float32(1 / self.radiance)


class Seed:
    """The opened files of one seed.

    Parameters
    ----------
    of : Expected
    share : float
        The seed's share of the samples, 0 to 1.
    names : list of str
        The names of its files.
    opened : ExitStack
        Closes the files.

    Raises
    ------
    CaptureSetError
        A basis image is missing, there twice, or not expected.
    ExrError
        A file cannot be read.
    """

    def __init__(self, of: Expected, share: float, names: list[str], opened: ExitStack) -> None:
        self.of, self.share = of, share
        self.files = [opened.enter_context(exr.Layers(of.folder / name)) for name in names]
        self.there: dict[tuple[int, str], tuple[int, str]] = {}
        self.others: dict[str, tuple[int, str]] = {}
        self.behind: tuple[int, str] | None = None
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
                elif is_combined(layer):
                    self.others.setdefault(COMBINED, (number, layer))
                    combined = True
                elif is_behind(layer):
                    self.behind = self.behind or (number, layer)
                elif match := OWN_GROUP.search(layer):
                    self.others.setdefault(own_layer(match[1]), (number, layer))
                else:
                    for guide, ending in GUIDES.items():
                        if layer == ending or layer.endswith("." + ending):
                            self.others.setdefault(guide, (number, layer))
            if not combined:
                raise CaptureSetError(f"{file.path} has no part '{COMBINED}': capture again")
        if wanted or not names:
            k, pattern = min(wanted)
            raise CaptureSetError(
                f"{of.folder} lacks {len(wanted)} basis images, the first that of patch "
                f"{of.hemicube.patch_name(k)} under '{pattern}': capture again"
            )
        self._looked: set[tuple[int, str]] = set()

    def image(self, k: int, pattern: str) -> NDArray[np.float32]:
        """Read a basis image.

        Parameters
        ----------
        k : int
            The number of the patch.
        pattern : str

        Returns
        -------
        (h, w, 3) float32

        Raises
        ------
        CaptureSetError
            The image has a wrong size or type, or pixels that are negative or not finite.
        """
        number, layer = self.there[k, pattern]
        pixels = self.files[number].read(layer)
        self.files[number].let_go(layer)
        if (k, pattern) not in self._looked:
            self._check(number, layer, pixels, (*self.of.shape, 3))
            self._looked.add((k, pattern))
        return pixels * self.of.times

    def images(self, k: int) -> NDArray[np.float32]:
        """Read the basis images of a patch.

        Parameters
        ----------
        k : int

        Returns
        -------
        (P, h, w, 3) float32

        Raises
        ------
        CaptureSetError
            As `image`.
        """
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
                self.image(k, name)  # raises the error that says what is wrong
        out *= self.of.times
        return out

    def images_at(self, k: int, pixels: NDArray[np.intp]) -> NDArray[np.float32]:
        """Read the basis images of a patch in some pixels, without checking them again.

        Parameters
        ----------
        k : int
        pixels : (n,) int
            Numbers of pixels, row by row.

        Returns
        -------
        (P, n, 3) float32
        """
        out = np.empty((len(self.of.patterns), len(pixels), 3), np.float32)
        at = np.divmod(pixels, self.of.shape[1])
        for image, name in zip(out, self.of.patterns.patterns, strict=True):
            number, layer = self.there[k, name]
            for c, plane in enumerate(self.files[number].planes(layer)):
                image[:, c] = plane[at]
            self.files[number].let_go(layer)
        out *= self.of.times
        return out

    def add(self, k: int, images: NDArray, lit: NDArray) -> None:
        """Add the light of a patch that is in the first file.

        Parameters
        ----------
        k : int
        images : (P, h, w, 3) float32
            The patch's basis images.
        lit : (h, w, 3) float64
            The sum so far; changed in place.
        """
        names = self.of.patterns.patterns
        here = [i for i, name in enumerate(names) if self.there[k, name][0] == 0]
        if here:
            # the sum is float64; the few images of one patch are first added in float32, faster
            lit += images[here].sum(axis=0) if len(here) < len(names) else images.sum(axis=0)
        if self.of.grain and self.there[k, GRAIN][0] == 0:
            lit += self.image(k, GRAIN)

    def around(self, lit: NDArray) -> Around:
        """Read what is around the basis images, see `BasisImages.around`.

        Parameters
        ----------
        lit : (h, w, 3) float64
            The light of all patches in the first file, which is subtracted from its Combined.

        Returns
        -------
        Around

        Raises
        ------
        CaptureSetError
            As `image`.
        """
        number, layer = self.others[COMBINED]
        combined = self.files[number].read(layer)
        # lamps and emission may be below 0
        self._check(number, layer, combined, (*self.of.shape, 4), signed=True)
        there = lit * self.of.radiance
        own = np.asarray(combined[..., :3] - there)
        own[np.abs(own) < ROUNDING * there] = 0
        guides = {}
        for guide in self.others.keys() - {COMBINED}:
            number, layer = self.others[guide]
            pixels = self.files[number].read(layer)
            guides[guide] = pixels[..., 0] if pixels.shape[-1] == 1 else pixels
        behind = None
        if self.behind:
            number, layer = self.behind
            behind = self.files[number].read(layer)
            self._check(number, layer, behind, (*self.of.shape, 3), signed=True)
            behind = (behind / BEHIND_LIGHT).astype(np.float32)
        return Around(own.astype(np.float32), combined[..., 3], guides, behind)

    def _check(
        self,
        number: int,
        layer: str,
        pixels: NDArray,
        shape: tuple[int, ...],
        signed: bool = False,
    ) -> None:
        """Raise CaptureSetError for an image that would falsify the light.

        signed: whether pixels may be below 0.
        """
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
        # the scene's own lamps, which only Combined has, may be as bright as they like
        most = BRIGHTEST * self.of.radiance if shape[-1] == 3 else np.inf
        if signed:
            pixels = np.abs(pixels)
        # a comparison of the bits finds negative numbers, infinities and NaN in one pass
        bits = pixels.view(np.int32) if pixels.flags.c_contiguous else None
        if bits is None or not _within(bits.reshape(-1), most):
            bad = ~((pixels < most) & (pixels >= 0)).all(axis=-1)
            if not bad.any():
                return
            y, x = np.argwhere(bad)[0]
            what = "infinite or not a number"
            if not signed:
                what = "negative, infinite, not a number or too bright to be light of a patch"
            raise CaptureSetError(
                f"{say} has {int(bad.sum())} pixels that are {what}, the first at ({x}, {y}): find "
                "the material there, and capture again"
            )


def _within(bits: NDArray[np.int32], most: float) -> bool:
    """Whether the floats with these bits are at least 0 and below the most.

    Compared as unsigned numbers, negative floats, infinity and NaN come after all others.
    """
    return bool(bits.view(np.uint32).max(initial=0) < int(np.float32(most).view(np.uint32)))
