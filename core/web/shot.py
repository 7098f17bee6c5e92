"""A shot for a page: a field as few numbers, as it is kept in a file.

Pictures are kept with the colours first, (3, H, W), as codes whose square is the light: the error
then goes with the root of the light. docs/web-format.md says all of the file.

Examples
--------
>>> codes = to_codes(np.array([[[0.25]], [[1.0]], [[0.0]]]), 1.0)
>>> codes.ravel().tolist(), from_codes(codes, 1.0).ravel().round(3).tolist()
([1024, 2047, 0], [0.25, 1.0, 0.0])
"""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field as made

import numpy as np
from numpy.typing import NDArray

# The largest code of light, and of a coordinate of a direction.
FULL, TURNS = 2047, 8191
# Widths of lobes: the smallest, in radians, and the steps in which they double.
THIN, STEPS = np.radians(0.02), 20
# Radiance of a world: a code of 0 is black, else 2 to the (code - 1) / STOPS, times the floor.
STOPS = 64


def to_codes(light: NDArray, scale: float) -> NDArray[np.uint16]:
    """Bring light to codes.

    Parameters
    ----------
    light : (3, H, W) float
        What is below 0 becomes 0.
    scale : float
        The light of the largest code.

    Returns
    -------
    (3, H, W) uint16
    """
    root = np.sqrt(np.clip(light / max(scale, 1e-30), 0, 1))
    return np.rint(root * FULL).astype(np.uint16)


def from_codes(codes: NDArray, scale: float) -> NDArray[np.float32]:
    """Bring codes back to light, see `to_codes`.

    Parameters
    ----------
    codes : (...) uint16
    scale : float

    Returns
    -------
    (...) float32
    """
    root = codes.astype(np.float32) / np.float32(FULL)
    return np.asarray(root * root * np.float32(scale), np.float32)


@dataclass(frozen=True)
class LobeCodes:
    """One lobe of every pixel; all codes of a pixel without one are 0.

    Parameters
    ----------
    toward : (2, H, W) uint16
        The place on the octahedral square, 0 to `TURNS`.
    shape : (3, H, W) uint8
        Width along and across, and slant.
    colour : (3, H, W) uint16
    """

    toward: NDArray[np.uint16]
    shape: NDArray[np.uint8]
    colour: NDArray[np.uint16]


@dataclass(frozen=True)
class World:
    """A light that the page shows.

    Parameters
    ----------
    name : str
    map : (3, side, side) uint16
        Codes of radiance on the octahedral square.
    floor : float
        The radiance of code 1.
    lights : tuple of World
        Lights of its kit, that are added to it.
    """

    name: str
    map: NDArray[np.uint16]
    floor: float
    lights: tuple[World, ...] = ()


@dataclass(frozen=True)
class Shot:
    """A shot for a page.

    Parameters
    ----------
    name : str
    white : (3, H, W) uint16
        What the smooth part shows in a light of radiance 1.
    numbers : (R, H, W) uint16
        Of each pixel.
    steps, zeros : (R,) float32
        A number is step times code, and zero more.
    to_light : (F, 3, R) float16
        See `components.Components`.
    frames : (K, 3, 3) float32
        See `smooth.Patches`.
    patches : (side, side) uint16
        The patch of each direction and 1 more; 0 for none.
    lobes : tuple of LobeCodes
    scales : dict of str to float
        The light of the largest code of `white`, `lobes` and each of `own`.
    own : dict of str to (3, H, W) uint16
        Light of the scene's own lamps, by group.
    through : (1 or 3, H, W) uint8
        The share of the world behind that is seen; 255 is all.
    rays : (h, w, 3) float32
        Where the camera looks, at places that are spread evenly from border to border.
    worlds : tuple of World
    view : (n, n, n, 3) uint8, optional
        How scene-linear light is shown, see `view`.
    about : dict
        What else is said of it.
    """

    name: str
    white: NDArray[np.uint16]
    numbers: NDArray[np.uint16]
    steps: NDArray[np.float32]
    zeros: NDArray[np.float32]
    to_light: NDArray[np.float16]
    frames: NDArray[np.float32]
    patches: NDArray[np.uint16]
    lobes: tuple[LobeCodes, ...]
    scales: dict[str, float]
    own: dict[str, NDArray[np.uint16]]
    through: NDArray[np.uint8]
    rays: NDArray[np.float32]
    worlds: tuple[World, ...] = ()
    view: NDArray[np.uint8] | None = None
    about: dict[str, str | float] = made(default_factory=dict)

    @property
    def size(self) -> tuple[int, int]:
        """Height and width."""
        return self.white.shape[1], self.white.shape[2]


def world_of(name: str, map: NDArray, lights: tuple[World, ...] = ()) -> World:
    """Bring a map to codes.

    Parameters
    ----------
    name : str
    map : (side, side, 3) float
        Scene-linear radiance; what is below 0 becomes 0.
    lights : tuple of World

    Returns
    -------
    World
        A step is a hundredth of the radiance; what is a millionth of the mean or less is black.
    """
    floor = max(float(map.mean()), 1e-12) * 2.0**-16
    with np.errstate(divide="ignore"):
        at = np.rint(np.log2(np.maximum(map, 0) / floor) * STOPS) + 1
    codes = np.where(at >= 1, np.clip(at, 1, 65535), 0).astype(np.uint16)
    return World(name, np.ascontiguousarray(codes.transpose(2, 0, 1)), floor, lights)


def map_of(world: World) -> NDArray[np.float32]:
    """Bring the codes of a world back to radiance, without its lights.

    Parameters
    ----------
    world : World

    Returns
    -------
    (side, side, 3) float32
    """
    codes = world.map.transpose(1, 2, 0).astype(np.float32)
    light = np.exp2((codes - 1) / np.float32(STOPS)) * np.float32(world.floor)
    return np.where(codes > 0, light, np.float32(0))
