"""Discs: lamps that a match looks for, smaller than any support of a field tells.

A field knows a lamp as a part of a patch: neither its shadows nor its place come out sharp. So the
brightest places of a light that was found are covered by discs, whose pictures are rendered. Where
a disc has much light it is covered by smaller ones, down to the size of the sun.

Examples
--------
>>> from arto.core.hemicube import Hemicube
>>> image = np.full((64, 128, 3), 0.1, np.float32)
>>> image[20, 30] = 3000.0
>>> cells = Cells(Hemicube(patches=4), np.full(96, 2))
>>> found = sought(cells, cells.radiance(Environment(image)))
>>> len(found) > 0, bool(found.angles.max() == SIZES[0])
(True, True)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..light.environment import Environment, directions, sample_directions
from .cells import Cells

# How wide discs are, in radians, from the first to the last.
SIZES = tuple(float(np.radians(d)) for d in (10.0, 3.5, 1.1))
# The most discs of the first size, and of each size after it.
MOST, MOST_FINER = 14, 21
# A place is worth a disc from this share of all light on, if it is so many times brighter than the
# mean of all directions.
WORTH, CONTRAST = 0.01, 3.0
# The share of the light of all discs from which on a disc is covered by smaller ones, and the share
# of the light of its six neighbours and itself from which on one of those is: less is a lamp that
# is as wide as they are together.
ON, HELD = 0.02, 0.2
# How many places a side of a texel are looked at where discs are drawn on a map.
FINE = 4
# How far apart discs of a size stand, in their width.
APART = 0.87


@dataclass(frozen=True)
class Discs:
    """Round lights, each of an even radiance.

    Parameters
    ----------
    directions : (L, 3) float64
        Towards the middle of each, of length 1.
    angles : (L,) float64
        How wide each is, in radians.
    """

    directions: NDArray[np.float64]
    angles: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.angles)

    @property
    def solid_angles(self) -> NDArray[np.float64]:
        """(L,) float64: the steradians of each."""
        return 2 * np.pi * (1 - np.cos(self.angles / 2))

    def only(self, which: NDArray) -> Discs:
        """Give some of the discs.

        Parameters
        ----------
        which : (m,) int or (L,) bool

        Returns
        -------
        Discs
        """
        return Discs(self.directions[which], self.angles[which])

    def and_(self, others: Discs) -> Discs:
        """Give these discs and others after them.

        Parameters
        ----------
        others : Discs

        Returns
        -------
        Discs
        """
        return Discs(
            np.concatenate([self.directions, others.directions]),
            np.concatenate([self.angles, others.angles]),
        )

    def drawn_on(self, environment: Environment, radiance: NDArray) -> Environment:
        """Add the discs' light to a map.

        Parameters
        ----------
        environment : Environment
            Not turned.
        radiance : (L, 3) float
            Scene-linear, of each disc.

        Returns
        -------
        Environment
            Of the same size. A disc that is smaller than a texel has the energy that it should.
        """
        image = environment.image.astype(np.float64)
        height, width = image.shape[:2]
        azimuth, latitude, weight = sample_directions(height * FINE, width * FINE, 1)
        true = self.solid_angles
        for one, half, light, omega in zip(
            self.directions, self.angles / 2, radiance, true, strict=True
        ):
            up = np.arcsin(np.clip(one[2], -1, 1))
            near = np.flatnonzero(np.abs(latitude - up) < half + np.pi / height)
            first, end = int(near[0]) // FINE, int(near[-1]) // FINE + 1
            these = slice(first * FINE, end * FINE)
            toward = directions(azimuth, latitude[these]) @ one
            # one that lies between the places that are looked at is the place nearest to it
            inside = toward >= min(np.cos(half), float(toward.max()))
            part = inside * weight[these, None]
            covers = part.reshape(-1, FINE, width, FINE).sum(axis=(1, 3))
            texel = FINE * weight[these].reshape(-1, FINE).sum(axis=1)
            covers *= omega / float(part.sum()) / texel[:, None]
            image[first:end] += covers[..., None] * light
        return Environment(image.astype(np.float32))


def sought(cells: Cells, radiance: NDArray[np.float64]) -> Discs:
    """Cover the brightest places of a light with discs of the first size.

    Parameters
    ----------
    cells : Cells
    radiance : (M, 3) float64
        Of each cell.

    Returns
    -------
    Discs
        The brightest first; none where no place outshines the rest.
    """
    flux = radiance.sum(axis=-1) * cells.solid_angles
    total = float(flux.sum())
    cap = 2 * np.pi * (1 - np.cos(SIZES[0] / 2))
    least = max(WORTH, CONTRAST * cap / (4 * np.pi)) * total
    cosines = cells.middles @ cells.middles.T
    within = cosines > np.cos(np.maximum(SIZES[0] / 2, 0.5 * np.sqrt(cells.solid_angles)))
    left, found = flux.copy(), []
    while len(found) < MOST and total > 0:
        sums = within.T @ left
        best = int(sums.argmax())
        if sums[best] < least:
            break
        at = within[:, best] * left @ cells.middles
        found.append(at / np.linalg.norm(at))
        left[within[:, best]] = 0
    return Discs(np.array(found).reshape(-1, 3), np.full(len(found), SIZES[0]))


def finer(
    discs: Discs, radiance: NDArray[np.float64], size: float
) -> tuple[NDArray[np.bool_], Discs]:
    """Cover the bright discs of a size with smaller ones.

    Parameters
    ----------
    discs : Discs
    radiance : (L, 3) float64
        Scene-linear, of each.
    size : float
        The smaller width, in radians.

    Returns
    -------
    kept : (L,) bool
        Which discs stay.
    new : Discs
        The smaller ones; none where no disc has light that is worth it.
    """
    flux = radiance.sum(axis=-1) * discs.solid_angles
    last = discs.angles <= discs.angles.min() * 1.001
    near = discs.directions @ discs.directions.T > np.cos(1.3 * discs.angles.min())
    around = np.where(last, near @ np.where(last, flux, 0), np.inf)
    bright = last & (flux > ON * flux.sum()) & (flux > HELD * around)
    new: list[NDArray[np.float64]] = []
    for i in sorted(np.flatnonzero(bright).tolist(), key=lambda i: -flux[i]):
        more = [
            one
            for one in _hexagon(discs.directions[i], size * APART)
            if all(one @ other < np.cos(0.6 * size) for other in new)
        ]
        if len(new) + len(more) > MOST_FINER:
            bright[i] = False
            continue
        new += more
    return (flux > 0) & ~bright, Discs(np.array(new).reshape(-1, 3), np.full(len(new), size))


def _hexagon(middle: NDArray[np.float64], step: float) -> list[NDArray[np.float64]]:
    """A direction, and six around it."""
    side = np.eye(3)[int(np.abs(middle).argmin())]
    x = np.cross(middle, side)
    x /= np.linalg.norm(x)
    y = np.cross(middle, x)
    turns = np.arange(6) * np.pi / 3
    around = [np.cos(step) * middle + np.sin(step) * (np.cos(t) * x + np.sin(t) * y) for t in turns]
    return [middle, *around]
