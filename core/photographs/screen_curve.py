"""The curve of a monitor: how much light a value shows, by photographs of grey steps (paper 4.2).

A monitor shows the value x, 0 to 1, at some light. Black is not dark, and the curve is no line.
What is lit by a pattern is the difference to what is lit by black, so the curve here runs from 0 at
black to 1 at white. Monitors are also darker from the side: the light at an angle is taken for a
power of its cosine.

Examples
--------
>>> steps = np.linspace(0, 1, 17)
>>> shown = (0.01 + steps**2.2)[:, None] * np.ones(3)  # black is a hundredth of white
>>> curve = measured_curve(steps, shown)
>>> [round(float(x), 3) for x in value_of(curve, np.array([[0.5], [0.25], [1.0]]))[:, 0]]
[0.73, 0.533, 1.0]
>>> angles = np.array([0.0, 20.0, 40.0, 60.0])
>>> round(falls_of(angles, 80 * np.cos(np.radians(angles)) ** 1.5), 3)
1.5
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import PhotographsError

# Values at which a measured curve is kept: those of 8 bits.
VALUES = 256
# The curve is interpolated in this root of the light, where those of monitors are nearly lines.
ROOT = 2.2


def measured_curve(steps: NDArray, lights: NDArray) -> NDArray[np.float64]:
    """Find the curve of a monitor from what some greys shine.

    Parameters
    ----------
    steps : (n,) float
        The values that were shown, 0 to 1. Black and white must be among them.
    lights : (n, 3) float
        The light of each, scene-linear, in any unit.

    Returns
    -------
    (3, 256) float64
        For each channel the light at evenly spaced values. It rises from 0 to 1.

    Raises
    ------
    PhotographsError
        Black or white is missing, or white is no brighter than black.
    """
    steps, lights = np.asarray(steps, np.float64), np.asarray(lights, np.float64)
    places, of = np.unique(steps, return_inverse=True)
    if len(places) < 2 or places[0] > 1e-6 or places[-1] < 1 - 1e-6:
        raise PhotographsError(
            "the grey steps lack black or white: photograph the monitor at 0 and at 1 as well"
        )
    out = np.empty((3, VALUES))
    for c in range(3):
        mean = np.bincount(of, lights[:, c]) / np.bincount(of)
        rising = _rising(mean)
        span = rising[-1] - rising[0]
        if not (np.isfinite(span) and span > 0):
            raise PhotographsError(
                "white is no brighter than black in the photographs of grey steps: look whether "
                "they are in order"
            )
        roots = ((rising - rising[0]) / span) ** (1 / ROOT)
        out[c] = _monotone(places, roots, np.linspace(0, 1, VALUES)) ** ROOT
    return out


def light_of(curve: NDArray, values: NDArray) -> NDArray[np.float64]:
    """Say how much light values show.

    Parameters
    ----------
    curve : (3, n) float
        See `measured_curve`.
    values : (..., 3) or (..., 1) float
        0 to 1.

    Returns
    -------
    (..., 3) float64
        0 to 1, in each channel.
    """
    at = np.linspace(0, 1, curve.shape[1])
    values = np.broadcast_to(values, (*np.shape(values)[:-1], 3))
    return np.stack([np.interp(values[..., c], at, curve[c]) for c in range(3)], axis=-1)


def value_of(curve: NDArray, lights: NDArray) -> NDArray[np.float64]:
    """Say which values show some light.

    Parameters
    ----------
    curve : (3, n) float
        See `measured_curve`.
    lights : (..., 3) or (..., 1) float
        0 to 1, in each channel.

    Returns
    -------
    (..., 3) float64
        0 to 1.
    """
    at = np.linspace(0, 1, curve.shape[1])
    lights = np.broadcast_to(lights, (*np.shape(lights)[:-1], 3))
    out = np.empty(lights.shape)
    for c in range(3):
        # where the curve is flat, the last value is the one that leads on
        rising = curve[c] + 1e-12 * at
        out[..., c] = np.interp(lights[..., c], rising, at)
    return out


def assumed_curve(power: float = ROOT) -> NDArray[np.float64]:
    """Make the curve of a monitor that nobody measured: a power of the value.

    Parameters
    ----------
    power : float

    Returns
    -------
    (3, 256) float64
    """
    return np.tile(np.linspace(0, 1, VALUES) ** power, (3, 1))


def falls_of(degrees: NDArray, lights: NDArray) -> float:
    """Find how a monitor's light falls off with the angle.

    Parameters
    ----------
    degrees : (n,) float
        Between the camera and the line straight ahead of the screen, below 90.
    lights : (n,) float
        The light of white at these angles, in any unit.

    Returns
    -------
    float
        The power of the cosine, by least squares of the logarithms; 0 where the light does not
        fall.

    Raises
    ------
    PhotographsError
        There are fewer than two angles, one is not below 90 degrees, or a light is not above 0.
    """
    degrees, lights = np.asarray(degrees, np.float64), np.asarray(lights, np.float64)
    if len(np.unique(degrees)) < 2:
        raise PhotographsError("the fall-off with the angle needs photographs at two angles")
    if not (np.abs(degrees) < 89).all() or not (lights > 0).all():
        raise PhotographsError(
            "the fall-off with the angle needs angles below 89 degrees, and light at each"
        )
    cosines, logs = np.log(np.cos(np.radians(degrees))), np.log(lights)
    cosines, logs = cosines - cosines.mean(), logs - logs.mean()
    return max(0.0, float((cosines @ logs) / (cosines @ cosines)))


def _rising(values: NDArray) -> NDArray[np.float64]:
    """The nearest values by least squares that never fall: equal neighbours are pooled."""
    means: list[float] = []
    counts: list[int] = []
    for value in values.tolist():
        means.append(value)
        counts.append(1)
        while len(means) > 1 and means[-2] > means[-1]:
            value, count = means.pop(), counts.pop()
            total = means[-1] * counts[-1] + value * count
            counts[-1] += count
            means[-1] = total / counts[-1]
    return np.repeat(means, counts)


def _monotone(x: NDArray, y: NDArray, at: NDArray) -> Any:
    """A cubic through rising points that rises everywhere (Fritsch and Carlson 1980)."""
    h, slopes = np.diff(x), np.diff(y) / np.diff(x)
    d = np.empty_like(y)
    d[[0, -1]] = slopes[[0, -1]]
    if len(x) > 2:
        one, two = slopes[:-1], slopes[1:]
        a, b = 2 * h[1:] + h[:-1], h[1:] + 2 * h[:-1]
        with np.errstate(divide="ignore", invalid="ignore"):
            mean = (a + b) / (a / one + b / two)
        d[1:-1] = np.where(one * two > 0, mean, 0)
    i = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(h) - 1)
    t, step = (at - x[i]) / h[i], h[i]
    up = y[i] * (1 + 2 * t) * (1 - t) ** 2 + step * d[i] * t * (1 - t) ** 2
    return up + y[i + 1] * t * t * (3 - 2 * t) + step * d[i + 1] * t * t * (t - 1)
