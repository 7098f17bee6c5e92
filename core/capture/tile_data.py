"""A tile of a capture in memory."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..patterns import PatternSet
from ..region import Region


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
