"""The measure of light on a patch: solid angle, not area.

A patch's coordinates u, v are linear on its face, and patterns are polynomials of u and v. Equal
areas of a face have different solid angles: at (x, y) on the face [-1, 1]^2 at distance 1, the
density of solid angle is (1 + x^2 + y^2)^(-3/2). So the moments of a transport that sees its whole
patch evenly have their mean off the patch's middle, by up to 0.074 of a patch that is a quarter of
its face. For the same reason a box must be fitted with this density (docs/identifiability.md).

Examples
--------
>>> quarter = (0.0, 1.0, 0.0, 1.0)
>>> [round(float(m), 3) for m in uniform_moments(quarter)]
[1.0, 0.426, 0.258, 0.426, 0.258, 0.184]
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

# x0, x1, y0, y1 of a patch on its face, see `Hemicube.extents`.
Extent = tuple[float, float, float, float]

# The relative error of averages. A fitted box is then off by less than 1e-5 of a patch.
ACCURACY = 1e-7
# The accuracy of boxes in patch widths. A field keeps them in sixteen bits, which is coarser.
CLOSE = 2e-6
# The most steps for a box. A box that has such moments is found in 3 to 14.
STEPS = 24
# Boxes worked on at a time, so that their quadrature fits the cache.
BLOCK = 2048


@lru_cache(maxsize=64)
def _nodes(low: float, high: float, accuracy: float) -> tuple[NDArray, NDArray]:
    """Gauss-Legendre places in [-1, 1] and weights of sum 1, good to `accuracy` from `low` to
    `high`.

    The density's poles nearest to the real axis are at a distance of 1 from the face's middle line.
    The ellipse through them determines how fast the quadrature converges.
    """
    half = (high - low) / 2
    ellipse = 1 / half + math.hypot(1, 1 / half)
    count = max(2, math.ceil(-math.log(accuracy) / (2 * math.log(ellipse))))
    places, weights = np.polynomial.legendre.leggauss(count)
    return places, weights / 2


def _local(boxes: NDArray, extent: Extent, accuracy: float) -> tuple[NDArray, ...]:
    """Averages of s, s^2, t, t^2 and st by solid angle over boxes (n, 4) -> five arrays (n,).

    s and t run from -1 to 1 over each box, so that nothing cancels in a narrow box.
    """
    x0, x1, y0, y1 = extent
    u0, u1, v0, v1 = boxes.T
    s, ws = _nodes(x0, x1, accuracy)
    t, wt = _nodes(y0, y1, accuracy)
    x = x0 + (x1 - x0) / 2 * (u0 + u1 + (u1 - u0) * s[:, None])
    y = y0 + (y1 - y0) / 2 * (v0 + v1 + (v1 - v0) * t[:, None])
    density = (1 + x * x)[:, None] + y * y  # (s, t, n)
    density *= np.sqrt(density)
    np.reciprocal(density, out=density)
    along_s = wt @ density
    along_t = (ws @ density.reshape(len(s), -1)).reshape(len(t), -1)
    total = ws @ along_s
    both = (ws * s) @ ((wt * t) @ density)
    return (
        (ws * s) @ along_s / total,
        (ws * s * s) @ along_s / total,
        (wt * t) @ along_t / total,
        (wt * t * t) @ along_t / total,
        both / total,
    )


def box_averages(boxes: NDArray, extent: Extent, accuracy: float = ACCURACY) -> NDArray[np.float64]:
    """Average the six monomials by solid angle over boxes of a patch.

    Parameters
    ----------
    boxes : (..., 4) float
        u0, u1, v0, v1 in patch coordinates.
    extent : tuple of 4 float
        The place of the patch on its face, see `Hemicube.extents`.
    accuracy : float
        The relative error that is allowed.

    Returns
    -------
    (6, ...) float64
        In the order of `patterns.MONOMIALS`.
    """
    flat = np.asarray(boxes, np.float64).reshape(-1, 4)
    out = np.empty((6, len(flat)))
    for start in range(0, len(flat), BLOCK):
        block = flat[start : start + BLOCK]
        s, ss, t, tt, st = _local(block, extent, accuracy)
        u0, u1, v0, v1 = block.T
        u, a, v, b = (u0 + u1) / 2, (u1 - u0) / 2, (v0 + v1) / 2, (v1 - v0) / 2
        out[:, start : start + BLOCK] = (
            np.ones_like(u),
            u + a * s,
            u * u + 2 * u * a * s + a * a * ss,
            v + b * t,
            v * v + 2 * v * b * t + b * b * tt,
            u * v + u * b * t + v * a * s + a * b * st,
        )
    return out.reshape(6, *np.shape(boxes)[:-1])


@lru_cache(maxsize=4096)
def uniform_moments(extent: Extent) -> NDArray[np.float64]:
    """Compute the moments of a transport that sees its whole patch evenly by solid angle.

    Parameters
    ----------
    extent : tuple of 4 float
        The place of the patch on its face.

    Returns
    -------
    (6,) float64
        Moments over the zeroth, to 1e-12; read-only.
    """
    out = box_averages(np.array([0.0, 1.0, 0.0, 1.0]), extent, 1e-13)
    out.flags.writeable = False
    return out


def box_of(
    mean: tuple[NDArray, NDArray], variance: tuple[NDArray, NDArray], extent: Extent
) -> NDArray[np.float64]:
    """Find the boxes, uniform by solid angle, that have some means and variances.

    Where the density is constant, the half width of a box is the root of three variances. The
    deviation from that is measured in the box that was found, and corrects the next one. A spread
    wider than any box on the patch can have (light from both rims) gives the whole patch.

    Parameters
    ----------
    mean : pair of (n,) float
        Along u and along v, in patch coordinates.
    variance : pair of (n,) float
        Along u and along v.
    extent : tuple of 4 float
        The place of the patch on its face.

    Returns
    -------
    (n, 4) float64
        u0, u1, v0, v1.
    """
    n = len(mean[0])
    places = np.stack([*mean, *variance])
    spread = np.sqrt(3 * places[2:])
    boxes = np.stack(
        [
            places[0] - spread[0],
            places[0] + spread[0],
            places[1] - spread[1],
            places[1] + spread[1],
        ],
        axis=-1,
    )
    np.clip(boxes, 0, 1, out=boxes)
    for start in range(0, n, BLOCK):
        moving = np.arange(start, min(start + BLOCK, n))
        for _ in range(STEPS):
            now = boxes[moving]
            then = _corrected(now, places[:, moving], extent)
            boxes[moving] = then
            moving = moving[np.abs(then - now).max(axis=-1) > CLOSE]
            if not len(moving):
                break
    return boxes


def _corrected(boxes: NDArray, places: NDArray, extent: Extent) -> NDArray:
    """Boxes (n, 4) of some means and variances (4, n), for the density inside `boxes`."""
    s, ss, t, tt, _ = _local(boxes, extent, ACCURACY)
    edges = []
    for axis, (first, second) in enumerate(((s, ss), (t, tt))):
        half = (boxes[:, 2 * axis + 1] - boxes[:, 2 * axis]) / 2
        centre = places[axis] - half * first
        spread = np.sqrt(places[2 + axis] / (second - first * first))
        edges += [centre - spread, centre + spread]
    return np.clip(np.stack(edges, axis=-1), 0, 1)
