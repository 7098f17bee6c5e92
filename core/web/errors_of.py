"""How far a page's picture is from the plate, mirrors apart.

Examples
--------
>>> plate = np.ones((1, 4, 3))
>>> mirror = np.array([[True, False, False, False]])
>>> found = errors(1.02 * plate, plate, np.ones((1, 4), bool), mirror)
>>> round(found.smooth, 4), round(found.mirrors, 4)
(0.0198, 0.0198)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..metrics import relative_error
from .shot import Shot, from_codes

# From this share of a pixel's white on that its lobes have, it is a mirror.
MIRROR = 0.5


@dataclass(frozen=True)
class Errors:
    """Mean relative errors, see `metrics.relative_error`.

    Parameters
    ----------
    all : float
    smooth : float
        Of what is no mirror; 0 where there is nothing else.
    mirrors : float
        0 where there are none.
    """

    all: float
    smooth: float
    mirrors: float


def mirrors_of(shot: Shot) -> NDArray[np.bool_]:
    """Tell the pixels that mostly show the world by lobes.

    Parameters
    ----------
    shot : Shot

    Returns
    -------
    (H, W) bool
    """
    smooth = from_codes(shot.white, shot.scales["white"]).mean(axis=0)
    lobes = np.zeros_like(smooth)
    for lobe in shot.lobes:
        lobes += from_codes(lobe.colour, shot.scales["lobes"]).mean(axis=0)
    return lobes > MIRROR * np.maximum(smooth + lobes, 1e-9)


def errors(picture: NDArray, plate: NDArray, seen: NDArray, mirror: NDArray) -> Errors:
    """Compare a picture with a plate.

    Parameters
    ----------
    picture, plate : (H, W, 3) float
        Scene-linear.
    seen : (H, W) bool
        The pixels that count.
    mirror : (H, W) bool

    Returns
    -------
    Errors
    """
    found = relative_error(picture, plate, seen).mean(axis=-1)
    mirrors = mirror[seen]

    def mean(values: NDArray) -> float:
        return float(values.mean()) if values.size else 0.0

    return Errors(mean(found), mean(found[~mirrors]), mean(found[mirrors]))
