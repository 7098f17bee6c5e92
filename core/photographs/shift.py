"""Whether photographs moved against each other: shifts found by phase correlation, and put back.

Pictures in different light have the same edges at most. So it is the size of the gradient of the
logarithm that is compared, and a shift counts only where the edges then agree clearly better.

Examples
--------
>>> rng = np.random.default_rng(1)
>>> picture = rng.random((40, 60)).repeat(3, 0).repeat(3, 1)
>>> found = shift_of(picture, np.roll(picture, (2, -3), (0, 1)))
>>> found.x, found.y, found.sure
(-3, 2, True)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Pixels a side of what is compared: a piece from the middle of a larger picture.
SIDE = 1024
# Pixels of all pictures together.
MOST = 1 << 26
# A shift larger than this share of the picture's side is not believed.
FARTHEST = 0.1
# By how much better edges must agree, as a correlation, for a shift to be believed.
BETTER = 0.1
# The least correlation of edges that are of one thing.
ALIKE = 0.25


@dataclass(frozen=True)
class Shift:
    """How far a picture moved against another.

    Parameters
    ----------
    x, y : int
        Pixels to the right and down.
    better : float
        By how much the edges agree better when it is put back, as a correlation.
    sure : bool
        Whether that is enough to believe it.
    """

    x: int
    y: int
    better: float
    sure: bool

    @property
    def moved(self) -> bool:
        """Whether there is a shift, and it is sure."""
        return self.sure and (self.x, self.y) != (0, 0)


def edges(grey: NDArray) -> NDArray[np.float64]:
    """Compute what of a picture is compared: the size of the gradient of its logarithm.

    Parameters
    ----------
    grey : (H, W) float
        Light, of any exposure.

    Returns
    -------
    (H, W) float64
    """
    floor = 0.02 * float(np.percentile(grey, 99)) + 1e-9
    log = np.log(np.maximum(grey, 0) + floor)
    down, across = np.gradient(log)
    size = np.sqrt(down * down + across * across)
    # noise and single bright edges count no more than others
    top = float(np.percentile(size, 99)) or 1.0
    return np.minimum(size, top)


def middle(shape: tuple[int, int], count: int = 1) -> tuple[slice, slice]:
    """Choose the piece of pictures that is compared.

    Parameters
    ----------
    shape : tuple of int
        (height, width).
    count : int
        How many pictures there are: of many, less of each is in memory.

    Returns
    -------
    tuple of slice
        Rows and columns.
    """
    side = min(SIDE, max(64, int(np.sqrt(MOST / count))))
    rows, columns = (slice((n - min(n, side)) // 2, (n + min(n, side)) // 2) for n in shape)
    return rows, columns


def shift_of(first: NDArray, second: NDArray) -> Shift:
    """Find how far a picture moved against another.

    Parameters
    ----------
    first, second : (H, W) float
        `edges` of both, or any pictures that show the same.

    Returns
    -------
    Shift
        Of the second against the first.

    Source
    ------
    C. Kuglin and D. Hines, The Phase Correlation Image Alignment Method, 1975.
    """
    height, width = first.shape
    window = np.hanning(height)[:, None] * np.hanning(width)
    one, two = (np.fft.rfft2((p - p.mean()) * window) for p in (first, second))
    cross = two * np.conj(one)
    # fine detail is noise: it counts less, as in a picture that is a little blurred
    fy, fx = np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width)[None]
    soft = np.exp(-(fx * fx + fy * fy) / (2 * 0.15**2))
    peak = np.fft.irfft2(cross / np.maximum(np.abs(cross), 1e-12) * soft, s=(height, width))
    most = [max(1, int(FARTHEST * n)) for n in (height, width)]
    near = np.zeros((height, width), bool)
    for y in (slice(0, most[0] + 1), slice(-most[0], None)):
        for x in (slice(0, most[1] + 1), slice(-most[1], None)):
            near[y, x] = True
    at = int(np.where(near, peak, -np.inf).argmax())
    y, x = divmod(at, width)
    y, x = y - height * (y > height // 2), x - width * (x > width // 2)
    there, still = _alike(first, second, x, y), _alike(first, second, 0, 0)
    better = there - still
    sure = (x, y) == (0, 0) or (better > BETTER and there > ALIKE)
    return Shift(x, y, better, sure)


def _alike(first: NDArray, second: NDArray, x: int, y: int) -> float:
    """The correlation of what both pictures show, once the second is put back."""
    a, b = overlap(first, x, y), overlap(second, -x, -y)
    a, b = a - a.mean(), b - b.mean()
    return float((a * b).sum() / max(np.sqrt((a * a).sum() * (b * b).sum()), 1e-30))


def overlap(picture: NDArray, x: int, y: int) -> NDArray:
    """Cut off what another picture, moved by a shift against this one, does not show.

    Parameters
    ----------
    picture : (H, W, ...) array
    x, y : int
        The other's shift.

    Returns
    -------
    array
        A view.
    """
    height, width = picture.shape[:2]
    return picture[max(0, -y) : height - max(0, y), max(0, -x) : width - max(0, x)]


def put_back(picture: NDArray, x: int, y: int) -> NDArray:
    """Move a picture back by whole pixels. What comes in at the rim is the rim's own pixel again.

    Parameters
    ----------
    picture : (H, W, ...) array
    x, y : int
        How far it moved, to the right and down.

    Returns
    -------
    array
        Of the same shape.
    """
    height, width = picture.shape[:2]
    rows = np.clip(np.arange(height) + y, 0, height - 1)
    columns = np.clip(np.arange(width) + x, 0, width - 1)
    return picture[rows[:, None], columns]
