"""Components: what a field shows in any light, as a few numbers for each pixel.

Without its lobes a field answers light smoothly. The light of a patch is then a plane over the
patch: three numbers, its level and its slopes. So a pixel is a row of three numbers for each patch
and channel. All rows of a shot are about sums of a few rows, the components.

The components are found from pictures in some lights: those that the page shows, at turns all
around, and soft lamps from everywhere. Pictures can be denoised, which rows cannot. They are
divided by what the pixel shows in white light, channel by channel, and so have no texture.

Examples
--------
>>> rng = np.random.default_rng(1)
>>> rows = (rng.random((50, 2)) @ rng.random((2, 30))).reshape(50, 10, 3)
>>> lights = rng.random((10, 3, 8))
>>> shown = np.einsum("pfc,fcs->pcs", rows, lights)
>>> axes = axes_of(shown, np.ones(50), 2)
>>> numbers = numbers_of(shown, axes)
>>> numbers.shape
(50, 2)
>>> again = np.einsum("pr,csr->pcs", numbers, given_by(shown, numbers, np.ones(50)))
>>> bool(np.allclose(again, shown, atol=1e-3))
True
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# What is smaller than this beside the largest component is rounding.
_ROUNDING = 1e-9
# By how much the answers to light are held small, as a share of what the numbers tell.
_HELD = 1e-6


def axes_of(shown: NDArray, weight: NDArray, count: int) -> NDArray[np.float32]:
    """Find the components of what pixels show.

    Parameters
    ----------
    shown : (n, 3, S) float
        What each pixel shows in each light, divided by its white.
    weight : (n,) float
        How much each pixel counts.
    count : int
        The most components, R.

    Returns
    -------
    (3, S, R) float32
        The numbers of a pixel are the sums of what it shows times these. They are relative to its
        white: a change by 0.01 changes the pixel by 0.01 of it, in the mean over the lights.
    """
    flat = (shown * weight[:, None, None]).reshape(len(shown), -1)
    values, vectors = np.linalg.eigh(flat.T.astype(np.float64) @ flat)
    order = np.argsort(values)[::-1][:count]
    order = order[values[order] > _ROUNDING * max(float(values.max()), 1e-30)]
    axes = vectors[:, order] / np.sqrt(len(vectors))
    # of either sign, the one that shows light
    axes *= np.where(axes.sum(axis=0) < 0, -1, 1)
    return np.asarray(axes.reshape(3, shown.shape[2], -1), np.float32)


def numbers_of(shown: NDArray, axes: NDArray) -> NDArray[np.float32]:
    """Compute the numbers of pixels.

    Parameters
    ----------
    shown : (n, 3, S) float
    axes : (3, S, R) float

    Returns
    -------
    (n, R) float32
    """
    return (shown.reshape(len(shown), -1) @ axes.reshape(-1, axes.shape[2])).astype(np.float32)


class Answers:
    """What light gives each component, by least squares over the pixels of a field.

    Parameters
    ----------
    patches : int
        K.
    numbers : (n, R) float
        Of all pixels.
    weight : (n,) float
        How much each pixel counts.
    """

    def __init__(self, patches: int, numbers: NDArray, weight: NDArray) -> None:
        self._by = (numbers * np.square(weight)[:, None]).astype(np.float32)
        self._square = (self._by.T @ numbers).astype(np.float64)
        self._sums = np.zeros((patches, 3, 3, numbers.shape[1]))

    def add(self, k: int, pixels: NDArray[np.intp], values: NDArray) -> None:
        """Add what some pixels make of the light of a patch.

        Parameters
        ----------
        k : int
        pixels : (m,) int
            Each another one.
        values : (m, 3, 3) float
            By level and slopes, and by channel; over the white of the pixel.
        """
        found = values.reshape(len(values), 9).astype(np.float32).T @ self._by[pixels]
        self._sums[k] += found.reshape(3, 3, -1)

    def add_levels(self, pixels: slice | NDArray, values: NDArray, share: NDArray) -> None:
        """Add what pixels make of the mean light of many patches.

        Parameters
        ----------
        pixels : (m,) int
        values : (m, 3) float
            Over the white of the pixel.
        share : (K, m) float
            Which share of it each patch has.
        """
        for c in range(3):
            self._sums[:, 0, c] += share @ (values[:, c, None] * self._by[pixels])

    def solved(self, lights: NDArray, given: NDArray) -> NDArray[np.float64]:
        """Give what light gives each component.

        Parameters
        ----------
        lights : (3 K, 3, S) float
            Light for which it is known.
        given : (3, S, R) float
            What it gives.

        Returns
        -------
        (3 K, 3, R) float64
            The least change of what the pixels say that gives what is known.
        """
        square = self._square
        square = square + _HELD * np.trace(square) / max(len(square), 1) * np.eye(len(square))
        flat = self._sums.reshape(-1, square.shape[0])
        out = np.linalg.solve(square, flat.T).T.reshape(-1, 3, square.shape[0])
        for c in range(3):
            of = lights[:, c].astype(np.float64)
            inner = of.T @ of
            inner += 1e-3 * np.trace(inner) / len(inner) * np.eye(len(inner))
            out[:, c] += of @ np.linalg.solve(inner, given[c] - of.T @ out[:, c])
        return out


def given_by(shown: NDArray, numbers: NDArray, weight: NDArray) -> NDArray[np.float64]:
    """Find what the lights of some pictures give each component, by least squares.

    Parameters
    ----------
    shown : (n, 3, S) float
        Over the white of the pixels.
    numbers : (n, R) float
    weight : (n,) float

    Returns
    -------
    (3, S, R) float64
    """
    by = numbers * np.square(weight)[:, None]
    square = (by.T @ numbers).astype(np.float64)
    square += _HELD * np.trace(square) / max(len(square), 1) * np.eye(len(square))
    found = np.linalg.solve(square, (by.T @ shown.reshape(len(shown), -1)).astype(np.float64))
    return found.T.reshape(3, shown.shape[2], -1)
