"""The paper's Algorithm 1: a support by descent on the squared error of the patterns (paper 5).

From an initial support all expansions are tried. The best is taken while it lowers the error, and
then the step is halved, down to `finest`. Three things differ from the paper's text:

- Contractions are tried as well, because a search from the whole patch cannot expand.
- The patterns are polynomials, so their average over a box by solid angle is a short sum. A
  summed-area table would give the same numbers on a grid.
- The initial support is that of the previous pixel where the coefficients are nearly equal, which
  forces an order along a row. Rows are independent, so all rows advance together.

Examples
--------
>>> from arto.core.patterns import pattern_set
>>> patterns, extent = pattern_set("moments"), (-1.0, 1.0, -1.0, 1.0)
>>> box = np.array([[0.25, 0.5, 0.5, 0.75]])
>>> basis = (patterns.matrix @ box_averages(box, extent))[..., None] * np.ones(3)
>>> search(basis, patterns, extent, height=1).round(2).tolist()
[[0.25, 0.5, 0.5, 0.75]]
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..measure import Extent, box_averages
from ..patterns import PatternSet

# The relative difference of coefficients up to which a pixel starts from the support before it.
NEARLY_EQUAL = 0.1
COARSEST = 0.25
# Moves of (u0, u1, v0, v1): each side out and in, and the whole box sideways.
_MOVES = np.array(
    [
        (-1, 0, 0, 0), (0, 1, 0, 0), (0, 0, -1, 0), (0, 0, 0, 1),
        (1, 0, 0, 0), (0, -1, 0, 0), (0, 0, 1, 0), (0, 0, 0, -1),
        (1, 1, 0, 0), (-1, -1, 0, 0), (0, 0, 1, 1), (0, 0, -1, -1),
        (-1, 1, 0, 0), (1, -1, 0, 0), (0, 0, -1, 1), (0, 0, 1, -1),
    ],
    np.float64,
)  # fmt: skip


def _error(boxes: NDArray, patterns: PatternSet, extent: Extent, target: NDArray) -> NDArray:
    """The paper's squared error over patterns and channels, over sum R^2 and without a constant.

    With one support for all channels, sum_c (R_c a - I_c)^2 equals sum_c R_c^2 times (a - t)^2 plus
    what no support can change, with the target t = sum R I / sum R^2. In this form nothing cancels.
    boxes: (m, n, 4); target: (P, n) -> (m, n).
    """
    averages = np.tensordot(patterns.matrix, box_averages(boxes, extent), axes=1)
    return np.square(averages - target[:, None]).sum(axis=0)


def descend(
    boxes: NDArray,
    patterns: PatternSet,
    extent: Extent,
    target: NDArray,
    coarsest: float,
    finest: float,
) -> NDArray:
    """Descend from some boxes to supports of least squared error, all pixels at once.

    Parameters
    ----------
    boxes : (n, 4) float
        u0, u1, v0, v1 to start from.
    patterns : PatternSet
    extent : tuple of 4 float
        The place of the patch on its face.
    target : (P, n) float
        The basis images over the coefficient.
    coarsest, finest : float
        The first and the last step, in patch widths.

    Returns
    -------
    (n, 4) float64
    """
    boxes = boxes.copy()
    step = coarsest
    while step >= finest:
        active = np.arange(len(boxes))
        best = _error(boxes[None], patterns, extent, target)[0]
        while len(active):
            trial = np.clip(boxes[None, active] + step * _MOVES[:, None], 0, 1)
            proper = (trial[..., 1] >= trial[..., 0]) & (trial[..., 3] >= trial[..., 2])
            errors = _error(trial, patterns, extent, target[:, active])
            errors[~proper] = np.inf
            choice = errors.argmin(axis=0)
            least = errors[choice, np.arange(len(active))]
            better = least < best[active]
            moved = active[better]
            boxes[moved] = trial[choice[better], np.flatnonzero(better)]
            best[moved] = least[better]
            active = moved
        step /= 2
    return boxes


def search(
    basis: NDArray,
    patterns: PatternSet,
    extent: Extent,
    height: int,
    finest: float = 1 / 256,
    follow: bool = True,
) -> NDArray[np.float64]:
    """Run Algorithm 1 for one patch of a picture.

    Parameters
    ----------
    basis : (P, n, 3) float
        Basis images of n = height x width pixels, row by row.
    patterns : PatternSet
    extent : tuple of 4 float
        The place of the patch on its face.
    height : int
        Rows of the picture.
    finest : float
        The last step, in patch widths.
    follow : bool
        Whether a pixel starts from the support of the previous pixel where their coefficients are
        nearly equal, as in the paper. Otherwise every pixel starts from the whole patch, and all
        are searched at once.

    Returns
    -------
    (n, 4) float64
        u0, u1, v0, v1.

    Source
    ------
    Paper 5, Algorithm 1.
    """
    images = basis.astype(np.float64)
    r = patterns.coefficient(images)
    rr = np.square(r).sum(axis=-1)
    target = np.einsum("nc,pnc->pn", r, images) / np.where(rr > 0, rr, 1)
    whole = np.tile(np.array([0.0, 1.0, 0.0, 1.0]), (len(rr), 1))
    if not follow:
        return descend(whole, patterns, extent, target, COARSEST, finest)
    width = len(rr) // height
    out = whole.reshape(height, width, 4)
    targets = target.reshape(-1, height, width)
    size = r.sum(axis=-1).reshape(height, width)
    for x in range(width):
        start = out[:, x].copy()
        if x:
            near = np.abs(size[:, x] - size[:, x - 1]) <= NEARLY_EQUAL * size[:, x - 1]
            start[near] = out[near, x - 1]
        out[:, x] = descend(start, patterns, extent, targets[:, :, x], COARSEST, finest)
    return out.reshape(-1, 4)
