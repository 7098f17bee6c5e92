"""Pooled evidence: how wide the light of an entry comes from, told by its neighbours as well.

A mirror image of 4% on glass has three light paths of 64, which no criterion believes. But the
neighbours have three paths too, each of them at one place of the patch. So the spread *within* each
pixel is pooled over a window of pixels. The spread between pixels is no part of it: a mirror image
moves from pixel to pixel.

The pool is of pairs of paths. For paths of weights w at places x, a pixel's R^2 times its variance
is the sum of w_a w_b (x_a - x_b)^2 over its pairs, and R^2 - sum w^2 is the sum of 2 w_a w_b over
them. The square of a pixel's grain shows sum w^2 on average (`basis_images.GRAIN`). The ratio of
both, summed over pixels, is the variance without bias, at any number of paths. A pixel of a single
path adds nothing to either sum, so diffuse noise is not taken for mirrors.

Examples
--------
The sums over windows of five pixels a side:

>>> _windows(np.ones((1, 5, 6), np.float32)).tolist()
[[[25.0, 25.0]]]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..capture.moments import Moments
from .evidence import Evidence

# Pixels along the side of the window.
WINDOW = 5
# Pixels whose entries differ by more than this factor are of other materials or of an edge.
ALIKE = 6.0
# A pixel's own spread counts against the pool's by its own pairs, which so many paths of the pool
# weigh up.
POOL = 16.0


@dataclass(frozen=True)
class Pool:
    """What the windows around n entries tell.

    Parameters
    ----------
    spread : (3, n) float32
        The variances along u and v and the covariance, without bias.
    paths : (n,) float32
        How many light paths tell it. Each pixel adds one less than it has.
    """

    spread: NDArray[np.float32]
    paths: NDArray[np.float32]


def pooled(
    moments: Moments,
    sizes: NDArray,
    grain: NDArray,
    pixels: NDArray[np.intp],
    shape: tuple[int, int],
    among: NDArray[np.intp] | None = None,
) -> Pool:
    """Pool the evidence of n entries of one patch.

    Parameters
    ----------
    moments : Moments
        Of the entries.
    sizes : (n,) float
        Their coefficients, summed over channels.
    grain : (n,) float
        Their grain, NaN where none is known.
    pixels : (n,) int
        Their numbers in the tile, row by row.
    shape : tuple of int
        (h, w) of the tile.
    among : (m,) int, optional
        The entries for which the pool is asked. Then each is pooled with neighbours of about its
        own size alone. Default: all entries, with everything in the window, which is quicker.

    Returns
    -------
    Pool
    """
    sizes = sizes.astype(np.float32)
    pairs = 1 - np.square(grain.astype(np.float32) / np.where(sizes > 0, sizes, 1))
    told = np.isfinite(pairs) & (sizes > 0)
    pairs = np.where(told, np.maximum(pairs, 0), 0)
    own = np.stack([*moments.variance, moments.covariance, pairs, told]).astype(np.float32)
    own[:3] *= told
    own[~np.isfinite(own)] = 0
    half = WINDOW // 2
    height, width = shape
    image = np.zeros((5, height + 2 * half, width + 2 * half), np.float32)
    y, x = np.divmod(pixels, width)
    image[:, y + half, x + half] = own
    if among is None:
        found = _windows(image)[:, y, x]
    else:
        size = np.zeros(image.shape[1:], np.float32)
        size[y + half, x + half] = sizes
        found = _alike(image, size, sizes[among], y[among], x[among])
    sums, all_pairs, count = found[:3], found[3], found[4]
    # of m pairs a pixel, as one less 1 / n of n paths
    each = all_pairs / np.maximum(count, 1)
    paths = count * each / np.maximum(1 - each, 1e-3)
    spread = sums / np.maximum(all_pairs, 1e-6)
    spread[:, all_pairs < 1e-3] = np.nan
    return Pool(spread, paths.astype(np.float32))


def hits_of(
    known: Evidence, sizes: NDArray, grain: NDArray | None, pixels: NDArray[np.intp]
) -> tuple[NDArray, NDArray | None]:
    """Count the equal light paths that n entries have, each by its window.

    Parameters
    ----------
    known : Evidence
        Without samples nothing is noisy.
    sizes : (n,) float
        The light in question, summed over channels. It may be a part of an entry.
    grain : (n,) float, optional
        The grain of that light. Without it the paths are counted by the share of the light.
    pixels : (n,) int

    Returns
    -------
    hits : (n,) float
    grain : (n,) float or None
        As given; None where nothing is noisy.
    """
    if known.samples is None:
        return np.full(pixels.shape, np.inf), None
    share = known.share_of(pixels, sizes)
    if grain is None:
        return share, None
    told = np.isfinite(grain)
    half = WINDOW // 2
    y, x = np.divmod(pixels, known.shape[1])
    image = np.zeros((2, known.shape[0] + 2 * half, known.shape[1] + 2 * half), np.float32)
    # each pixel counts as much as any other of its window: their ratio of squares
    image[0, y + half, x + half] = told
    image[1, y + half, x + half] = np.where(told, np.square(grain / sizes), 0)
    count, squares = _windows(image)[:, y, x]
    found = np.where(count > 0, count / np.maximum(squares, 1e-9), share)
    return np.minimum(found, 2 * share + 1), grain


def _windows(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Sums over windows of (m, h + 4, w + 4) -> (m, h, w)."""
    for axis in (1, 2):
        n = image.shape[axis] - WINDOW + 1
        total = image.take(range(n), axis=axis)
        for i in range(1, WINDOW):
            total += image[:, i : i + n] if axis == 1 else image[:, :, i : i + n]
        image = total
    return image


def _alike(
    image: NDArray[np.float32],
    size: NDArray[np.float32],
    sizes: NDArray[np.float32],
    y: NDArray[np.intp],
    x: NDArray[np.intp],
) -> NDArray[np.float32]:
    """Sums over the windows of some pixels, of what is of about their size -> (m, n)."""
    total = np.zeros((len(image), len(y)), np.float32)
    low, high = sizes / np.float32(ALIKE), sizes * np.float32(ALIKE)
    for i in range(WINDOW):
        for j in range(WINDOW):
            there = size[y + i, x + j]
            total += image[:, y + i, x + j] * ((there >= low) & (there <= high))
    return total


def weighed(moments: Moments, hits: NDArray, pool: Pool) -> NDArray[np.float32]:
    """Mix the spreads of entries with those of their pools.

    Parameters
    ----------
    moments : Moments
        Of n entries.
    hits : (n,) float
        How many equal light paths each entry has by itself.
    pool : Pool

    Returns
    -------
    (3, n) float32
        The pool's variances and covariance, and the entries' own where these have paths enough.
    """
    own = np.stack([*moments.variance, moments.covariance])
    more = np.maximum(hits - 1, 0)
    with np.errstate(invalid="ignore"):
        unbiased = own * np.where(np.isinf(hits), 1, hits / np.maximum(more, 0.5))
        share = np.where(np.isinf(more), 1, more / (more + POOL))
        mixed = share * unbiased + (1 - share) * pool.spread
    return np.where(np.isfinite(mixed), mixed, own).astype(np.float32)
