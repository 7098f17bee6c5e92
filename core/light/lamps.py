"""Lamps of an environment: suns, windows and softboxes, cut out of the map around them.

A single patch holds a whole sun, and no filter on a patch resolves the sun's shadows. So light
that outshines the rest of the map by far is split off, and comes into the picture by a render of
that light alone. The rest stays light that patches resolve well.

The cut is on radiance: a texel keeps its radiance up to a level, and the lamps take what is above
the level. The two maps add up to the whole texel by texel, so no energy is lost or made.

Examples
--------
>>> image = np.ones((32, 64, 3), np.float32)
>>> image[8, 8] = 5000.0
>>> found = split(Environment(image))
>>> bool(found.lamps.image[8, 8, 0] > 4900), found.worth
(True, True)
>>> bool(np.allclose(found.rest.image + found.lamps.image, image))
True
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..hemicube import Hemicube
from .environment import Environment, directions, sample_directions

# How many times brighter than the rest of the map, on average, a lamp is.
CONTRAST = 20.0
# The share of all light from which on lamps are worth a render of their own.
WORTH = 0.05
_STEPS = 60
# The least floor of a search, as a share of the mean.
_LEAST = 1e-6


@dataclass(frozen=True)
class Split:
    """An environment cut in two.

    Parameters
    ----------
    rest, lamps : Environment
        They sum to the environment.
    share : float
        The share of the lamps in all light, 0 to 1.
    """

    rest: Environment
    lamps: Environment
    share: float

    @property
    def worth(self) -> bool:
        """Whether the lamps have enough light for a render of their own."""
        return self.share >= WORTH


def split(
    environment: Environment, hemicube: Hemicube | None = None, contrast: float = CONTRAST
) -> Split:
    """Cut the lamps out of an environment map.

    The level of the cut is `contrast` times the mean radiance of what stays below it. Cutting again
    and again, from the top, finds that level. What covers more than 1 / contrast of the sphere is
    never a lamp, however bright. Turning the map or changing its exposure changes nothing else.

    Parameters
    ----------
    environment : Environment
    hemicube : Hemicube, optional
        Light from directions in which it has no patch is left out of lamps and sums.
    contrast : float
        How many times brighter than the rest a lamp is.

    Returns
    -------
    Split
    """
    image = environment.image
    radiance = image[..., 0].astype(np.float64)
    for channel in (1, 2):  # numpy is slow at sums of three
        radiance += image[..., channel]
    np.maximum(radiance, 0, out=radiance)
    if hemicube is not None:
        height, width = radiance.shape
        radiance *= _covered(hemicube, height, width, environment.turn)
    weight = environment.row_solid_angles[:, None] / (4 * np.pi)
    total = float((radiance * weight).sum())
    # No texel below this floor reaches the level, so only the brighter ones are looked at again.
    floor = contrast * total / 2
    while floor > 0 and contrast * float((np.minimum(radiance, floor) * weight).sum()) < floor:
        floor = floor / 4 if floor > _LEAST * total else 0.0
    bright = np.nonzero(radiance > floor)
    among, weights = radiance[bright], weight[bright[0], 0]
    below = total - float((among * weights).sum())
    level = np.inf
    for _ in range(_STEPS):
        lower = contrast * (below + float((np.minimum(among, level) * weights).sum()))
        if lower >= level * (1 - 1e-6):
            break
        level = lower
    above = np.maximum(among - level, 0)
    taken = np.divide(above, among, out=np.zeros_like(among), where=among > 0)
    lamps, rest = np.zeros_like(image, np.float32), image.copy()
    lamps[bright] = image[bright] * taken[:, None]
    rest[bright] -= lamps[bright]
    share = float((above * weights).sum()) / total if total > 0 else 0.0
    turn = environment.turn
    return Split(Environment(rest, turn), Environment(lamps, turn), share)


def _covered(hemicube: Hemicube, height: int, width: int, turn: float) -> NDArray[np.bool_]:
    """Which texels of a map lie in the direction of a patch -> (height, width)."""
    azimuth, latitude, _ = sample_directions(height, width, 1, turn)
    return hemicube.locate(directions(azimuth, latitude))[0] >= 0
