"""A tile of a capture in memory.

Examples
--------
>>> from arto.core.patterns import pattern_set
>>> white = np.full((1, 1, 2, 4, 3), 0.25, np.float32)  # one patch, one pattern, 2 x 4 pixels
>>> dark, alpha = np.zeros((2, 4, 3), np.float32), np.ones((2, 4), np.float32)
>>> tile = TileData(Region(0, 0, 4, 2), white, dark, alpha, {})
>>> float(tile.coefficient(0, pattern_set("white")).max())
0.25
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..patterns import PatternSet
from ..region import Region


@dataclass(frozen=True)
class Around:
    """What a tile shows beside its patches.

    Parameters
    ----------
    own : (h, w, 3) float32
        The light of the scene's own lamps, scene-linear.
    alpha : (h, w) float32
    guides : dict of str to (h, w) or (h, w, 3) float32
        Those of albedo, normal, position and depth that were captured, and the `own_layer` of each
        light group of the scene's own lamps.
    behind : (h, w, 3) float32, optional
        How much of the world behind all things the camera sees, by channel.
    """

    own: NDArray[np.float32]
    alpha: NDArray[np.float32]
    guides: dict[str, NDArray[np.float32]]
    behind: NDArray[np.float32] | None = None


@dataclass(frozen=True)
class TileData:
    """The basis images of a tile, and what is around them.

    Parameters
    ----------
    region : Region
        Its place in the picture.
    basis : (K, P, h, w, 3) float32
        The basis images, scene-linear radiance.
    own, alpha, guides, behind
        See `Around`.
    grain : (K, h, w) float32, optional
        The difference of two random halves of the light, summed over channels, see `names.GRAIN`.
    together : bool
        Whether all images of a patch are of one render.
    """

    region: Region
    basis: NDArray[np.float32]
    own: NDArray[np.float32]
    alpha: NDArray[np.float32]
    guides: dict[str, NDArray[np.float32]]
    grain: NDArray[np.float32] | None = None
    together: bool = True
    behind: NDArray[np.float32] | None = None

    def images(self, k: int) -> NDArray[np.float32]:
        """Give the basis images of a patch.

        Parameters
        ----------
        k : int

        Returns
        -------
        (P, h, w, 3) float32
        """
        return self.basis[k]

    def coefficient(self, k: int, patterns: PatternSet) -> NDArray[np.float32]:
        """Compute the reflection coefficient R of a patch.

        Parameters
        ----------
        k : int
        patterns : PatternSet

        Returns
        -------
        (h, w, 3) float32
        """
        return patterns.coefficient(self.basis[k])

    def images_at(self, k: int, pixels: NDArray[np.intp]) -> NDArray[np.float32]:
        """Give the basis images of a patch in some pixels.

        Parameters
        ----------
        k : int
        pixels : (n,) int
            Numbers of pixels, row by row.

        Returns
        -------
        (P, n, 3) float32
        """
        return self.basis[k].reshape(len(self.basis[k]), -1, 3)[:, pixels]

    def grain_of(self, k: int) -> NDArray[np.float32] | None:
        """Give the grain of a patch.

        Parameters
        ----------
        k : int

        Returns
        -------
        (h, w) float32 or None
            None where it was not captured.
        """
        return None if self.grain is None else self.grain[k]

    def around(self, look: Callable[[int, NDArray], None]) -> Around:
        """Give what is around the basis images, and show the images of every patch on the way.

        Parameters
        ----------
        look : callable
            Called with the number of each patch and its images (P, h, w, 3).

        Returns
        -------
        Around
        """
        for k, images in enumerate(self.basis):
            look(k, images)
        return Around(self.own, self.alpha, self.guides, self.behind)
