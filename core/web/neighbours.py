"""Pixels with lobes beside each other: one that stands alone is noise, and no mirror.

Examples
--------
>>> there = np.array([[1, 1, 0, 0, 1, 0]], bool)
>>> accompanied(there).astype(int).tolist()
[[1, 1, 0, 0, 0, 0]]
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# So many of a pixel's neighbours have lobes, as a share.
COMPANY = 0.4


def accompanied(there: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell pixels whose neighbours have lobes as well.

    Parameters
    ----------
    there : (H, W) bool
        Which pixels have lobes.

    Returns
    -------
    (H, W) bool
    """
    height, width = there.shape
    wide = np.pad(
        np.stack([there, np.ones_like(there)]).astype(np.float32), ((0, 0), (1, 1), (1, 1))
    )
    beside = [(y, x) for y in range(3) for x in range(3) if (y, x) != (1, 1)]
    have, count = np.sum([wide[:, y : y + height, x : x + width] for y, x in beside], axis=0)
    return there & (have >= COMPANY * count)
