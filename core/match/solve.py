"""Least squares whose unknowns are not below 0.

Examples
--------
>>> gram = np.array([[2.0, 1.0], [1.0, 2.0]])
>>> nonnegative(gram, np.array([2.0, -1.0])).round(6).tolist()
[1.0, 0.0]
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Rounds in which unknowns are set free or held at 0 all at once, and the steps after them.
PIVOTS, STEPS = 6, 100
# Such rounds where the search begins with a guess.
FEWER = 3
# The change of the unknowns, relative to the largest, at which the steps end.
CLOSE = 1e-5


def nonnegative(
    gram: NDArray[np.float64], right: NDArray[np.float64], start: NDArray | None = None
) -> NDArray[np.float64]:
    """Find the x that is nowhere below 0 and minimises x G x / 2 - b x.

    Which unknowns are 0 is guessed by solving for the others and exchanging those on the wrong
    side. What is left to find is found by steps along the slope.

    Parameters
    ----------
    gram : (n, n) float64
        G, symmetric and positive definite.
    right : (n,) float64
        b.
    start : (n,) float, optional
        A guess. Which of its values are 0 is where the search begins.

    Returns
    -------
    (n,) float64

    Source
    ------
    The exchange: Kim and Park, "Fast nonnegative matrix factorization", SIAM J. Sci. Comput. 33
    (2011). The steps: Beck and Teboulle, "A fast iterative shrinkage-thresholding algorithm", SIAM
    J. Imaging Sci. 2 (2009), begun anew where they climb: O'Donoghue and Candes (2012).
    """
    scale = 1 / np.sqrt(np.diag(gram))
    gram, right = gram * scale * scale[:, None], right * scale
    free = np.ones(len(right), bool) if start is None else np.asarray(start) > 0
    best, least = np.zeros(len(right)), 0.0
    for _ in range(PIVOTS if start is None else FEWER):
        x = np.zeros(len(right))
        if free.any():
            x[free] = np.linalg.solve(gram[np.ix_(free, free)], right[free])
        slope = gram @ x - right
        wrong = np.where(free, x < 0, slope < 0)
        x = np.maximum(x, 0)
        value = float(x @ (gram @ x / 2 - right))
        if value < least:
            best, least = x, value
        if not wrong.any():
            return x * scale
        free ^= wrong
    return _steps(gram, right, best) * scale


def _steps(
    gram: NDArray[np.float64], right: NDArray[np.float64], x: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Accelerated steps along the slope, held at 0."""
    v = np.ones(len(right))
    for _ in range(20):
        v = gram @ (v / np.linalg.norm(v))
    # the norm is the largest eigenvalue, or a little below
    step = 1 / (1.05 * float(np.linalg.norm(v)))
    ahead, momentum = x, 1.0
    for _ in range(STEPS):
        slope = gram @ ahead - right
        new = np.maximum(ahead - step * slope, 0)
        if float(slope @ (new - x)) > 0:  # it climbs
            momentum, ahead = 1.0, new
        after = (1 + np.sqrt(1 + 4 * momentum**2)) / 2
        ahead = new + (momentum - 1) / after * (new - x)
        moved = float(np.abs(new - x).max(initial=0))
        x, momentum = new, after
        if moved <= CLOSE * float(np.abs(x).max(initial=0)):
            break
    return x
