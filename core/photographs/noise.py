"""The noise of photographs: measured from two of one light, and taken out (paper 9).

A sensor counts photons and adds noise of its own when it is read. So the variance of a pixel is a
constant and a part that rises with the light. Two photographs of one light tell both: their
difference is noise alone.

The noise is taken out of basis images by a filter of local statistics (Lee 1980): a pixel is drawn
towards the mean of its window by as much of the window's variance as noise explains. Where the
picture itself varies more than that, it stays. No part of this was made for rendered pictures. All
patterns of a patch are filtered by the weights of their sum, so their moments stay those of light.

Examples
--------
>>> rng = np.random.default_rng(1)
>>> light = np.linspace(0, 1, 40_000).reshape(100, 400, 1) * np.ones(3)
>>> one, two = (light + rng.normal(size=light.shape) * np.sqrt(1e-4 + 1e-3 * light) for _ in "ab")
>>> dark, rise = measured(one, two)
>>> 0.9e-4 < dark < 1.1e-4, 0.9e-3 < rise < 1.1e-3
(True, True)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Levels of light at which the noise is measured, and the fewest pixels of one.
LEVELS, FEWEST = 24, 50
# The mean of |x| of a normal distribution is that of its width.
ABSOLUTE = np.sqrt(2 / np.pi)
# Pixels along the side of the filter's window.
WINDOW = 5


def measured(one: NDArray, two: NDArray) -> tuple[float, float]:
    """Measure the noise from two photographs of one light.

    Parameters
    ----------
    one, two : (H, W, 3) float
        Scene-linear; NaN where a pixel tells nothing.

    Returns
    -------
    dark : float
        The variance of a channel without light.
    rise : float
        How far the variance rises with the light.
    """
    light = ((one + two) / 2).ravel()
    apart = np.abs(one - two).ravel() / np.sqrt(2) / ABSOLUTE
    there = np.isfinite(apart)
    light, apart = light[there], apart[there]
    order = np.argsort(light, kind="stable")
    groups = np.array_split(order, min(LEVELS, max(1, len(order) // FEWEST)))
    at = np.array([light[g].mean() for g in groups if len(g)])
    # the middle half of each level, so that what moved between the pictures counts little
    width = np.array([_mean_of_most(apart[g]) for g in groups if len(g)])
    if not len(at):
        return 0.0, 0.0
    variance = np.square(width)
    # by relative errors: each level counts alike
    weight = 1 / np.maximum(variance, 1e-3 * variance.max() + 1e-300)
    rows = np.stack([np.ones_like(at), np.maximum(at, 0)], axis=1) * weight[:, None]
    return _not_negative(rows, variance * weight)


def _mean_of_most(values: NDArray) -> float:
    """A mean of |noise| without the largest values: those beyond four times the median."""
    most = 6 * np.median(values)
    kept = values[values <= most] if most > 0 else values
    return float(kept.mean())


def _not_negative(rows: NDArray, wanted: NDArray) -> tuple[float, float]:
    """Least squares of two values that are not below 0."""
    (dark, rise), *_ = np.linalg.lstsq(rows, wanted, rcond=None)
    if dark < 0:
        dark, rise = 0.0, float(rows[:, 1] @ wanted / max(rows[:, 1] @ rows[:, 1], 1e-300))
    elif rise < 0:
        dark, rise = float(rows[:, 0] @ wanted / max(rows[:, 0] @ rows[:, 0], 1e-300)), 0.0
    return max(float(dark), 0.0), max(float(rise), 0.0)


def variance_of(noise: tuple[float, float], light: NDArray) -> NDArray:
    """Compute the variance of pixels.

    Parameters
    ----------
    noise : tuple of 2 float
        See `measured`.
    light : (...) float
        Scene-linear.

    Returns
    -------
    (...) float
    """
    dark, rise = noise
    return dark + rise * np.maximum(light, 0)


def without_noise(images: NDArray, noise: tuple[float, float]) -> NDArray[np.float32]:
    """Take the noise out of the basis images of one patch.

    Parameters
    ----------
    images : (P, H, W, 3) float
        Scene-linear. They may be below 0 by noise.
    noise : tuple of 2 float
        See `measured`, in the unit of the images.

    Returns
    -------
    (P, H, W, 3) float32
        At least 0.
    """
    images = np.asarray(images, np.float64)
    total = images.sum(axis=(0, 3))
    mean = _mean(total)
    spread = np.maximum(_mean(np.square(total)) - np.square(mean), 0)
    count = images.shape[0] * 3
    expected = count * noise[0] + noise[1] * np.maximum(mean, 0)
    # what of the spread is the picture's own
    with np.errstate(invalid="ignore", divide="ignore"):
        kept = np.where(spread > 0, np.maximum(1 - expected / spread, 0), 0)
    kept = kept[..., None]
    out = np.empty(images.shape, np.float32)
    for image, there in zip(out, images, strict=True):
        smooth = np.stack([_mean(there[..., c]) for c in range(3)], axis=-1)
        image[...] = np.maximum(smooth + kept * (there - smooth), 0)
    return out


def _mean(image: NDArray) -> NDArray:
    """Means over windows of `WINDOW` pixels a side, cut at the rim: (H, W) -> (H, W)."""
    half = WINDOW // 2
    for axis in (0, 1):
        n = image.shape[axis]
        pad = [(0, 0), (0, 0)]
        pad[axis] = (1, 0)
        sums = np.pad(np.cumsum(image, axis=axis), pad)
        high, low = np.minimum(np.arange(n) + half + 1, n), np.maximum(np.arange(n) - half, 0)
        count = (high - low)[:, None] if axis == 0 else (high - low)[None, :]
        image = (sums.take(high, axis=axis) - sums.take(low, axis=axis)) / count
    return image
