"""Basis images: one tile's pictures under each patch and pattern, read patch by patch (paper 4.3).

A stack of them is as large as a tile gets, and nothing needs it all at once: the fit reads a patch,
then the next. Only what hangs on all of them, the light that is no patch's, takes a pass over all.
"""

from __future__ import annotations

from collections.abc import Callable
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
        expected = Expected(folder, self.shape, hemicube, patterns, grain)
        self._files = ExitStack()
        try:
            with self._files as files:
                self._seeds = [Seed(expected, share, names, files) for share, names in renders]
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
