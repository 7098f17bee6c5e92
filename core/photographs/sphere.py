"""What a thing shows in light from a direction, told from its pictures in light from others.

The interpolation is exact for what is a constant and a linear function of the direction. Diffuse
things without shadows are. What is left is passed on by distance, as a thin plate passes it on.

Examples
--------
>>> known = np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1], [-1, 0, 1], [0, -1, 1]], float)
>>> known /= np.linalg.norm(known, axis=1, keepdims=True)
>>> wanted = np.array([[0.48, 0.36, 0.8]])
>>> found = weights(known, wanted) @ (known @ [0.2, 0.5, 0.8])
>>> round(float(found[0]), 6), round(float(wanted[0] @ [0.2, 0.5, 0.8]), 6)
(0.916, 0.916)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Neighbours that tell a direction, at most.
NEIGHBOURS = 24


def weights(known: NDArray, wanted: NDArray) -> NDArray[np.float64]:
    """Compute how much each known direction counts for wanted ones.

    Parameters
    ----------
    known : (n, 3) float
        Of length 1.
    wanted : (m, 3) float
        Of length 1.

    Returns
    -------
    (m, n) float64
        Rows sum to 1. They may have values below 0.
    """
    out = np.zeros((len(wanted), len(known)))
    cosines = wanted @ known.T
    for i, one in enumerate(wanted):
        some = np.argsort(-cosines[i], kind="stable")[:NEIGHBOURS]
        near = known[some]
        plate = np.linalg.norm(near[:, None] - near[None], axis=-1)
        linear = np.concatenate([np.ones((len(near), 1)), near], axis=1)
        corner = np.zeros((4, 4))
        matrix = np.block([[-plate, linear], [linear.T, corner]])
        asked = np.concatenate([-np.linalg.norm(near - one, axis=-1), [1.0], one])
        # least squares: directions in one plane do not tell all that is linear
        found = np.linalg.lstsq(matrix, asked, rcond=1e-9)[0]
        out[i, some] = found[: len(near)]
    return out
