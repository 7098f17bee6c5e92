"""Basis images: the pictures of one tile under each patch and pattern, read patch by patch (paper
4.3).

All basis images together are the largest data of a tile, and no step needs them at once: the fit
reads one patch after the other. Only the light that belongs to no patch takes a pass over all.

Examples
--------
The mean of two seeds, of which the first has a quarter of the samples:

>>> first, second = np.full(2, 1.0, np.float32), np.full(2, 2.0, np.float32)
>>> _mean((0.25, first), [(0.75, second)]).tolist()
[1.75, 1.75]
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import CaptureSetError, ExrError
from ..hemicube import Hemicube
from ..patterns import PatternSet
from ..region import Region
from .names import GRAIN, OF_ONE_RAY
from .seed import Expected, Seed
from .tile_data import Around, TileData
from .tile_entry import sums_of


class BasisImages:
    """The basis images of a tile on disk, opened; a context manager that closes them.

    Parameters
    ----------
    folder : Path
        The capture set's folder.
    renders : list of (float, list of str)
        For each seed its share of the samples and the names of its files.
    region : Region
        The tile's place in the picture.
    hemicube : Hemicube
    patterns : PatternSet
    grain : bool
        Whether each patch has an image of the grain, see `names.GRAIN`.
    together : bool
        Whether all images of a patch are of one render. Otherwise no pattern shows grain.
    sums : dict of str to int, optional
        The checksums of the files, by their names. A file is compared with its own, if it has one.
    radiance : float
        Of the patches in the files, where a pattern is 1.

    Raises
    ------
    CaptureSetError
        A file or a basis image is missing, there twice, or of another capture set.
    """

    def __init__(
        self,
        folder: Path,
        renders: list[tuple[float, list[str]]],
        region: Region,
        hemicube: Hemicube,
        patterns: PatternSet,
        grain: bool = False,
        together: bool = True,
        sums: Mapping[str, int] | None = None,
        radiance: float = 1.0,
    ) -> None:
        self.folder, self.region = folder, region
        self.hemicube, self.patterns, self.grain = hemicube, patterns, grain
        self.together = together
        expected = Expected(folder, self.shape, hemicube, patterns, grain, radiance)
        self._files = ExitStack()
        try:
            with self._files as files:
                self._seeds = [Seed(expected, share, names, files) for share, names in renders]
                _compare(folder, [name for _, names in renders for name in names], sums or {})
                self._files = files.pop_all()
        except ExrError as e:
            raise CaptureSetError(f"{e} (run Capture again)") from e

    def __enter__(self) -> BasisImages:
        return self

    def __exit__(self, *_: object) -> None:
        self._files.close()

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) of the tile."""
        return self.region.height, self.region.width

    def images(self, k: int) -> NDArray[np.float32]:
        """Read the basis images of a patch, the mean over seeds.

        Parameters
        ----------
        k : int

        Returns
        -------
        (P, h, w, 3) float32

        Raises
        ------
        CaptureSetError
            An image would falsify the light: a wrong size or type, negative or not finite pixels.
        """
        total, *others = ((s.share, s.images(k)) for s in self._seeds)
        return _mean(total, others)

    def coefficient(self, k: int, patterns: PatternSet) -> NDArray[np.float32]:
        """Compute the reflection coefficient R of a patch.

        Parameters
        ----------
        k : int
        patterns : PatternSet
            Where some patterns add up to R, the images of the others are not read.

        Returns
        -------
        (h, w, 3) float32

        Raises
        ------
        CaptureSetError
            As `images`.
        """
        which = patterns.shown_by
        if which is None:
            return patterns.coefficient(self.images(k))
        found = []
        for name in (patterns.patterns[p] for p in which):
            total, *others = ((s.share, s.image(k, name)) for s in self._seeds)
            found.append(_mean(total, others))
        return sum(found[1:], found[0])

    def images_at(self, k: int, pixels: NDArray[np.intp]) -> NDArray[np.float32]:
        """Read the basis images of a patch in some pixels.

        The images must have been checked before, by `images` or `around`.

        Parameters
        ----------
        k : int
        pixels : (n,) int
            Numbers of pixels, row by row.

        Returns
        -------
        (P, n, 3) float32
        """
        total, *others = ((s.share, s.images_at(k, pixels)) for s in self._seeds)
        return _mean(total, others)

    def grain_of(self, k: int) -> NDArray[np.float32] | None:
        """Compute the grain of a patch, see `names.GRAIN`.

        Parameters
        ----------
        k : int

        Returns
        -------
        (h, w) float32 or None
            None where it was not captured.
        """
        if not self.grain:
            if self.patterns.grey or not self.together:
                return None
            return self.patterns.grains(self.images(k))
        white = self.patterns.coefficient(self.images(k)).sum(axis=-1)
        total, *others = ((s.share, s.image(k, GRAIN).sum(axis=-1)) for s in self._seeds)
        return np.asarray(2 * _mean(total, others) - white)

    def around(self, look: Callable[[int, NDArray], None]) -> Around:
        """Compute what is around the basis images, in one pass over all of them.

        Parameters
        ----------
        look : callable
            Called with the number of each patch and its images (P, h, w, 3), which it must not
            keep.

        Returns
        -------
        Around

        Raises
        ------
        CaptureSetError
            As `images`.
        """
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
        there = [a.behind for a in layers if a.behind is not None]
        behind = mean(there) if len(there) == len(layers) else None
        own, alpha = mean([a.own for a in layers]), mean([a.alpha for a in layers])
        return Around(own, alpha, guides, behind)

    def read(self) -> TileData:
        """Read the whole tile into memory.

        Returns
        -------
        TileData

        Raises
        ------
        CaptureSetError
            As `images`.
        """
        basis = np.empty((len(self.hemicube), len(self.patterns), *self.shape, 3), np.float32)

        def keep(k: int, images: NDArray) -> None:
            basis[k] = images

        found = self.around(keep)
        grains = [self.grain_of(k) for k in range(len(self.hemicube))]
        there = [g for g in grains if g is not None]
        grain = np.stack(there) if there else None
        return TileData(
            self.region, basis, found.own, found.alpha, found.guides, grain, self.together,
            found.behind,
        )  # fmt: skip


def _compare(folder: Path, names: list[str], sums: Mapping[str, int]) -> None:
    """Raise CaptureSetError where a file does not have its checksum."""
    for name, found in sums_of(folder, [n for n in names if n in sums]).items():
        if found != sums[name]:
            raise CaptureSetError(f"{folder / name} is not what was rendered: capture again")


def _mean(first: tuple[float, NDArray], others: list[tuple[float, NDArray]]) -> NDArray:
    """The mean of images, weighted by their shares of the samples; a single image is returned as it
    is.
    """
    share, image = first
    if not others:
        return image
    total = image * np.float32(share)
    for share, image in others:
        total += image * np.float32(share)
    return total
