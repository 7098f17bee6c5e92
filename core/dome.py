"""The dome: the sphere cut into the cells of lamps, a patch for each lamp.

A direction belongs to the nearest lamp, unless that is farther away than the lamps' reach. What is
farther from every lamp is a hole in the dome. Each cell has a frame of its own, as a face has: the
lamp's direction, u to the right and v up, seen from inside. The square that holds the cell is its
extent in this frame.

Examples
--------
>>> dome = Dome(((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), 180.0)
>>> dome.nearest(np.array([[0.1, 2.0, 0.3], [0.1, -1.0, 3.0]])).tolist()
[0, 1]
>>> round(float(dome.solid_angles.sum() / np.pi), 3), dome.hole
(4.0, 0.0)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .faces import FACES

# Directions by which the cells are measured, and how many are worked on at a time.
MEASURED, BLOCK = 1 << 17, 1 << 13
# A plane shows nothing that is 90 degrees off its middle. Cells end here in their frames.
WIDEST = np.radians(80.0)
# By so much more than the lamps' spacing a lamp reaches by itself: between four lamps in a square
# the middle is at 0.71 of their spacing.
REACH = 0.75
# As close as that, in degrees, two lamps are one.
APART = 0.05


@dataclass(frozen=True)
class Dome:
    """Patches around the directions of lamps.

    Parameters
    ----------
    lamps : tuple of 3 float
        Directions of length 1 in the hemicube's frame.
    reach : float
        Degrees around its direction for which a lamp stands at most.
    """

    lamps: tuple[tuple[float, float, float], ...]
    reach: float

    @cached_property
    def directions(self) -> NDArray[np.float64]:
        """(K, 3) float64: the lamps' directions."""
        return np.array(self.lamps, np.float64)

    def nearest(self, where: NDArray) -> NDArray[np.int32]:
        """Find the lamp to which each direction belongs.

        Parameters
        ----------
        where : (n, 3) float
            In the hemicube's frame, of any length.

        Returns
        -------
        (n,) int32
            The number of the lamp; -1 in a hole.
        """
        out = np.empty(len(where), np.int32)
        least = -2.0 if self.reach >= 180 else np.cos(np.radians(self.reach))
        for start in range(0, len(where), BLOCK):
            some = where[start : start + BLOCK]
            cosines = some @ self.directions.T
            best = cosines.argmax(axis=1)
            most = cosines[np.arange(len(some)), best]
            there = most >= least * np.linalg.norm(some, axis=1)
            out[start : start + BLOCK] = np.where(there, best, -1)
        return out

    @cached_property
    def frames(self) -> NDArray[np.float64]:
        """(K, 3, 3) float64: of each lamp, as rows, its direction, that of u, and that of v."""
        d = self.directions
        across = np.cross(d, (0.0, 0.0, 1.0))
        length = np.linalg.norm(across, axis=1, keepdims=True)
        across = np.where(length > 1e-6, across / np.maximum(length, 1e-12), (1.0, 0.0, 0.0))
        return np.stack([d, across, np.cross(across, d)], axis=1)

    @cached_property
    def _measured(self) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
        """Of each cell its steradians, (K,), and the angle of its farthest point, (K,); the hole's
        steradians."""
        i = np.arange(MEASURED)
        z = 1 - (2 * i + 1) / MEASURED
        turn, flat = i * (np.pi * (3 - np.sqrt(5))), np.sqrt(1 - z * z)
        around = np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)
        own = self.nearest(around)
        lit = own >= 0
        count = np.bincount(own[lit], minlength=len(self.lamps))
        cosines = np.einsum("nd,nd->n", around[lit], self.directions[own[lit]])
        least = np.ones(len(self.lamps))
        np.minimum.at(least, own[lit], cosines)
        each = 4 * np.pi / MEASURED
        # a cell too small to be met is as large as half a place of the measure
        omega = np.maximum(count, 0.5) * each
        return omega, np.arccos(np.clip(least, -1, 1)), float((~lit).sum() * each)

    @property
    def solid_angles(self) -> NDArray[np.float64]:
        """(K,) float64: the steradians of each cell, to about 1 in 100."""
        return self._measured[0]

    @property
    def hole(self) -> float:
        """The steradians for which no lamp stands, of 4 pi."""
        return self._measured[2]

    @property
    def closed(self) -> bool:
        """Whether every direction has a patch."""
        return self.hole == 0

    @cached_property
    def cells(self) -> tuple[tuple[str, int, int], ...]:
        """(face, 0, number) of each lamp. The face is the one that its direction meets."""
        centres = np.array([centre for centre, _, _ in FACES.values()], np.float64)
        face = (self.directions @ centres.T).argmax(axis=1)
        names = tuple(FACES)
        return tuple((names[f], 0, k) for k, f in enumerate(face.tolist()))

    @cached_property
    def sides(self) -> NDArray[np.intp]:
        """(K,) int: for each cell, about how many of its size make up a side of a face."""
        return np.maximum(np.rint(np.sqrt(4 * np.pi / 6 / self.solid_angles)), 1).astype(np.intp)

    @cached_property
    def extents(self) -> NDArray[np.float64]:
        """(K, 4) float64: x0, x1, y0, y1 of the square around each cell, in the cell's frame."""
        # the last place that was met may lie before the cell's rim
        half = np.tan(np.clip(1.02 * self._measured[1], 1e-3, WIDEST))
        return half[:, None] * np.array([-1.0, 1.0, -1.0, 1.0])

    def place(self, face: str, x: NDArray, y: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Find the cells in which points of a face lie.

        Parameters
        ----------
        face : str
        x, y : (n,) float64
            The points, in [-1, 1].

        Returns
        -------
        patch : (n,) int32
            The numbers of the lamps; -1 in a hole.
        u, v : (n,) float64
            Patch coordinates.
        """
        centre, across, up = (np.array(a, np.float64) for a in FACES[face])
        where = centre + x[:, None] * across + y[:, None] * up
        patch = self.nearest(where)
        depth, s, t = np.einsum("nij,nj->in", self.frames[patch], where)
        depth = np.maximum(depth, 1e-6)
        half = self.extents[patch, 1]
        u, v = (np.clip((a / (depth * half) + 1) / 2, 0, 1) for a in (s, t))
        return patch, u, v


def own_reach(directions: NDArray) -> float:
    """Choose how far the lamps of a dome reach, by their spacing.

    Parameters
    ----------
    directions : (K, 3) float
        Of length 1.

    Returns
    -------
    float
        Degrees. Three quarters of the distance of each lamp's four nearest, of the lamp of which
        three quarters of the others have nearer ones; 180 for a single lamp.
    """
    count = len(directions)
    if count < 2:
        return 180.0
    angles = np.degrees(np.arccos(np.clip(directions @ directions.T, -1, 1)))
    angles.sort(axis=1)
    spacing = angles[:, 1 : min(count, 5)].mean(axis=1)
    return float(np.clip(REACH * np.percentile(spacing, 75), 1.0, 180.0))
