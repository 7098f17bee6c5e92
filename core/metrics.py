"""Errors between a picture and its reference."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def relative_error(picture: NDArray, reference: NDArray, mask: NDArray | None = None) -> NDArray:
    """|x - ref| / (ref + 1% of the mean of ref), per pixel and channel.

    picture, reference: (H, W, 3) scene-linear; mask: (H, W) bool, the pixels that the mean is
    taken over and that count -> (n, 3) float64 of the pixels inside the mask.
    """
    if mask is None:
        mask = np.ones(reference.shape[:2], bool)
    ref = reference[mask].astype(np.float64)
    return np.abs(picture[mask] - ref) / (ref + 0.01 * ref.mean())


def mean_relative_error(picture: NDArray, reference: NDArray, mask: NDArray | None = None) -> float:
    """The mean of `relative_error`: the one figure that this project quotes first."""
    return float(relative_error(picture, reference, mask).mean())
