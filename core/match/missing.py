"""What no light can make: places of a target that the best light leaves too bright or too dark.

A shadow that is painted where nothing throws one, or a highlight where nothing shines. A field is
off by a little everywhere, by noise and at edges; what is told has an area, and is off by much.

Examples
--------
>>> made = np.ones((40, 60, 3))
>>> target = made.copy()
>>> target[10:20, 20:40] = 0.3
>>> found = missing(made, target, np.ones((40, 60), bool))
>>> found.told, round(found.share, 2)
(True, 0.08)
>>> found.words
'no light makes 8% of the picture as dark as it is in the target, most of it in the middle'
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# How far off a place is, relative to the brighter of picture and target, and over which part of the
# picture's width it is averaged.
OFF, ACROSS = 0.3, 1 / 40
# The share of what counts from which on it is told.
LEAST = 0.01


@dataclass(frozen=True)
class Missing:
    """What no light makes.

    Parameters
    ----------
    difference : (h, w, 3) float64
        The target less the picture, 0 where nothing is matched.
    share : float
        The share of the pixels that count which are far off together with their neighbours.
    words : str
        A sentence; "" where nothing is to be told.
    """

    difference: NDArray[np.float64]
    share: float
    words: str

    @property
    def told(self) -> bool:
        """Whether the artist is told."""
        return bool(self.words)


def missing(
    picture: NDArray[np.float64],
    target: NDArray[np.float64],
    counts: NDArray[np.bool_],
    mirrors: NDArray[np.bool_] | None = None,
) -> Missing:
    """Find places of a target that a picture does not come near.

    Parameters
    ----------
    picture, target : (h, w, 3) float64
        Scene-linear radiance.
    counts : (h, w) bool
        The pixels that were matched.
    mirrors : (h, w) bool, optional
        The pixels that show what light there is: some light makes them as they are in the target,
        so they are not told.

    Returns
    -------
    Missing
    """
    difference = np.where(counts[..., None], target - picture, 0)
    if not counts.any():
        return Missing(difference, 0.0, "")
    made, asked = (np.where(counts, np.maximum(p, 0).sum(axis=-1), 0) for p in (picture, target))
    reach = max(2, round(counts.shape[1] * ACROSS / 2))
    around = _mean(counts.astype(np.float64), reach)
    made, asked = (_mean(p, reach) for p in (made, asked))
    both = np.maximum(made, asked)
    # in what is nearly black a little light is much
    floor = 0.1 * float(both[counts].mean())
    off = np.divide(asked - made, both + floor, out=np.zeros_like(both), where=both > 0)
    off[~counts | (around < 0.5)] = 0
    if mirrors is not None:
        off[_mean((mirrors & counts).astype(np.float64), reach) > 0.5 * around] = 0
    dark, bright = (off < -OFF), (off > OFF)
    share = float((dark | bright).sum()) / float(counts.sum())
    if share < LEAST:
        return Missing(difference, share, "")
    most = dark if dark.sum() >= bright.sum() else bright
    kind = "dark" if most is dark else "bright"
    words = (
        f"no light makes {share:.0%} of the picture as {kind} as it is in the target, most of it "
        f"{_place(most)}"
    )
    return Missing(difference, share, words)


def _mean(image: NDArray[np.float64], reach: int) -> NDArray[np.float64]:
    """The mean of the pixels up to `reach` away, with zeros beyond the rim."""
    for axis in (0, 1):
        size = image.shape[axis]
        zeros = np.zeros_like(np.take(image, [0], axis))
        sums = np.cumsum(np.concatenate([zeros, image], axis), axis)
        low = np.clip(np.arange(size) - reach, 0, size)
        high = np.clip(np.arange(size) + reach + 1, 0, size)
        image = (np.take(sums, high, axis) - np.take(sums, low, axis)) / (2 * reach + 1)
    return image


def _place(where: NDArray[np.bool_]) -> str:
    """Where most of some pixels are, in words."""
    rows, columns = np.nonzero(where)
    y, x = np.median(rows) / where.shape[0], np.median(columns) / where.shape[1]
    up = "at the top" if y < 1 / 3 else "at the bottom" if y > 2 / 3 else ""
    side = "left" if x < 1 / 3 else "right" if x > 2 / 3 else ""
    if up and side:
        return f"{up} {side}"
    return up or (f"on the {side}" if side else "in the middle")
