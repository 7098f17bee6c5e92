"""Screens: where monitors stand around a thing, and which patches they cover (paper 4.1, 4.2).

The hemicube is what a field is made of. A monitor is a rectangle somewhere around the thing. What
it shows is decided by directions from the thing's middle: a pixel of the screen belongs to the
patch that it covers. So a monitor may stand as a side of a cube, as in the paper, or anywhere.

Coordinates are those of the hemicube: x right, y away from the camera, z up.

Examples
--------
>>> four = Monitors(("top", "left", "right", "back"), 4, "paper", 1920, 1080)
>>> cube = hemicube_of(four)
>>> len(cube), round(hole(cube), 3)  # two of six sides are missing
(64, 0.333)
>>> screens_of(four)[1].corners[0].round(2).tolist()  # wider than the cube's side
[-1.0, -1.78, -1.0]
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..errors import PhotographsError
from ..faces import FACE_NAMES, FACES, LEAF_SIDES
from ..hemicube import Hemicube
from .description import Monitors

# A patch is lit where a screen covers this share of it. Less would be another patch.
COVERED = 0.98
# Points along the side of a patch that are looked at.
POINTS = 12


@dataclass(frozen=True, eq=False)
class Screen:
    """One monitor.

    Parameters
    ----------
    side : str
        Its name.
    corners : (4, 3) float64
        At (u, v) = (0, 0), (1, 0), (1, 1), (0, 1) of its picture, seen from the thing with v up,
        from the thing's middle, in any unit.
    width, height : int
        Pixels.
    """

    side: str
    corners: NDArray[np.float64]
    width: int
    height: int

    @cached_property
    def normal(self) -> NDArray[np.float64]:
        """(3,) float64: the direction from the screen towards the thing's side, a unit vector."""
        u, v = self.corners[1] - self.corners[0], self.corners[3] - self.corners[0]
        n = np.cross(u, v)
        n = n / np.linalg.norm(n)
        return n if n @ self.corners.mean(axis=0) < 0 else -n

    @cached_property
    def places(self) -> NDArray[np.float64]:
        """(height, width, 3) float64: the places of its pixels, rows from the top."""
        u = ((np.arange(self.width) + 0.5) / self.width)[None, :, None]
        v = (1 - (np.arange(self.height) + 0.5) / self.height)[:, None, None]
        low = self.corners[0] * (1 - u) + self.corners[1] * u
        high = self.corners[3] * (1 - u) + self.corners[2] * u
        return low * (1 - v) + high * v

    def cosines(self, places: NDArray) -> NDArray[np.float64]:
        """Compute the cosine of the angle at which the thing's middle sees some places.

        Parameters
        ----------
        places : (..., 3) float
            On the screen.

        Returns
        -------
        (...) float64
            1 straight ahead of the screen.
        """
        return -(places @ self.normal) / np.linalg.norm(places, axis=-1)

    def meets(self, directions: NDArray) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        """Find where directions from the thing's middle meet the screen.

        Parameters
        ----------
        directions : (..., 3) float

        Returns
        -------
        met : (...) bool
        places : (..., 3) float64
            They mean nothing where the screen is not met.
        """
        facing = directions @ self.normal
        t = (self.corners[0] @ self.normal) / np.where(facing < -1e-9, facing, -1e-9)
        places = directions * t[..., None]
        u, v = self.corners[1] - self.corners[0], self.corners[3] - self.corners[0]
        from_corner = places - self.corners[0]
        inside = facing < -1e-9
        for side in (u, v):
            along = from_corner @ side / (side @ side)
            inside &= (along >= -1e-6) & (along <= 1 + 1e-6)
        return inside, places


def to_hemicube(points: NDArray, view: str = "ahead") -> NDArray[np.float64]:
    """Turn places of a description into the hemicube's frame.

    Parameters
    ----------
    points : (..., 3) float
        x to the right of the picture, y up in it, z towards the camera.
    view : str
        `ahead` where the camera looks along the ground, `down` where it looks down.

    Returns
    -------
    (..., 3) float64
        x right, y away from the camera, z up.
    """
    x, y, z = np.moveaxis(np.asarray(points, np.float64), -1, 0)
    return np.stack([x, y, z] if view == "down" else [x, -z, y], axis=-1)


def screens_of(monitors: Monitors, view: str = "ahead") -> tuple[Screen, ...]:
    """Place the monitors of a description.

    Parameters
    ----------
    monitors : Monitors
        Without corners, each side of a cube is a square in the middle of its monitor, as wide as
        the monitor's shorter edge.
    view : str
        See `to_hemicube`.

    Returns
    -------
    tuple of Screen

    Raises
    ------
    PhotographsError
        Four corners are no rectangle, or the thing stands in the screen.
    """
    size = monitors.width, monitors.height
    out = []
    for number, side in enumerate(monitors.sides):
        if monitors.corners is None:
            centre, eu, ev = np.array(FACES[side], np.float64)
            x, y = size[0] / min(size), size[1] / min(size)
            at = [centre + x * i * eu + y * j * ev for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            corners = np.array(at)
        else:
            corners = to_hemicube(np.array(monitors.corners[number]), view)
            _check(side, corners)
        out.append(Screen(side, corners, *size))
    return tuple(out)


def _check(side: str, corners: NDArray) -> None:
    """Raise PhotographsError unless four corners are a rectangle that the thing is before."""
    u, v = corners[1] - corners[0], corners[3] - corners[0]
    wide, high = np.linalg.norm(u), np.linalg.norm(v)
    closed = np.linalg.norm(corners[0] + u + v - corners[2])
    if min(wide, high) <= 0 or closed > 0.02 * (wide + high) or abs(u @ v) > 0.03 * wide * high:
        raise PhotographsError(
            f"the corners of the monitor '{side}' are no rectangle: give them in the order below "
            "left, below right, above right, above left, as seen from the thing"
        )
    normal = np.cross(u, v) / (wide * high)
    if abs(normal @ corners[0]) < 1e-3 * max(wide, high):
        raise PhotographsError(f"the thing stands in the screen '{side}': look at its corners")


def hemicube_of(monitors: Monitors, view: str = "ahead") -> Hemicube:
    """Find the patches that the monitors light.

    Parameters
    ----------
    monitors : Monitors
    view : str
        See `to_hemicube`.

    Returns
    -------
    Hemicube
        Of the sides of a cube; with corners, of those patches that a screen covers.

    Raises
    ------
    PhotographsError
        No patch is covered, or there are corners and the number of patches is not 1, 2, 4, 8 or
        16.
    """
    if monitors.corners is None:
        sides = tuple(f for f in FACE_NAMES if f in monitors.sides)
        return Hemicube(faces=sides, patches=monitors.patches)
    n = monitors.patches
    if n not in LEAF_SIDES:
        raise PhotographsError(
            f"{n} patches a side: monitors with corners are cut into 1, 2, 4, 8 or 16"
        )
    every = Hemicube(patches=n)
    screens = screens_of(monitors, view)
    at = (np.arange(POINTS) + 0.5) / POINTS
    u, v = np.meshgrid(at, at)
    leaves = []
    for k, (face, row, column) in enumerate(every.grid):
        directions = every.directions(k, u, v)
        # one screen alone: a patch on two would be lit by both
        share = max(float(s.meets(directions)[0].mean()) for s in screens)
        if share >= COVERED:
            leaves.append((face, n, row, column))
    if not leaves:
        raise PhotographsError(
            "no patch is covered by a monitor: choose more patches a side, or look at the corners"
        )
    faces = tuple(f for f in FACE_NAMES if any(leaf[0] == f for leaf in leaves))
    return Hemicube(faces=faces, patches=n, leaves=tuple(leaves))


def screen_of(hemicube: Hemicube, k: int, screens: tuple[Screen, ...]) -> int:
    """Find the screen that lights a patch.

    Parameters
    ----------
    hemicube : Hemicube
    k : int
        The number of the patch.
    screens : tuple of Screen

    Returns
    -------
    int
        The number of the screen.
    """
    at = (np.arange(POINTS) + 0.5) / POINTS
    directions = hemicube.directions(k, *np.meshgrid(at, at))
    return int(np.argmax([s.meets(directions)[0].mean() for s in screens]))


def hole(hemicube: Hemicube) -> float:
    """Say how much of the sphere no patch covers.

    Parameters
    ----------
    hemicube : Hemicube

    Returns
    -------
    float
        The share of all directions, 0 to 1.
    """
    return 1 - float(hemicube.solid_angles.sum()) / (4 * np.pi)
