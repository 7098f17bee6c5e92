"""Verification: whether a picture agrees with two noisy renders of the truth, within their noise.

The mean of the two renders is the truth with noise, and their difference tells how large this
noise is. Means over squares of pixels are compared: noise falls with the side of a square, and an
error stays.

Examples
--------
>>> noise = np.random.default_rng(0).normal(0, 0.05, (2, 64, 64, 3))
>>> one, two = 0.5 + noise
>>> verify(np.full((64, 64, 3), 0.5), one, two).share < 0.01
True
>>> verify(np.full((64, 64, 3), 0.6), one, two).share > 0.99
True
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Pixels along the side of a square, and how many standard errors count as chance.
SIDE = 8
CHANCE = 3.0
# A relative difference that nobody sees.
TELLING = 0.02
# How many times the difference that noise makes still counts as noise.
NEARLY = 1.2


@dataclass(frozen=True)
class Verdict:
    """How a picture compares with the truth.

    Parameters
    ----------
    error : float
        The mean relative difference over squares, noise included.
    noise : float
        The part of `error` that noise alone would cause, the picture's own included.
    share : float
        The share of squares that differ by more than chance, 0 to 1.
    off : (H, W) float32
        The relative difference beyond chance; the pixels of a square have the same value.
    """

    error: float
    noise: float
    share: float
    off: NDArray[np.float32]

    @property
    def line(self) -> str:
        """The result in words."""
        on_the_mean = (
            f"by {self.error:.1%} on the mean, of which noise alone makes {self.noise:.1%}"
        )
        if self.share >= 0.01:
            return f"Differs by more than noise in {self.share:.0%} of the picture: {on_the_mean}"
        if self.error <= NEARLY * self.noise:
            return f"Agrees with a render within noise: it differs {on_the_mean}"
        return f"Agrees with a render nearly: it differs {on_the_mean}"


def verify(
    picture: NDArray, one: NDArray, two: NDArray, side: int = SIDE, own: float = 0.0
) -> Verdict:
    """Compare a picture with two renders of it that have independent noise.

    Parameters
    ----------
    picture : (H, W, 3) float
        Scene-linear, premultiplied.
    one, two : (H, W, 3) float
        The renders, from different seeds.
    side : int
        Pixels along the side of a square.
    own : float
        The variance of the picture's own noise, relative to the variance of the mean of both
        renders. It depends on the capture's number of samples; a denoised picture has little.

    Returns
    -------
    Verdict
        Squares in which all three are dark count as alike.
    """
    truth = (one.astype(np.float64) + two) / 2
    half = (one.astype(np.float64) - two) / 2
    counts = _sums(np.ones(truth.shape[:2]), side)
    mean = _sums(truth, side) / counts[..., None]
    found = _sums(picture.astype(np.float64), side) / counts[..., None]
    # the variance of a pixel's mean is the square of half the difference; the variance of the mean
    # of a square is the sum of these over the squared number of pixels
    deviation = np.sqrt(_sums(half**2, side)) / counts[..., None]
    floor = 0.01 * truth.mean() + 1e-12
    relative = np.abs(found - mean) / (mean + floor)
    chance = CHANCE * np.sqrt(1 + own) * deviation / (mean + floor)
    # the estimate of a single square is uncertain, and the others have about the same noise
    chance = np.maximum(chance, np.median(chance, axis=(0, 1)))
    beyond = np.maximum(relative - chance, 0).max(axis=-1)
    h, w = truth.shape[:2]
    off = np.repeat(np.repeat(beyond, side, 0), side, 1)[:h, :w].astype(np.float32)
    # the mean absolute value of normal noise is sqrt(2 / pi) times its deviation
    noise = float((deviation / (mean + floor)).mean() * np.sqrt(2 / np.pi * (1 + own)))
    return Verdict(float(relative.mean()), noise, float((beyond > TELLING).mean()), off)


def _sums(image: NDArray, side: int) -> NDArray[np.float64]:
    """Sums over squares, (ceil(H / side), ceil(W / side), ...)."""
    rows = np.add.reduceat(image, np.arange(0, image.shape[0], side), axis=0)
    return np.add.reduceat(rows, np.arange(0, image.shape[1], side), axis=1)


def marked(picture: NDArray, verdict: Verdict) -> NDArray[np.float32]:
    """Draw where a picture is off: the picture darker and grey, with red over it.

    Parameters
    ----------
    picture : (H, W, 3) or (H, W, 4) float
        Scene-linear.
    verdict : Verdict

    Returns
    -------
    (H, W, 4) float32
        Opaque.
    """
    grey = picture[..., :3].mean(axis=-1, keepdims=True) * 0.4
    red = np.clip(verdict.off * 4, 0, 1)[..., None]
    out = grey * (1 - red) + red * np.array([1.0, 0.05, 0.02])
    return np.concatenate([out, np.ones_like(grey)], axis=-1).astype(np.float32)
