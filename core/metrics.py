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


def relative_squares(
    picture: NDArray, one: NDArray, two: NDArray, mask: NDArray | None = None
) -> NDArray:
    """(x - a)(x - b) / (ref + 1% of the mean of ref)^2, per pixel and channel.

    one, two: independent renders of the same picture, (H, W, 3); ref is their mean. Their noise
    has no part in the mean of this but through the weights (which may so be below 0 for a picture
    better than they are); it is relMSE -> (n, 3) float64 of the pixels inside the mask.
    """
    if mask is None:
        mask = np.ones(picture.shape[:2], bool)
    x, a, b = (p[mask].astype(np.float64) for p in (picture, one, two))
    ref = (a + b) / 2
    return (x - a) * (x - b) / np.square(ref + 0.01 * ref.mean())


def trimmed_mean(values: NDArray, share: float = 1e-3) -> float:
    """The mean without the largest `share` of the values."""
    ordered = np.sort(values, axis=None)
    return float(ordered[: max(1, ordered.size - round(share * ordered.size))].mean())
