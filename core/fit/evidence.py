"""Evidence: how far a capture can be believed, before a model is chosen by it.

The number of independent light paths of an entry decides how reliable its moments are. The size of
an entry beside the others of its pixel decides whether it is kept.

Examples
--------
>>> sizes = np.array([[1.0], [0.0002]], np.float32)  # two patches, one pixel
>>> found = evidence(sizes, (1, 1), np.array([0.1, 0.1]), samples=64)
>>> found.kept(0).tolist(), found.kept(1).tolist()
([0], [])
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Entries are dropped into the pixel's rest, the smallest first, up to this share of its light.
DROPPED = 1e-3
# An entry is kept if a sun on its patch could make it more than this share of its pixel. The sun is
# taken to give as much light as a whole even sky (pi). This concerns small patches, on which a sun
# is a thousand times brighter than the sky.
SUN = 0.01
# The variance of a place on a patch that is seen evenly, in patch widths.
WHOLE_SPREAD = 1 / 12
# Pixels whose entries are sorted at a time, so that they fit the cache.
BLOCK = 2048
# Pixels along the side of the window that an entry's noise is measured in.
WINDOW = 5


@dataclass(frozen=True)
class Evidence:
    """The sizes of a tile's entries and what is known of their noise.

    Parameters
    ----------
    sizes : (K, n) float32
        The coefficients, summed over channels.
    least : (n,) float32
        The size below which an entry is dropped.
    total : (n,) float32
        The sum of all sizes of a pixel.
    shape : tuple of int
        (h, w) of the tile, n = h x w.
    solid_angles : (K,) float
        Of the patches, in steradians.
    samples : float, optional
        Samples a pixel of the capture; None for images without noise, such as photographs.
    grain : callable, optional
        Gives the grain (h, w) of a patch by its number, see `capture.names.GRAIN`.
    noise : tuple of 2 float, optional
        Of photographs: the variance that noise gives a mean place, in patch widths, is this in the
        dark and its rise with the size, over the square of the size.
    """

    sizes: NDArray[np.float32]
    least: NDArray[np.float32]
    total: NDArray[np.float32]
    shape: tuple[int, int]
    solid_angles: NDArray
    samples: float | None = None
    grain: Callable[[int], NDArray | None] | None = None
    noise: tuple[float, float] | None = None

    def kept(self, k: int) -> NDArray[np.intp]:
        """Find the pixels in which a patch is kept as an entry.

        Parameters
        ----------
        k : int

        Returns
        -------
        (m,) int
        """
        return np.flatnonzero(self.kept_of(k, slice(None), self.sizes[k]))

    def kept_of(self, k: int, pixels: NDArray[np.intp] | slice, size: NDArray) -> NDArray[np.bool_]:
        """Say whether light of some size from a patch is kept as an entry.

        Parameters
        ----------
        k : int
        pixels : (m,) int or slice
        size : (m,) float
            The sum over channels.

        Returns
        -------
        (m,) bool
        """
        under_a_sun = np.float32(SUN * self.solid_angles[k] / np.pi) * self.total[pixels]
        # one comparison: what is kept is the lesser of the two
        kept: NDArray[np.bool_] = size >= np.minimum(self.least[pixels], under_a_sun)
        return kept & (size > 0)

    def share_of(self, pixels: NDArray[np.intp], size: NDArray) -> NDArray:
        """Compute how many light paths of a pixel some light has, if all paths are equal.

        Parameters
        ----------
        pixels : (m,) int
        size : (m,) float
            The light, summed over channels.

        Returns
        -------
        (m,) float
        """
        total = self.total[pixels]
        return (self.samples or np.inf) * size / np.where(total > 0, total, 1)

    def hits(self, k: int, pixels: NDArray[np.intp]) -> NDArray:
        """Compute how many equal light paths would be as noisy as the paths from a patch to some
        pixels.

        Paths of weights w_i are as good as (sum w)^2 / sum w^2 equal ones. The grain shows the sum
        of squares on average, so it is summed over a window of pixels. Without grain, the paths are
        taken for equal, and are counted by the patch's share of the light.

        Parameters
        ----------
        k : int
        pixels : (m,) int

        Returns
        -------
        (m,) float
            Infinite for images without noise.
        """
        if self.noise is not None:
            return self._as_noisy(self.sizes[k][pixels])
        if self.samples is None:
            return np.full(pixels.shape, np.inf)
        size = self.sizes[k]
        share = self.share_of(pixels, size[pixels])
        grain = self.grain(k) if self.grain else None
        if grain is None:
            return share
        # NaN where the channel that shows the grain has no light
        told = np.isfinite(grain)
        squares = _window_sum(np.where(told, np.square(grain, dtype=np.float64), 0))
        signal = np.square(size, dtype=np.float64).reshape(self.shape)
        signal = _window_sum(np.where(told, signal, 0)).ravel()[pixels]
        found = signal / np.maximum(squares.ravel()[pixels], 1e-300)
        found = np.where(signal > 0, found, share)
        # a few grains may cancel by chance, and a path cannot be more than one sample
        return np.minimum(found, 2 * share + 1)

    def _as_noisy(self, size: NDArray) -> NDArray:
        """How many light paths over a patch would make the mean place as uncertain as photographs
        do."""
        assert self.noise is not None
        dark, rise = self.noise
        variance = (dark + rise * size) / np.maximum(np.square(size, dtype=np.float64), 1e-300)
        return WHOLE_SPREAD / np.maximum(variance, 1e-12)


def evidence(
    sizes: NDArray[np.float32],
    shape: tuple[int, int],
    solid_angles: NDArray,
    samples: float | None = None,
    grain: Callable[[int], NDArray | None] | None = None,
    noise: tuple[float, float] | None = None,
) -> Evidence:
    """Collect what is known of a tile.

    Parameters
    ----------
    sizes : (K, n) float32
    shape : tuple of int
    solid_angles : (K,) float
    samples : float, optional
    grain : callable, optional
    noise : tuple of 2 float, optional
        All as in `Evidence`.

    Returns
    -------
    Evidence
    """
    pixels = sizes.shape[1]
    least, total = np.empty(pixels, np.float32), np.empty(pixels, np.float32)

    def look(start: int) -> None:
        block = slice(start, start + BLOCK)
        size = np.sort(sizes[:, block].T, axis=1)
        sums = np.cumsum(size, axis=1, dtype=np.float64)
        total[block] = sums[:, -1]
        kept = sums > DROPPED * sums[:, -1:]
        # the smallest entry that must be kept
        least[block] = np.take_along_axis(size, kept.argmax(axis=1)[:, None], axis=1)[:, 0]

    with ThreadPoolExecutor() as pool:
        list(pool.map(look, range(0, pixels, BLOCK)))
    return Evidence(sizes, least, total, shape, solid_angles, samples, grain, noise)


def _window_sum(image: NDArray) -> NDArray:
    """Sums over windows of `WINDOW` pixels a side, cut at the rim: (h, w) -> (h, w)."""
    for axis in (0, 1):
        length = image.shape[axis]
        pad = [(0, 0)] * 2
        pad[axis] = (1, 0)
        sums = np.pad(np.cumsum(image, axis=axis), pad)
        at = np.arange(length)
        high = np.minimum(at + WINDOW // 2 + 1, length)
        low = np.maximum(at - WINDOW // 2, 0)
        image = sums.take(high, axis=axis) - sums.take(low, axis=axis)
    return image
