"""Cells: the pieces of light whose radiance is looked for, each a part of a patch.

A patch is one cell where the picture says no more of its light than a mean. It is cut into 2x2, 4x4
or 8x8 cells where mirrors and glossy things look at its parts.

Examples
--------
>>> cells = Cells(Hemicube(patches=1), np.array([1, 2, 1, 1, 1, 1]))
>>> cells.count, round(float(cells.solid_angles.sum() / np.pi), 6)
(9, 4.0)
>>> cells.radiance(Environment.uniform(3.0))[0].round(6).tolist()
[3.0, 3.0, 3.0]
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..field.field import Field
from ..field.model import Model
from ..hemicube import Hemicube
from ..light.bins import bin_coordinate
from ..light.environment import Environment, directions, sample_directions
from ..light.light import PatchLight
from ..supports import BELL, BOX, LEANING

# The models that see a part of a patch.
NARROW = (BOX.code, BELL.code, LEANING.code)

# The most cells a side of a patch, and the bins a side of a cell.
MOST_SIDES, BINS = 8, 2
# The most cells: of more, the equations take longer than the rest together.
MOST = 900
# A patch wider than this many radians has at least 2x2 cells.
WIDE = np.radians(17.0)
# Pixels that must look at a cell alone, before a patch is cut into cells so small.
LOOKS = 1.0
# Texels of a map are the mean of so many places a side, spread over a cell's width.
SPREAD = 4


@dataclass(frozen=True)
class Cells:
    """The cells of a hemicube, patch by patch, row by row of v.

    Parameters
    ----------
    hemicube : Hemicube
    sides : (K,) int
        Cells a side of each patch.
    """

    hemicube: Hemicube
    sides: NDArray[np.intp]

    @cached_property
    def starts(self) -> NDArray[np.intp]:
        """(K + 1,) int: the number of each patch's first cell, and the number of all cells."""
        return np.concatenate([[0], np.cumsum(self.sides**2)]).astype(np.intp)

    @property
    def count(self) -> int:
        """The number of cells, M."""
        return int(self.starts[-1])

    @cached_property
    def _resolutions(self) -> NDArray[np.intp]:
        if self.hemicube.lamps:
            return self.sides
        return np.maximum(self.sides * BINS, 4)

    @cached_property
    def _bins(self) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """For each bin of all patches its cell, and its solid angle in steradians."""
        if self.hemicube.lamps:  # one cell and one bin each, of no square
            return np.arange(self.count), self.hemicube.solid_angles
        of, omega = [], []
        for k, (g, r) in enumerate(
            zip(self.sides.tolist(), self._resolutions.tolist(), strict=True)
        ):
            i = np.arange(r) * g // r
            of.append((self.starts[k] + i[:, None] * g + i).ravel())
            x0, x1, y0, y1 = self.hemicube.extents[k]
            x, y = (
                np.tan(np.linspace(np.arctan(a), np.arctan(b), r + 1))
                for a, b in ((x0, x1), (y0, y1))
            )
            corner = np.arctan2(x * y[:, None], np.sqrt(1 + x * x + (y * y)[:, None]))
            omega.append(np.diff(np.diff(corner, axis=0), axis=1).ravel())
        return np.concatenate(of), np.concatenate(omega)

    @cached_property
    def solid_angles(self) -> NDArray[np.float64]:
        """(M,) float64: the steradians of each cell."""
        return np.bincount(*self._bins, self.count)

    def radiance(self, environment: Environment) -> NDArray[np.float64]:
        """Average an environment over each cell.

        Parameters
        ----------
        environment : Environment

        Returns
        -------
        (M, 3) float64
            Scene-linear radiance.
        """
        light = PatchLight(environment, self.hemicube, self._resolutions)
        flux = np.concatenate([light.bins_of(k).reshape(-1, 4) for k in range(len(self.sides))])
        total = np.stack([np.bincount(self._bins[0], flux[:, c], self.count) for c in range(4)])
        return (total[:3] / total[3]).T

    def lights(self) -> Iterator[PatchLight]:
        """Give lights that shine from single cells, three of each patch at a time.

        Yields
        ------
        PatchLight
            Its red is 1 in the first of the three cells, its green in the second, its blue in the
            third. The t-th light has the cells 3t, 3t + 1 and 3t + 2 of each patch.
        """
        of, omega = self._bins
        patch = np.repeat(np.arange(len(self.sides)), self._resolutions**2)
        within = of - self.starts[patch]
        for t in range(-(-int(self.sides.max() ** 2) // 3)):
            flat = np.stack([*((within == 3 * t + i) * omega for i in range(3)), omega], axis=-1)
            yield PatchLight.of_bins(self.hemicube, self._resolutions, flat)

    def locate(self, where: NDArray) -> NDArray[np.intp]:
        """Find the cell that each direction meets.

        Parameters
        ----------
        where : (..., 3) float
            In the world, of any length.

        Returns
        -------
        (...) int
            The number of the cell; -1 where no patch is.
        """
        k, u, v = self.hemicube.locate(where)
        g = self.sides[k]
        i, j = (
            np.clip(bin_coordinate(self.hemicube, k, t, a, g).astype(np.intp), 0, g - 1)
            for a, t in ((0, u), (1, v))
        )
        return np.where(k < 0, -1, self.starts[k] + j * g + i)

    @cached_property
    def middles(self) -> NDArray[np.float64]:
        """(M, 3) float64: the direction of each cell's middle."""
        return self._places(0.5, 0.5)

    def _places(self, a: float, b: float) -> NDArray[np.float64]:
        """The direction (M, 3) of a place of each cell, equal in angle: 0 to 1 is inside."""
        out = np.empty((self.count, 3))
        for k, g in enumerate(self.sides.tolist()):
            x0, x1, y0, y1 = self.hemicube.extents[k]
            u, v = (
                (np.tan(np.arctan(p) + (np.arctan(q) - np.arctan(p)) * (np.arange(g) + t) / g) - p)
                / (q - p)
                for p, q, t in ((x0, x1, a), (y0, y1, b))
            )
            uu, vv = np.meshgrid(u, v)
            out[self.starts[k] : self.starts[k + 1]] = self.hemicube.directions(
                k, uu.ravel(), vv.ravel()
            )
        return out

    @cached_property
    def borders(self) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Which cells share a border, (e, 2) int; the border's length over their distance, (e,).

        The sum of weight times squared difference is the integral of the squared gradient.
        """
        pairs, weights = [], []
        mine = np.arange(self.count)
        out = 0.15
        for along in (0.25, 0.75):
            for a, b in ((-out, along), (1 + out, along), (along, -out), (along, 1 + out)):
                other = self.locate(self._places(a, b))
                there = (other >= 0) & (other != mine)
                one, two = mine[there], other[there]
                apart = np.arccos(np.clip((self.middles[one] * self.middles[two]).sum(-1), -1, 1))
                pairs.append(np.stack([np.minimum(one, two), np.maximum(one, two)], axis=-1))
                # each border is met twice from both sides
                weights.append(np.sqrt(self.solid_angles[one]) / (4 * np.maximum(apart, 1e-6)))
        every, at = np.unique(np.concatenate(pairs), axis=0, return_inverse=True)
        return every, np.bincount(at.ravel(), np.concatenate(weights), len(every))

    def environment(
        self, radiance: NDArray, height: int, behind: Environment | None = None
    ) -> Environment:
        """Make a map of light that has the cells' radiance and is smooth between them.

        Parameters
        ----------
        radiance : (M, 3) float
            Scene-linear, not below 0.
        height : int
            Rows of the map; there are twice as many columns.
        behind : Environment, optional
            What the map shows where no patch is; black by default.

        Returns
        -------
        Environment
            Not turned. The mean over each cell is the cell's radiance.
        """
        azimuth, latitude, weight = sample_directions(height, 2 * height, 1)
        around = directions(azimuth, latitude)
        own = self.locate(around)
        lit = own >= 0
        # a step of the width of the texel's own cell, in a plane across the direction
        width = np.sqrt(self.solid_angles)[own][..., None]
        across = np.stack([-azimuth[:, 1], azimuth[:, 0], np.zeros(len(azimuth))], axis=-1)[None]
        up = np.cross(around, across)
        image = np.zeros((*own.shape, 3))
        steps = (np.arange(SPREAD) + 0.5) / SPREAD - 0.5
        for a in steps:
            for b in steps:
                met = self.locate(around + width * (a * across + b * up))
                image += radiance[np.where(met >= 0, met, own)]
        image /= SPREAD * SPREAD
        omega = np.broadcast_to(weight[:, None], own.shape)[lit]
        met = own[lit]
        total = np.bincount(met, omega, self.count)
        for c in range(3):
            seen = np.bincount(met, omega * image[lit][:, c], self.count)
            gain = np.divide(radiance[:, c] * total, seen, out=np.ones(self.count), where=seen > 0)
            image[lit, c] *= gain[met]
        image[~lit] = 0 if behind is None else behind.at(around[~lit])
        return Environment(image.astype(np.float32))


def cells_for(field: Field, most: int = MOST) -> Cells:
    """Choose how finely a field's pixels tell the light of each patch.

    A patch is cut where enough pixels look at a part of it no larger than a cell, as mirrors do.

    Parameters
    ----------
    field : Field
        A small one, as a proxy is.
    most : int
        The most cells.

    Returns
    -------
    Cells
    """
    hemicube = field.hemicube
    if hemicube.lamps:
        return Cells(hemicube, np.ones(len(hemicube), np.intp))
    levels = [2**i for i in range(1, MOST_SIDES.bit_length())]
    looks = np.zeros((len(levels), len(hemicube)))
    for tile in field.tiles:
        tile.open()
        for model in tile.models:
            if model.support.code in NARROW:
                for block in range(len(tile.blocks)):
                    _count_looks(model, block, levels, looks)
    wide = np.sqrt(hemicube.solid_angles) > WIDE
    least = np.where(wide, 2, 1)
    pace = LOOKS
    while True:
        sides = least
        for level, count in zip(levels, looks, strict=True):
            sides = np.where(count >= pace * level * level, np.maximum(sides, level), sides)
        if (sides**2).sum() <= most or (sides == least).all():
            return Cells(hemicube, sides.astype(np.intp))
        pace *= 1.3


def _count_looks(model: Model, block: int, levels: list[int], looks: NDArray[np.float64]) -> None:
    """Add up how many pixels look at a patch through a support no wider than 1 / level of it.

    A pixel counts by how bright it makes the patch, and wholly from a quarter of the brightest on.
    """
    for k in np.flatnonzero(model.counts[block]).tolist():
        at = model.at(block, k)
        given = model.parameters_of(at)
        if model.support.code != BOX.code:
            size = 2 * np.sqrt(np.maximum(given[:, 1] * given[:, 3], 0))
        else:
            size = np.sqrt(np.maximum((given[:, 1] - given[:, 0]) * (given[:, 3] - given[:, 2]), 0))
        bright = np.minimum(model.codes[:, at].max(axis=0).astype(np.float64) / 64, 1)
        for i, level in enumerate(levels):
            looks[i, k] += bright[size < 1.0 / level].sum()
