"""The measure of light on a patch: solid angle, and not area.

Light paths come from directions, so a pixel that sees all of a patch alike sees its middle more
often than its rims: a piece of a face at (x, y), where the face is [-1, 1]^2 at distance 1, is seen
under (1 + x^2 + y^2)^(-3/2) of its area. What a patch's uniform transport looks like, and which box
has given moments, are therefore questions of where on its face the patch is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .patterns import monomials

# Points along each axis: of a whole patch once, to 1e-10; of a box for every pixel, to 1e-5.
_MANY, _FEW = 32, 5
_STEPS = 5


def density(x: NDArray, y: NDArray) -> NDArray:
    """Solid angle per area at points of a face."""
    return (1 + x * x + y * y) ** -1.5


def uniform_moments(extent: NDArray | None) -> NDArray[np.float64]:
    """(6,): the normalised moments of a transport uniform over a patch.

    extent: x0, x1, y0, y1 of the patch on its face, for uniform in solid angle; None: in area.
    """
    nodes, weights = np.polynomial.legendre.leggauss(_MANY)
    t, w = (nodes + 1) / 2, weights / 2
    u, v = np.meshgrid(t, t)
    weight = np.outer(w, w)
    if extent is not None:
        x0, x1, y0, y1 = extent
        weight = weight * density(x0 + (x1 - x0) * u, y0 + (y1 - y0) * v)
    found = (monomials(u, v) * weight).sum(axis=(1, 2))
    return found / found[0]


def box_of(
    mean: tuple[NDArray, NDArray], variance: tuple[NDArray, NDArray], extent: NDArray | None
) -> NDArray[np.float64]:
    """The boxes (n, 4), u0, u1, v0, v1, whose uniform transport has these means and variances.

    In area that is closed, mean +- sqrt(3 variance). In solid angle the box is moved and widened
    until its own moments are the given ones; both together, for the density knows both axes. What
    is spread wider than any box on the patch is cut at its rims.
    """
    centre = [m.astype(np.float64) for m in mean]
    half = [np.sqrt(3 * v.astype(np.float64)) for v in variance]
    if extent is not None:
        nodes, weights = np.polynomial.legendre.leggauss(_FEW)
        x0, x1, y0, y1 = extent
        for _ in range(_STEPS):
            places = [c[:, None] + h[:, None] * nodes for c, h in zip(centre, half, strict=True)]
            x = x0 + (x1 - x0) * places[0]
            y = y0 + (y1 - y0) * places[1]
            weight = density(x[:, :, None], y[:, None, :]) * weights[:, None] * weights
            total = weight.sum(axis=(1, 2))
            for axis in (0, 1):
                along = weight.sum(axis=2 - axis) / total[:, None]
                found = (along * places[axis]).sum(axis=1)
                spread = (along * (places[axis] - found[:, None]) ** 2).sum(axis=1)
                centre[axis] = centre[axis] + (mean[axis] - found)
                wider = np.divide(
                    variance[axis], spread, out=np.ones_like(spread), where=spread > 0
                )
                half[axis] = half[axis] * np.sqrt(wider)
    edges = [e for c, h in zip(centre, half, strict=True) for e in (c - h, c + h)]
    return np.clip(np.stack(edges, axis=-1), 0, 1)
