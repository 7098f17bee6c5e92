"""What a page shows, computed without a browser: the same sums in the same order.

So the error of a page can be measured, and what a browser shows can be checked.

Examples
--------
>>> taps(np.array([0.1]), np.array([0.1]))[0].tolist()  # a round lobe is looked at once
[0.0]
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field as made
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .light import light_on, mixed, turned
from .lobes import axes
from .shot import STEPS, THIN, TURNS, LobeCodes, Shot, from_codes
from .smooth import Patches

# Each of the three looks along a lobe is at least so wide, as a share of the lobe.
LEAST = 0.45
# The width of a look at the world behind, in texels of its map.
BEHIND = 0.25


@dataclass(frozen=True)
class Dials:
    """What a visitor chooses.

    Parameters
    ----------
    world : int
        The number of the world.
    turn : float
        Radians, counterclockwise from above, that are added to a direction's azimuth.
    strength : float
    own : float
        The factor for the scene's own lamps.
    groups : dict of str to float
        Factors for groups of these, by name.
    lights : dict of str to tuple of 3 float
        Factors for the lights of the world's kit.
    behind : bool
        Whether the world behind is shown.
    """

    world: int = 0
    turn: float = 0.0
    strength: float = 1.0
    own: float = 1.0
    groups: Mapping[str, float] = made(default_factory=dict)
    lights: Mapping[str, tuple[float, float, float]] = made(default_factory=dict)
    behind: bool = True


class Reader:
    """A shot for a page, ready to be shown.

    Parameters
    ----------
    shot : Shot
    """

    def __init__(self, shot: Shot) -> None:
        self.shot = shot
        self._levels: tuple[object, list[NDArray[np.float32]]] | None = None

    @cached_property
    def patches(self) -> Patches:
        """The shot's patches."""
        at = self.shot.patches.astype(np.intp).ravel() - 1
        return Patches.laid(len(self.shot.patches), self.shot.frames, at)

    def levels(self, dials: Dials) -> list[NDArray[np.float32]]:
        """Make the levels of a world's map.

        Parameters
        ----------
        dials : Dials

        Returns
        -------
        list of (n, n, 3) float32
        """
        key = dials.world, tuple(sorted(dials.lights.items()))
        if self._levels is None or self._levels[0] != key:
            world = self.shot.worlds[dials.world]
            self._levels = key, sphere.levels(mixed(world, dials.lights))
        return self._levels[1]

    def numbers_of_light(self, dials: Dials) -> NDArray[np.float64]:
        """Compute what the light gives each component.

        Parameters
        ----------
        dials : Dials

        Returns
        -------
        (R, 3) float64
        """
        light = light_on(self.levels(dials), self.patches.side, dials.turn)
        planes = self.patches.planes(light).reshape(-1, 3)
        return np.einsum("fc,fcr->rc", planes, self.shot.to_light.astype(np.float64))

    def picture(self, dials: Dials) -> NDArray[np.float32]:
        """Compute the picture.

        Parameters
        ----------
        dials : Dials

        Returns
        -------
        (H, W, 3) float32
            Scene-linear radiance, not below 0.
        """
        shot = self.shot
        height, width = shot.size
        of = self.numbers_of_light(dials).astype(np.float32)
        out = np.zeros((height * width, 3), np.float32)
        constant = shot.zeros @ of
        out += constant
        scaled = of * shot.steps[:, None]
        for codes, light in zip(shot.numbers, scaled, strict=True):
            out += codes.reshape(-1, 1).astype(np.float32) * light
        out *= from_codes(shot.white, shot.scales["white"]).reshape(3, -1).T
        every = self.levels(dials)
        for lobe in shot.lobes:
            add_lobe(out, lobe, shot.scales["lobes"], every, dials.turn)
        out = np.maximum(out, 0)
        if dials.behind and shot.through.any():
            out += self._behind(every, dials.turn)
        out *= np.float32(dials.strength)
        for name, codes in shot.own.items():
            gain = dials.own
            if name != "own":
                # the group is in the sum of all already
                gain *= dials.groups.get(name, 1.0) - 1
            if gain:
                light = from_codes(codes, shot.scales[name]).reshape(3, -1).T
                out += np.float32(gain) * light
        return np.maximum(out, 0).reshape(height, width, 3)

    def rays(self) -> NDArray[np.float32]:
        """Give where the camera looks in each pixel.

        Returns
        -------
        (H * W, 3) float32
            Unit vectors.
        """
        height, width = self.shot.size
        out = self.shot.rays
        for axis, size in ((0, height), (1, width)):
            n = out.shape[axis]
            at = (np.arange(size) + 0.5) / size * (n - 1)
            low = np.minimum(at.astype(np.intp), n - 2)
            part = (at - low).astype(np.float32).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
            out = out.take(low, axis=axis) * (1 - part) + out.take(low + 1, axis=axis) * part
        out = out.reshape(-1, 3)
        return out / np.maximum(np.linalg.norm(out, axis=-1, keepdims=True), 1e-12)

    def _behind(self, every: list[NDArray[np.float32]], turn: float) -> NDArray[np.float32]:
        share = self.shot.through.reshape(len(self.shot.through), -1).T.astype(np.float32) / 255
        seen = np.flatnonzero(share.any(axis=-1))
        out = np.zeros((len(share), 3), np.float32)
        out[seen] = share[seen] * sphere.read(every[0], turned(self.rays()[seen], turn))
        return out


def taps(along: NDArray, across: NDArray) -> tuple[NDArray, NDArray]:
    """Find how a lobe is looked at: three times along its longest axis.

    Parameters
    ----------
    along, across : (n,) float
        Standard deviations in radians.

    Returns
    -------
    apart : (n,) float
        How far the outer looks are from the middle one, as the tangent of an angle.
    width : (n,) float
        The standard deviation of each.
    """
    width = np.maximum(across, LEAST * along)
    return np.sqrt(1.5 * np.maximum(along * along - width * width, 0)), width


def add_lobe(
    out: NDArray[np.float32],
    lobe: LobeCodes,
    scale: float,
    every: list[NDArray[np.float32]],
    turn: float,
) -> None:
    """Add what the lobes of the pixels show.

    Parameters
    ----------
    out : (n, 3) float32
        Changed in place.
    lobe : LobeCodes
    scale : float
        The light of the largest code.
    every : list of (m, m, 3) float32
        The levels of the world's map.
    turn : float
    """
    there = np.flatnonzero(lobe.colour.any(axis=0).ravel())
    x, y = lobe.toward.reshape(2, -1)[:, there].astype(np.float64) / TURNS
    toward = sphere.unfolded(x, y)
    codes = lobe.shape.reshape(3, -1)[:, there].astype(np.float64)
    along, across = THIN * 2 ** (codes[:2] / STEPS)
    slant = codes[2] * (np.pi / 256)
    apart, width = taps(along, across)
    right, up = axes(toward)
    step = (np.cos(slant)[:, None] * right + np.sin(slant)[:, None] * up) * apart[:, None]
    light = np.zeros((len(there), 3), np.float32)
    for side in (-1, 0, 1):
        at = toward + side * step
        at /= np.linalg.norm(at, axis=-1, keepdims=True)
        light += sphere.look(every, turned(at, turn), width)
    colour = from_codes(lobe.colour.reshape(3, -1)[:, there], scale).T
    out[there] += colour * light / 3
