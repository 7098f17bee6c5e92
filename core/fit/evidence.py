"""Evidence: how far what was captured can be believed, before a model is chosen by it.

How many independent light paths an entry had decides what its moments say; how small an entry is
beside its pixel's others, whether it is kept at all.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Entries are dropped into the pixel's rest, smallest first, while what is dropped stays under this
# share of the pixel's light.
DROPPED = 1e-3
# But for an entry that a sun could make more than this share of its pixel: one that gives as much
# light as a whole even sky, pi, and all of it on that entry's patch. Small patches are what that is
# about, where a sun is a thousand times the sky.
SUN = 0.01
# Pixels whose entries are sorted at a time: as many as fit the cache with their patches.
BLOCK = 2048
# Pixels along the side of the window that an entry's noise is measured in.
WINDOW = 5


@dataclass(frozen=True)
class Evidence:
    """How far the moments of a tile can be believed, and which are too small to keep.

    sizes: (K, n) coefficients, summed over channels; least: (n,) under which one is dropped; total:
    (n,) that of all patches; shape: (h, w) of the tile, n = h x w; solid_angles: (K,) of the
    patches; samples: samples a pixel of the capture, None without noise (photographs); grain: of
    patch k, (h, w), see `capture.names.GRAIN`.
    """

    sizes: NDArray[np.float32]
    least: NDArray[np.float32]
    total: NDArray[np.float32]
    shape: tuple[int, int]
    solid_angles: NDArray
    samples: float | None = None
    grain: Callable[[int], NDArray | None] | None = None

    def kept(self, k: int) -> NDArray[np.intp]:
        """The pixels in which patch k is an entry."""
        size = self.sizes[k]
        under_a_sun = np.float32(SUN * self.solid_angles[k] / np.pi) * self.total
        # one comparison: what is kept is the lesser of the two
        return np.flatnonzero((size >= np.minimum(self.least, under_a_sun)) & (size > 0))

    def hits(self, k: int, pixels: NDArray[np.intp]) -> NDArray:
        """How many equal light paths would be as noisy as what reached patch k in some pixels.

        Infinite where there is no such noise. Paths of weights w_i are as good as
        (sum w)^2 / sum w^2 equal ones. Grain shows the sum of squares, on average: over a window of
        pixels. Without it, hits are counted by the patch's share of the light, which takes all
        paths for equal.
        """
        if self.samples is None:
            return np.full(pixels.shape, np.inf)
        size, total = self.sizes[k], self.total[pixels]
        share = self.samples * size[pixels] / np.where(total > 0, total, 1)
        grain = self.grain(k) if self.grain else None
        if grain is None:
            return share
        squares = _window_sum(np.square(grain, dtype=np.float64))
        signal = _window_sum(np.square(size, dtype=np.float64).reshape(self.shape))
        found = (signal / np.maximum(squares, 1e-300)).ravel()[pixels]
        # few grains may cancel by chance; no path counts for more than one sample
        return np.minimum(found, 2 * share + 1)


def evidence(
    sizes: NDArray[np.float32],
    shape: tuple[int, int],
    solid_angles: NDArray,
    samples: float | None = None,
    grain: Callable[[int], NDArray | None] | None = None,
) -> Evidence:
    """What is known of a tile: see `Evidence`. sizes: (K, n), see there."""
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
    return Evidence(sizes, least, total, shape, solid_angles, samples, grain)


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
