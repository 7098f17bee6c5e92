"""The light of a page's world: turned, with its kit's lights, and on the square of the patches.

Examples
--------
>>> sky = sphere.levels(np.full((32, 32, 3), 2.0, np.float32))
>>> light_on(sky, 16, 0.5).shape, round(float(light_on(sky, 16, 0.5).max()), 5)
((256, 3), 2.0)
>>> turned(np.array([[1.0, 0.0, 0.0]]), np.pi / 2).round(6).tolist()
[[0.0, 1.0, 0.0]]
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .shot import World, map_of


def turned(around: NDArray, turn: float) -> NDArray:
    """Turn directions counterclockwise, seen from above.

    Parameters
    ----------
    around : (..., 3) float
    turn : float
        Radians.

    Returns
    -------
    (..., 3) float
    """
    x, y, z = np.moveaxis(around, -1, 0)
    cos, sin = np.cos(turn), np.sin(turn)
    return np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=-1)


def light_on(every: list[NDArray[np.float32]], side: int, turn: float) -> NDArray[np.float32]:
    """Look at a world in the directions of a square.

    Parameters
    ----------
    every : list of (n, n, 3) float32
        The levels of the world's map.
    side : int
        Of the square.
    turn : float
        Radians: the directions are turned by it before they are looked up.

    Returns
    -------
    (side * side, 3) float32
        Read from the level whose texels are twice as wide: so no lamp falls between directions.
    """
    level = next((one for one in every if len(one) <= max(side // 2, sphere.SMALLEST)), every[-1])
    return sphere.read(level, turned(sphere.directions(side).reshape(-1, 3), turn))


def mixed(world: World, gains: Mapping[str, tuple[float, float, float]]) -> NDArray[np.float32]:
    """Add a world's lights to it.

    Parameters
    ----------
    world : World
    gains : dict of str to tuple of 3 float
        The factor for each light, by name and channel; 1 for the others.

    Returns
    -------
    (side, side, 3) float32
        Scene-linear radiance.
    """
    out = map_of(world)
    for light in world.lights:
        gain = np.array(gains.get(light.name, (1.0, 1.0, 1.0)), np.float32)
        out += map_of(light) * gain
    return out
