"""Errors between a picture and its reference.

Examples
--------
>>> reference = np.full((2, 2, 3), 0.5)
>>> round(mean_relative_error(1.1 * reference, reference), 3)
0.099
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def relative_error(picture: NDArray, reference: NDArray, mask: NDArray | None = None) -> NDArray:
    """Compute the relative error |x - ref| / (ref + 0.01 mean(ref)) of each pixel and channel.

    Parameters
    ----------
    picture, reference : (H, W, 3) float
        Scene-linear radiance.
    mask : (H, W) bool, optional
        The pixels that count, in the result and in the mean of the reference.

    Returns
    -------
    (n, 3) float64
        The errors of the n pixels inside the mask.
    """
    if mask is None:
        mask = np.ones(reference.shape[:2], bool)
    ref = reference[mask].astype(np.float64)
    return np.abs(picture[mask] - ref) / (ref + 0.01 * ref.mean())


def mean_relative_error(picture: NDArray, reference: NDArray, mask: NDArray | None = None) -> float:
    """Compute the mean of `relative_error`, the figure that this project quotes first.

    Parameters
    ----------
    picture, reference : (H, W, 3) float
        Scene-linear radiance.
    mask : (H, W) bool, optional
        The pixels that count.

    Returns
    -------
    float
    """
    return float(relative_error(picture, reference, mask).mean())


def relative_squares(
    picture: NDArray, one: NDArray, two: NDArray, mask: NDArray | None = None
) -> NDArray:
    """Compute (x - a)(x - b) / (ref + 0.01 mean(ref))^2 of each pixel and channel, with two
    references.

    The mean of the result is relMSE without the noise of the references: their noise is
    independent, so it cancels in the product, except for its part in the weights. For a picture
    that is better than the references the mean can therefore be slightly below 0.

    Parameters
    ----------
    picture : (H, W, 3) float
        x, scene-linear radiance.
    one, two : (H, W, 3) float
        a and b, renders of the same picture with independent noise. ref is their mean.
    mask : (H, W) bool, optional
        The pixels that count.

    Returns
    -------
    (n, 3) float64
        The values of the n pixels inside the mask.
    """
    if mask is None:
        mask = np.ones(picture.shape[:2], bool)
    x, a, b = (p[mask].astype(np.float64) for p in (picture, one, two))
    ref = (a + b) / 2
    return (x - a) * (x - b) / np.square(ref + 0.01 * ref.mean())


def trimmed_mean(values: NDArray, share: float = 1e-3) -> float:
    """Compute the mean without the largest values.

    Parameters
    ----------
    values : array of float
    share : float
        The share of the values that is left out.

    Returns
    -------
    float
    """
    ordered = np.sort(values, axis=None)
    return float(ordered[: max(1, ordered.size - round(share * ordered.size))].mean())
