"""What of the world behind all things is seen through a picture, by channel.

Alpha is one number a pixel: what is seen through grey fog or half of a leaf. Tinted glass shows
each channel another share, and a holdout shows nothing where alpha is 0. A tile has the layer
`through` where this share differs from 1 - alpha.

>>> alpha = np.array([[0.25, 0.0]], np.float32)
>>> grey = through_of(alpha)
>>> tells_more(grey, alpha), tells_more(grey * np.float32([1, 0.5, 1]), alpha)
(False, True)
>>> opaque(alpha, np.zeros((1, 2, 3), np.float32)).tolist()  # a hole behind half of the second
[[0.25, 0.0]]
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Less than this is the rounding of alphas and shares, which are kept as half floats.
ROUNDED = 2e-3


def through_of(alpha: NDArray) -> NDArray[np.float32]:
    """The share of the world behind that is seen where nothing is coloured.

    Parameters
    ----------
    alpha : (h, w) float

    Returns
    -------
    (h, w, 3) float32
    """
    return np.repeat((1 - alpha)[..., None].astype(np.float32), 3, axis=-1)


def tells_more(behind: NDArray, alpha: NDArray) -> bool:
    """Whether the share of the world behind is another than alpha says.

    Parameters
    ----------
    behind : (h, w, 3) float
        The share that is seen, by channel.
    alpha : (h, w) float

    Returns
    -------
    bool
    """
    return bool(np.abs(behind - through_of(alpha)).max(initial=0) > ROUNDED)


def opaque(alpha: NDArray, through: NDArray) -> NDArray[np.float32]:
    """The alpha of a picture with the world behind it: 1, but for holes.

    Parameters
    ----------
    alpha : (h, w) float
        Of the picture without the world.
    through : (h, w, 3) float
        The share of the world behind that is seen, by channel.

    Returns
    -------
    (h, w) float32
    """
    whole = np.clip(alpha + through.mean(axis=-1), 0, 1).astype(np.float32)
    return np.where(whole > 1 - ROUNDED, np.float32(1), whole)
