"""Where to put a light so that it shines in a pixel: reflected, facing, grazing, or shaded.

The entries of a pixel say from which directions light comes to it, through all mirrors and glass.
Where the field says nothing of use, the normal and the direction of the eye do.

Examples
--------
>>> mirror = Lobes(np.array([[0.0, 0, 1], [1, 0, 0]]), np.array([0.02, 0.5]), np.array([0.04, 0.5]))
>>> found = reflected(mirror, None, None)
>>> found.direction.round(3).tolist(), found.by
([0.0, 0.0, 1.0], 'field')
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from ..errors import FieldError
from ..light.environment import Environment, directions, sample_directions
from .lobes import SMALL, Lobes, unit

# A lobe wider than this is no reflection that has a place.
BROAD = math.radians(20.0)
# The spread over which light from an area is looked for.
AREA = math.radians(15.0)
# How high above the surface a rim light stands, the first of these from which light comes.
_GRAZING = (10.0, 18.0, 28.0, 40.0, 55.0)
# Light comes from a direction if the density there is this part of the largest one.
_SEEN = 0.2
# The rows of the map on which the light to be shaded is looked for.
_ROWS = 90


class What(StrEnum):
    """What a light is to do at the pixel."""

    REFLECT = "REFLECT"
    LIGHT = "LIGHT"
    RIM = "RIM"
    SHADE = "SHADE"


@dataclass(frozen=True)
class Placed:
    """Where a light is to stand.

    Parameters
    ----------
    direction : (3,) float64
        A unit vector in the world, towards the light.
    spread : float
        The angle in degrees over which the pixel gathers light there.
    by : str
        "field", or "normal" where normal and eye told it.
    """

    direction: NDArray[np.float64]
    spread: float
    by: str


def reflected(lobes: Lobes, normal: NDArray | None, eye: NDArray | None) -> Placed:
    """Where a light is seen reflected in a pixel.

    Parameters
    ----------
    lobes : Lobes
    normal : (3,) float or None
        The surface's, in the world.
    eye : (3,) float or None
        From the camera to the pixel, in the world.

    Returns
    -------
    Placed

    Raises
    ------
    FieldError
        Neither field nor normal say anything of this pixel.
    """
    broad = None
    if len(lobes.weight):
        at, spread = lobes.peak(SMALL)
        if spread < BROAD and lobes.stands_out(at, spread):
            return Placed(at, math.degrees(spread), "field")
        broad = Placed(at, math.degrees(spread), "field")
    if normal is not None and eye is not None:
        n, e = unit(normal), unit(eye)
        if float(e @ n) < 0:
            return Placed(unit(e - 2 * float(e @ n) * n), 10.0, "normal")
    if broad is None:
        raise _nothing()
    return broad


def normal_at(position: NDArray, x: int, y: int, eye: NDArray) -> NDArray[np.float64] | None:
    """The normal of a pixel, told by the places that its neighbours see.

    Parameters
    ----------
    position : (H, W, 3) float
        Where in the scene each pixel's first surface is.
    x, y : int
    eye : (3,) float
        From the camera to the pixel.

    Returns
    -------
    (3,) float64 or None
        A unit vector towards the camera; None at the rim of a thing, and where nothing stands.
    """
    height, width = position.shape[:2]
    here = position[y, x].astype(np.float64)
    sides = []
    for dx, dy in ((1, 0), (0, 1)):
        found = [
            sign * (position[y + sign * dy, x + sign * dx] - here)
            for sign in (1, -1)
            if 0 <= y + sign * dy < height and 0 <= x + sign * dx < width
        ]
        sides.append(min(found, key=lambda side: float(side @ side)))
    normal = np.cross(sides[0], sides[1])
    size = float(np.linalg.norm(normal))
    lengths = [float(np.linalg.norm(side)) for side in sides]
    if not here.any() or min(lengths) <= 0 or size < 0.02 * lengths[0] * lengths[1]:
        return None
    normal = normal / size
    towards = float(normal @ unit(eye))
    if abs(towards) < 0.03:
        return None
    return -normal if towards > 0 else normal


def facing(lobes: Lobes, normal: NDArray | None) -> Placed:
    """Where a light stands that a pixel faces.

    Parameters
    ----------
    lobes : Lobes
    normal : (3,) float or None

    Returns
    -------
    Placed
        Along the normal; where no light comes from there, as something stands between, from where
        most comes.

    Raises
    ------
    FieldError
        Neither field nor normal say anything of this pixel.
    """
    some = lobes.only(lobes.spread > SMALL)
    some = some if some.weight.sum() > 0.2 * lobes.weight.sum() else lobes
    if normal is not None:
        n = unit(normal)
        if not len(some.weight) or _comes(some, n[None])[0]:
            return Placed(n, 30.0, "normal")
    if not len(some.weight):
        raise _nothing()
    if normal is None:
        # Of even light on a matt place, the mean direction is the normal.
        return Placed(unit(some.weight @ some.direction), 30.0, "field")
    best = int(some.density(some.direction, AREA).argmax())
    return Placed(some.direction[best], math.degrees(float(some.spread[best])), "field")


def _comes(lobes: Lobes, at: NDArray) -> NDArray[np.bool_]:
    """Whether light comes to the pixel from some directions."""
    most = float(lobes.density(lobes.direction, AREA).max())
    return lobes.density(at, AREA) >= _SEEN * most


def grazing(lobes: Lobes, normal: NDArray | None, eye: NDArray) -> Placed:
    """Where a light stands that grazes a pixel from behind.

    Parameters
    ----------
    lobes : Lobes
    normal : (3,) float or None
    eye : (3,) float

    Returns
    -------
    Placed
        As low above the surface as light comes from.

    Raises
    ------
    FieldError
        Neither field nor normal say anything of this pixel.
    """
    n = facing(lobes, normal).direction if normal is None else unit(normal)
    e = unit(eye)
    along = e - float(e @ n) * n
    if np.linalg.norm(along) < 0.05:  # the place faces the camera: from above, then
        up = np.array([0.0, 0.0, 1.0])
        along = up - float(up @ n) * n
        if np.linalg.norm(along) < 0.05:
            along = np.array([0.0, 1.0, 0.0])
    h = unit(along)
    angles = np.radians(_GRAZING)
    ways = np.cos(angles)[:, None] * h + np.sin(angles)[:, None] * n
    if not len(lobes.weight):
        return Placed(ways[0], 20.0, "normal")
    found = lobes.density(ways, math.radians(6.0)) / np.sin(angles)
    seen = found >= 0.5 * found.max()
    return Placed(ways[int(seen.argmax())], 20.0, "field" if found.max() > 0 else "normal")


def shading(lobes: Lobes, environment: Environment) -> Placed:
    """Where most of the light of a pixel comes from, so that a flag there takes it.

    Parameters
    ----------
    lobes : Lobes
    environment : Environment
        The light as it is.

    Returns
    -------
    Placed
        Its spread is that of the light around that place.

    Raises
    ------
    FieldError
        No light comes to this pixel.
    """
    height = min(_ROWS, environment.image.shape[0])
    scale = environment.image.shape[0] // height
    whole = environment.coarser(scale) if scale > 1 else environment
    rows, columns = whole.image.shape[:2]
    azimuth, latitude, weight = sample_directions(rows, columns, 1, whole.turn)
    around = directions(azimuth, latitude).reshape(-1, 3)
    texel = math.pi / rows
    light = np.maximum(whole.image.mean(axis=-1, dtype=np.float64).ravel(), 0)
    given = light * np.repeat(weight, columns) * lobes.density(around, texel)
    if not len(lobes.weight) or given.max(initial=0) <= 0:
        raise FieldError("no light comes to this place: there is nothing to shade")
    # The peak of the light over an area, then its middle.
    some = given > 0.02 * given.max()
    near = np.exp((around[some] @ around[some].T - 1) / math.radians(8.0) ** 2)
    at = around[some][int((near @ given[some]).argmax())]
    share = given[some]
    for _ in range(4):
        share = given[some] * np.exp((around[some] @ at - 1) / math.radians(12.0) ** 2)
        at = unit(share @ around[some])
    off = np.arccos(np.clip(around[some] @ at, -1, 1))
    spread = math.sqrt(float(share @ off**2 / share.sum()))
    return Placed(at, math.degrees(max(spread, texel / 2)), "field")


def _nothing() -> FieldError:
    return FieldError("nothing stands at this pixel: choose a place on a thing")
