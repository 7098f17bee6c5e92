"""The target: how a shot should look, brought to the size of a small field.

Examples
--------
>>> picture = np.ones((4, 6, 3))
>>> smaller(picture, (2, 3), 2).shape
(2, 3, 3)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import TargetError

# A pixel's error counts relative to its light plus this share of the mean light of all.
DARK = 0.02


@dataclass(frozen=True)
class Target:
    """A picture to match, and how much each pixel counts.

    Parameters
    ----------
    picture : (n, 3) float64
        Scene-linear radiance.
    weights : (n,) float64
        0 where a pixel does not count; else how much of the picture it stands for.

    Raises
    ------
    TargetError
        No pixel counts, one that counts is infinite or not a number, or all of them are black.
    """

    picture: NDArray[np.float64]
    weights: NDArray[np.float64]

    def __post_init__(self) -> None:
        if not (self.weights > 0).any():
            raise TargetError(
                "no pixel is left to match: the mask is empty, or only the world is seen there; "
                "choose another mask"
            )
        if not np.isfinite(self.picture[self.weights > 0]).all():
            raise TargetError(
                "the target has pixels that are infinite or not a number: mask them out, or render "
                "it again"
            )

        if not (self.picture[self.weights > 0] > 0).any():
            raise TargetError(
                "the target is black where it is to be matched, which is no light: choose another "
                "target or mask"
            )

    @property
    def dark(self) -> float:
        """The light that is added where errors are taken relative to a pixel's light."""
        mean = np.average(np.maximum(self.picture, 0), axis=0, weights=self.weights)
        return DARK * max(float(mean.mean()), 1e-12)

    def scaled(self, gain: NDArray) -> Target:
        """Multiply the picture.

        Parameters
        ----------
        gain : (3,) float

        Returns
        -------
        Target
        """
        return Target(self.picture * gain, self.weights)


def between(target: NDArray[np.float64], shown: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the target's light, or the geometric mean with a picture that is brighter.

    Parameters
    ----------
    target, shown : (...) float64

    Returns
    -------
    (...) float64
    """
    asked = np.maximum(target, 0)
    return np.sqrt(asked * np.maximum(asked, shown))


def smaller(picture: NDArray, shape: tuple[int, int], factor: int) -> NDArray[np.float64]:
    """Average a picture over the pixels of a proxy.

    Parameters
    ----------
    picture : (H, W) or (H, W, C) float
    shape : tuple of int
        Height and width of the proxy.
    factor : int
        How many pixels a side one of the proxy covers.

    Returns
    -------
    (h, w) or (h, w, C) float64
    """
    height, width = shape
    rest = picture.shape[2:]

    def total(a: NDArray) -> NDArray[np.float64]:
        room = np.zeros((height * factor, width * factor, *a.shape[2:]))
        room[: a.shape[0], : a.shape[1]] = a
        return room.reshape(height, factor, width, factor, *a.shape[2:]).sum(axis=(1, 3))

    covers = total(np.ones(picture.shape[:2]))
    return total(picture) / covers.reshape(height, width, *(1 for _ in rest))


def fitting(picture: NDArray, shape: tuple[int, int]) -> NDArray[np.float64]:
    """Bring a picture to another size of the same proportions, bilinearly or by means.

    Parameters
    ----------
    picture : (h, w) or (h, w, C) float
    shape : tuple of int
        (H, W).

    Returns
    -------
    (H, W) or (H, W, C) float64

    Raises
    ------
    TargetError
        The proportions differ by more than a pixel of the smaller picture.
    """
    h, w = picture.shape[:2]
    height, width = shape
    if abs(w * height - width * h) > max(width, height, w, h):
        raise TargetError(
            f"the picture of {w} x {h} has other proportions than the shot, {width} x {height}: "
            "crop it to the shot's, or render it at the shot's size"
        )
    out = np.asarray(picture, np.float64)
    for axis, (had, asked) in enumerate(((h, height), (w, width))):
        out = np.moveaxis(_resized(np.moveaxis(out, axis, 0), had, asked), 0, axis)
    return out


def _resized(rows: NDArray[np.float64], had: int, asked: int) -> NDArray[np.float64]:
    """Rows (had, ...) -> (asked, ...): each the mean of what it covers, or between two."""
    if had == asked:
        return rows
    if had > asked:
        edges = np.linspace(0, had, asked + 1)
        sums = np.concatenate([np.zeros_like(rows[:1]), np.cumsum(rows, axis=0)])
        low = np.minimum(edges.astype(np.intp), had - 1)
        part = (edges - low).reshape(-1, *(1 for _ in rows.shape[1:]))
        at = sums[low] + part * rows[low]
        return np.diff(at, axis=0) * (asked / had)
    at = np.clip((np.arange(asked) + 0.5) * had / asked - 0.5, 0, had - 1)
    low = np.minimum(at.astype(np.intp), max(had - 2, 0))
    part = (at - low).reshape(-1, *(1 for _ in rows.shape[1:]))
    return (1 - part) * rows[low] + part * rows[np.minimum(low + 1, had - 1)]
