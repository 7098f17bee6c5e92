"""Evidence: how far what was captured can be believed, before a model is chosen by it.

How many independent light paths an entry had decides what its moments say; how small an entry is
beside its pixel's others, whether it is kept at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .moments import channel_sum

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

    least: (n,) coefficient, summed over channels, under which an entry is dropped; total: (n,) that
    of all patches; shape: (h, w) of the tile, n = h x w; solid_angles: (K,) of the patches;
    samples: samples a pixel of the capture, None without noise (photographs); grain: (K, h, w), see
    `capture_set.GRAIN`.
    """

    least: NDArray
    total: NDArray
    shape: tuple[int, int]
    solid_angles: NDArray
    samples: float | None = None
    grain: NDArray | None = None

    def kept(self, k: int, coefficient: NDArray) -> NDArray[np.intp]:
        """The pixels in which patch k, of these coefficients, (n, 3), is an entry."""
        size = channel_sum(coefficient)
        under_a_sun = SUN * self.solid_angles[k] / np.pi * self.total
        return np.flatnonzero((size > 0) & ((size >= self.least) | (size > under_a_sun)))

    def hits(self, k: int, coefficient: NDArray) -> NDArray:
        """How many equal light paths would be as noisy as what reached patch k -> (n,).

        Infinite where there is no such noise. Paths of weights w_i are as good as
        (sum w)^2 / sum w^2 equal ones. Grain shows the sum of squares, on average: over a window of
        pixels. Without it, hits are counted by the patch's share of the light, which takes all
        paths for equal.
        """
        size = channel_sum(coefficient)
        if self.samples is None:
            return np.full(size.shape, np.inf)
        share = self.samples * size / np.where(self.total > 0, self.total, 1)
        if self.grain is None:
            return share
        squares = _window_sum(np.square(self.grain[k], dtype=np.float64))
        signal = _window_sum(np.square(size).reshape(self.shape))
        found = signal / np.maximum(squares, 1e-300)
        # few grains may cancel by chance; no path counts for more than one sample
        return np.minimum(found.ravel(), 2 * share + 1)


def evidence(
    coefficients: NDArray,
    shape: tuple[int, int],
    solid_angles: NDArray,
    samples: float | None = None,
    grain: NDArray | None = None,
) -> Evidence:
    """What is known of a tile: see `Evidence`. coefficients: (K, n, 3) of all patches."""
    pixels = coefficients.shape[1]
    least, total = np.empty(pixels), np.empty(pixels)
    for start in range(0, pixels, BLOCK):
        block = slice(start, start + BLOCK)
        size = np.ascontiguousarray(channel_sum(coefficients[:, block]).T)
        total[block] = size.sum(axis=1)
        size.sort(axis=1)
        kept = np.cumsum(size, axis=1) > DROPPED * total[block, None]
        # the smallest entry that must be kept
        least[block] = np.take_along_axis(size, kept.argmax(axis=1)[:, None], axis=1)[:, 0]
    return Evidence(least, total, shape, solid_angles, samples, grain)


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
