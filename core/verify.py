"""Whether a picture is what a few samples of the truth say, within their noise.

Two renders of other seeds are the truth with noise, and how they differ is how large that is.
Compared are means over squares of pixels: noise falls with a square's side, an error does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Pixels a side, and how many standard errors a difference may be by chance.
SIDE = 8
CHANCE = 3.0
# What is less off than this, of the light there, nobody sees.
TELLING = 0.02


@dataclass(frozen=True)
class Verdict:
    """error: mean relative difference of the picture from the truth over squares, noise included;
    noise: what of it noise alone would be; share: of all squares, how many differ by more than
    chance; off: (H, W), the relative difference beyond chance, pixel by pixel as its square."""

    error: float
    noise: float
    share: float
    off: NDArray[np.float32]

    @property
    def line(self) -> str:
        """In words."""
        if self.share < 0.01:
            return f"Agrees with a render within its noise ({self.noise:.1%})"
        return f"Differs by more than noise in {self.share:.0%} of the picture"


def verify(
    picture: NDArray, one: NDArray, two: NDArray, side: int = SIDE, own: float = 0.0
) -> Verdict:
    """Hold a picture (H, W, 3) against two renders of it with independent noise.

    own: variance of the picture's own noise, in units of that of the two's mean: its capture is of
    so many samples, and a denoiser leaves little of it. Scene-linear, premultiplied. What neither
    has light in counts as alike.
    """
    truth = (one.astype(np.float64) + two) / 2
    half = (one.astype(np.float64) - two) / 2
    counts = _sums(np.ones(truth.shape[:2]), side)
    mean = _sums(truth, side) / counts[..., None]
    found = _sums(picture.astype(np.float64), side) / counts[..., None]
    # of each pixel's mean the variance is the square of half the difference; of their mean in a
    # square the sum of those over their number squared
    deviation = np.sqrt(_sums(half**2, side)) / counts[..., None]
    floor = 0.01 * truth.mean() + 1e-12
    relative = np.abs(found - mean) / (mean + floor)
    chance = CHANCE * np.sqrt(1 + own) * deviation / (mean + floor)
    # a square's own estimate of its noise is unsure: those around have as much
    chance = np.maximum(chance, np.median(chance, axis=(0, 1)))
    beyond = np.maximum(relative - chance, 0).max(axis=-1)
    h, w = truth.shape[:2]
    off = np.repeat(np.repeat(beyond, side, 0), side, 1)[:h, :w].astype(np.float32)
    # of a normal noise the mean size is sqrt(2 / pi) of its deviation
    noise = float((deviation / (mean + floor)).mean() * np.sqrt(2 / np.pi))
    return Verdict(float(relative.mean()), noise, float((beyond > TELLING).mean()), off)


def _sums(image: NDArray, side: int) -> NDArray[np.float64]:
    """Sums over squares, (ceil(H / side), ceil(W / side), ...)."""
    rows = np.add.reduceat(image, np.arange(0, image.shape[0], side), axis=0)
    return np.add.reduceat(rows, np.arange(0, image.shape[1], side), axis=1)


def marked(picture: NDArray, verdict: Verdict) -> NDArray[np.float32]:
    """The picture (H, W, 3 or 4), darker, and red where it is off -> (H, W, 4)."""
    grey = picture[..., :3].mean(axis=-1, keepdims=True) * 0.4
    red = np.clip(verdict.off * 4, 0, 1)[..., None]
    out = grey * (1 - red) + red * np.array([1.0, 0.05, 0.02])
    return np.concatenate([out, np.ones_like(grey)], axis=-1).astype(np.float32)
