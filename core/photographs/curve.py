"""The camera's curve from pictures of several exposures, and the light that they show together.

A pixel's value z is f(E t), of the light E and the exposure t. The curve g = ln f^-1 is found by
least squares over pixels whose exposures are known, as Debevec and Malik do. Exposures that are far
apart tell nothing of g between them but by its smoothness. So it is g against the logarithm of
sRGB's curve that is smooth here: there every power of light is a straight line.

Examples
--------
>>> light = np.geomspace(0.004, 0.9, 60)[:, None, None] * np.ones(3)
>>> times = np.array([1.0, 0.25])
>>> values = np.clip(light * times[:, None], 0, 1) ** (1 / 2.2)
>>> found = find(values, times, 255)
>>> near = found.light(np.array([[0.5, 0.5, 0.5]]))[0] / 0.5**2.2
>>> bool(np.abs(near - 1).max() < 0.02)
True
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import PhotographsError

# The curve is told at so many values from 0 to 1, and straight in between.
KNOTS = 256
# How much smoothness counts beside the pixels: the most with which the pixels are explained as well
# as with the least, but for this share. And the values that count, of black and of white.
SMOOTH, AS_WELL = (1e4, 1e3, 1e2, 1e1, 1.0), 1.03
# So many times the pixels are weighed anew by how far they are off.
STEPS = 1
# By how much worse one curve must explain three channels than a curve of each does.
OTHERWISE = 1.3
DARKEST, BRIGHTEST = 0.012, 0.985
# In a picture without a curve the sensor ends at white.
FULL = 0.995


@dataclass(frozen=True)
class Curve:
    """What light a pixel's value stands for.

    Parameters
    ----------
    table : (3, n) float64 or None
        Light of each channel at evenly spaced values from 0 to 1; 1 at 1. None where values are
        light.
    """

    table: NDArray[np.float64] | None

    def light(self, values: NDArray) -> NDArray[np.float32]:
        """Turn values of pixels into light.

        Parameters
        ----------
        values : (..., 3) float
            From 0 to 1.

        Returns
        -------
        (..., 3) float32
            Scene-linear, times the exposure.
        """
        if self.table is None:
            return np.asarray(values, np.float32)
        out = np.empty(np.shape(values), np.float32)
        at = np.linspace(0, 1, self.table.shape[1])
        for c in range(3):
            out[..., c] = np.interp(values[..., c], at, self.table[c])
        return out


def srgb() -> Curve:
    """Give the curve of sRGB, which pictures have that say nothing else.

    Returns
    -------
    Curve
    """
    z = np.linspace(0, 1, 1024)
    return Curve(np.tile(_srgb(z), (3, 1)))


def of_rows(rows: Any) -> Curve:
    """Make a curve of what a description says.

    Parameters
    ----------
    rows : 3 rows of n float

    Returns
    -------
    Curve
    """
    table = np.array(rows, np.float64)
    return Curve(table / table[:, -1:])


def _srgb(z: NDArray) -> NDArray[np.float64]:
    return np.where(z <= 0.04045, z / 12.92, ((z + 0.055) / 1.055) ** 2.4)


def find(values: NDArray, times: NDArray, levels: int) -> Curve:
    """Find a curve from pixels that were photographed with several exposures.

    Parameters
    ----------
    values : (n, E, 3) float
        From 0 to 1.
    times : (E,) float
        The exposures, in any unit.
    levels : int
        The steps of a value from black to white.

    Returns
    -------
    Curve

    Raises
    ------
    PhotographsError
        No pixel is between black and white in two of the exposures.

    Source
    ------
    P. Debevec and J. Malik, Recovering High Dynamic Range Radiance Maps from Photographs, 1997,
    equation 3.
    """
    z = np.asarray(values, np.float64)
    logs = np.log(np.asarray(times, np.float64))
    # a camera balances its channels before the curve, which is then one
    table, left = _solved(np.concatenate([z[..., c] for c in range(3)]), logs, levels)
    each = [_some_solved(z[..., c], logs, levels) for c in range(3)]
    told = [(t, there) for t, there in each if t is not None]
    if len(told) == 3 and left > OTHERWISE * float(np.mean([there for _, there in told])):
        return Curve(np.stack([t for t, _ in told]))
    return Curve(np.tile(table, (3, 1)))


def _some_solved(
    z: NDArray, logs: NDArray, levels: int
) -> tuple[NDArray[np.float64] | None, float]:
    """The curve of a channel, or None where it tells none."""
    try:
        return _solved(z, logs, levels)
    except PhotographsError:
        return None, 0.0


def _solved(z: NDArray, logs: NDArray, levels: int) -> tuple[NDArray[np.float64], float]:
    """The curve that some pixels tell, (KNOTS,), and what it leaves unexplained: an error of
    logarithms.

    z: (n, E).
    """
    use = (z >= DARKEST) & (z <= BRIGHTEST)
    spread = np.where(use, logs, -np.inf).max(1) - np.where(use, logs, np.inf).min(1)
    some = (use.sum(axis=1) >= 2) & (spread > 1e-3)
    if not some.any():
        raise PhotographsError(
            "the camera's curve cannot be found: no pixel is between black and white in two "
            "exposures. Say the curve in photographs.json ('linear', 'sRGB'), or photograph with "
            "exposures that are closer"
        )
    z, use = z[some], use[some]
    x = np.linspace(0, 1, KNOTS)
    s = np.log(np.maximum(_srgb(np.maximum(x, 0.5 / max(levels, 255))), 1e-6))
    place = np.clip(z, 0, 1) * (KNOTS - 1)
    low = np.minimum(place.astype(np.intp), KNOTS - 2)
    part = place - low
    weight = np.where(use, np.minimum(z, 1.2 * (1 - z)) ** 2, 0.0)
    hats = np.zeros((z.size, KNOTS))
    rows = np.arange(z.size)
    hats[rows, low.ravel()] = (1 - part).ravel()
    hats[rows, low.ravel() + 1] += part.ravel()
    # second differences against s, by distances that differ: a power of light has none
    step = np.maximum(np.diff(s), 1e-9)
    bend = np.zeros((KNOTS - 2, KNOTS))
    at = np.arange(KNOTS - 2)
    bend[at, at] = 1 / step[:-1]
    bend[at, at + 1] = -1 / step[:-1] - 1 / step[1:]
    bend[at, at + 2] = 1 / step[1:]
    bend *= np.sqrt(np.minimum(step[:-1], step[1:]))[:, None]
    smooth = bend.T @ bend / KNOTS
    found, left = _smoothest(hats, weight, logs, smooth)
    for _ in range(STEPS):
        off = (hats @ found).reshape(z.shape) - logs
        total = np.maximum(weight.sum(axis=1, keepdims=True), 1e-12)
        off -= (weight * off).sum(axis=1, keepdims=True) / total
        usual = max(float(np.median(np.abs(off[weight > 0]))), 0.5 / max(levels, 255))
        # what moved, or lies across an edge, is far off and does not count
        weight = weight / (1 + (off / (4 * usual)) ** 2)
        found, left = _smoothest(hats, weight, logs, smooth)
    light = np.exp(np.maximum.accumulate(found - found[-1]))
    light[0] = 0.0  # black is no light
    return np.maximum.accumulate(light), left


def _smoothest(
    hats: NDArray, weight: NDArray, logs: NDArray, smooth: NDArray
) -> tuple[NDArray[np.float64], float]:
    """The smoothest curve that explains the pixels nearly as well as any, and its error."""
    w = weight.ravel()
    n, exposures = weight.shape
    total = np.maximum(weight.sum(axis=1), 1e-12)
    matrix = hats.T @ (w[:, None] * hats)
    asked = hats.T @ (w * np.tile(logs, n))
    # each pixel's own light is eliminated
    each = (w[:, None] * hats).reshape(n, exposures, KNOTS).sum(axis=1)
    matrix -= each.T @ (each / total[:, None])
    asked -= each.T @ ((weight @ logs) / total)
    # the curve is 0 at white; nothing else tells the exposure from the light
    matrix[-1, -1] += 1e3 * w.sum()
    found = [np.linalg.solve(matrix + much * w.sum() * smooth, asked) for much in SMOOTH]
    square = float(w @ np.tile(logs, n) ** 2 - ((weight @ logs) ** 2 / total).sum())
    left = np.array([square - 2 * asked @ g + g @ matrix @ g for g in found])
    left = np.sqrt(np.maximum(left, 0) / w.sum())
    best = int(np.argmax(left <= AS_WELL * left.min() + 1e-6))
    return found[best], float(left[best])


def merged(
    values: NDArray, times: NDArray, curve: Curve
) -> tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.bool_]]:
    """Put exposures together as the light of each pixel.

    Long exposures count more, because their noise is less. Saturated and dark values do not count,
    unless a pixel has no others.

    Parameters
    ----------
    values : (E, ..., 3) float
        From 0 to 1.
    times : (E,) float
    curve : Curve

    Returns
    -------
    light : (..., 3) float32
        Scene-linear, for an exposure of 1.
    saturated : (...) bool
        Where a channel is too bright for every exposure: the light is more than this.
    dark : (...) bool
        Where a channel is too dark for every exposure.
    """
    linear = curve.table is None
    brightest = FULL if linear else BRIGHTEST
    total = np.zeros(values.shape[1:], np.float64)
    weights = np.zeros(values.shape[1:], np.float64)
    for z, t in zip(values, times, strict=True):
        inside = (z < brightest) & (z > DARKEST if not linear else z > 1e-4)
        # near white and near black a curve is least sure
        near = np.minimum(np.minimum(z, brightest - z) * 10, 1) if not linear else 1.0
        weight = np.where(inside, t * np.maximum(near, 0.02), 0.0)
        total += weight * curve.light(z) / t
        weights += weight
    order = np.argsort(times)
    short, long = values[order[0]], values[order[-1]]
    out = np.divide(total, weights, out=np.zeros_like(total), where=weights > 0)
    none = weights == 0
    bright = none & (short >= brightest)
    out = np.where(bright, curve.light(short) / times[order[0]], out)
    faint = none & ~bright
    out = np.where(faint, curve.light(long) / times[order[-1]], out)
    return out.astype(np.float32), bright.any(axis=-1), faint.any(axis=-1)
