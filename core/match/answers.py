"""Answers: how the pixels of a field answer the light of each cell, as a matrix.

The light of a pixel is linear in the radiance of the cells. So the field is a matrix, of which a
row is a cell's picture, and a column says where a pixel's light comes from. The columns are all
pixels of a small proxy, and those pixels of a finer one that mirrors and clear things fill: these
see the light as finely as the picture does.

Examples
--------
Two pixels of a small proxy, and one that mirrors of a proxy four times as fine:

>>> from types import SimpleNamespace as Proxy
>>> small, values = Proxy(shape=(1, 2)), np.zeros((3, 5, 3), np.float32)
>>> Answers(None, values, small, small, (8, 2), np.array([7]), np.ones(3)).sizes.tolist()
[1.0, 1.0, 0.0625]
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..field.field import Field
from ..field.tile import Tile
from ..light.environment import Environment
from ..light.light import PatchLight
from ..preview import Preview
from .cells import MOST, NARROW, Cells, cells_for
from .target import smaller

# The most pixels of the small proxy, and of the finer one.
PIXELS, FINE_PIXELS = 8_500, 5_000
# A pixel is shiny from this share of its answers on that narrow supports have.
SHINY = 0.25
# A pixel is a mirror from this share on.
MIRROR = 0.5
# From this alpha on a pixel shows nothing of the world behind.
SOLID = 0.995


@dataclass(frozen=True)
class Answers:
    """A field as a matrix: n pixels of two of its proxies, M cells.

    Parameters
    ----------
    cells : Cells
    values : (3, M, n) float32
        Scene-linear radiance by colour, cell and pixel, of a cell that shines with radiance 1. The
        first pixels are those of the small proxy, row by row.
    small, fine : Field
        The proxies.
    factors : tuple of int
        How many pixels a side a pixel of either covers.
    shiny : (m,) int
        The pixels of the finer proxy, which are the last m of n.
    alpha : (n,) float64
    mirrors : (h, w) bool, optional
        The pixels of the small proxy that nearly nothing but narrow supports light: they show what
        light there is, whatever it is.
    """

    cells: Cells
    values: NDArray[np.float32]
    small: Field
    fine: Field
    factors: tuple[int, int]
    shiny: NDArray[np.intp]
    alpha: NDArray[np.float64]
    mirrors: NDArray[np.bool_] | None = None

    @staticmethod
    def of(preview: Preview, most: int = MOST) -> Answers:
        """Compute the matrix of a shot; of a shot with shadow catchers, that of its things.

        Parameters
        ----------
        preview : Preview
        most : int
            The most cells.

        Returns
        -------
        Answers

        Raises
        ------
        FieldError
            The field is damaged.
        """
        height, width = preview.takes[0].shape
        enough = [f for f in preview.factors if height * width <= PIXELS * f * f]
        factor = min(enough, default=max(preview.factors))
        small = preview.level(factor)[-1]
        fine, finer, shiny = small, factor, np.empty(0, np.intp)
        for other in sorted((f for f in preview.factors if f < factor), reverse=True):
            field = preview.level(other)[-1]
            found = np.flatnonzero(_shares_of_narrow(field) > SHINY)
            if len(found) > FINE_PIXELS:
                break
            fine, finer, shiny = field, other, found
        cells = cells_for(fine, most)
        values = answers(small, cells)
        alpha = small.layer("alpha").ravel()
        if len(shiny):
            values = np.concatenate([values, answers(fine, cells, shiny)], axis=-1)
            alpha = np.concatenate([alpha, fine.layer("alpha").ravel()[shiny]])
        mirrors = (_shares_of_narrow(small) > MIRROR).reshape(small.shape)
        factors, alpha = (factor, finer), alpha.astype(np.float64)
        return Answers(cells, values, small, fine, factors, shiny, alpha, mirrors)

    def refined(self, sides: NDArray[np.intp]) -> Answers:
        """Cut patches into more cells.

        Parameters
        ----------
        sides : (K,) int
            Cells a side of each patch.

        Returns
        -------
        Answers
            Patches that are cut as before keep their columns.
        """
        old, cells = self.cells, Cells(self.cells.hemicube, sides)
        changed = np.flatnonzero(sides != old.sides)
        values = np.empty((3, cells.count, self.values.shape[-1]), np.float32)
        of_old = np.repeat(sides == old.sides, old.sides**2)
        of_new = np.repeat(sides == old.sides, sides**2)
        values[:, of_new] = self.values[:, of_old]
        new = answers(self.small, cells, None, changed)
        if len(self.shiny):
            fine = answers(self.fine, cells, self.shiny, changed)
            new = np.concatenate([new, fine], axis=-1)
        values[:, ~of_new] = new[:, ~of_new]
        return replace(self, cells=cells, values=values)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the small proxy's pictures."""
        return self.small.shape

    @property
    def solid(self) -> NDArray[np.bool_]:
        """(n,) bool: the pixels that show nothing of the world behind."""
        return self.alpha >= SOLID

    @property
    def sizes(self) -> NDArray[np.float64]:
        """(n,) float64: how much of the picture each pixel stands for, in pixels of the small
        proxy."""
        out = np.ones(self.values.shape[-1])
        out[self.small.shape[0] * self.small.shape[1] :] = (self.factors[1] / self.factors[0]) ** 2
        return out

    def columns(self, picture: NDArray) -> NDArray[np.float64]:
        """Bring a picture of the shot's size to the pixels of the matrix.

        Parameters
        ----------
        picture : (H, W) or (H, W, C) float

        Returns
        -------
        (n,) or (n, C) float64
        """
        rest = picture.shape[2:]
        out = smaller(picture, self.small.shape, self.factors[0]).reshape(-1, *rest)
        if not len(self.shiny):
            return out
        fine = smaller(picture, self.fine.shape, self.factors[1]).reshape(-1, *rest)
        return np.concatenate([out, fine[self.shiny]])

    def layer(self, name: str) -> NDArray[np.float64]:
        """Give a layer of colour of the field, such as `own`, at the pixels of the matrix.

        Parameters
        ----------
        name : str

        Returns
        -------
        (n, 3) float64
        """
        out = self.small.layer(name).reshape(-1, 3)
        if len(self.shiny):
            out = np.concatenate([out, self.fine.layer(name).reshape(-1, 3)[self.shiny]])
        return out.astype(np.float64)

    def picture(self, radiance: NDArray) -> NDArray[np.float64]:
        """Compute what light on the cells shows, without the scene's own lamps.

        Parameters
        ----------
        radiance : (M, 3) float
            Scene-linear.

        Returns
        -------
        (n, 3) float64
            Scene-linear radiance.
        """
        lit = [radiance[:, c].astype(np.float32) @ self.values[c] for c in range(3)]
        return np.stack(lit, axis=-1).astype(np.float64)

    def under(self, environment: Environment) -> NDArray[np.float64]:
        """Compute what an environment shows, without the scene's own lamps.

        Parameters
        ----------
        environment : Environment

        Returns
        -------
        (n, 3) float64
            Scene-linear radiance.
        """
        return self.picture(self.cells.radiance(environment))

    def image(self, columns: NDArray) -> NDArray:
        """Give the small proxy's picture of what the pixels of the matrix show.

        Parameters
        ----------
        columns : (n, ...)

        Returns
        -------
        (H, W, ...)
        """
        height, width = self.shape
        return columns[: height * width].reshape(height, width, *columns.shape[1:])


def answers(
    field: Field,
    cells: Cells,
    pixels: NDArray[np.intp] | None = None,
    patches: NDArray[np.intp] | None = None,
) -> NDArray[np.float32]:
    """Compute the picture that each cell makes when it alone shines, with radiance 1.

    Parameters
    ----------
    field : Field
        A small one, as a proxy is.
    cells : Cells
    pixels : (n,) int, optional
        The pixels, row by row of the picture; all by default.
    patches : (k,) int, optional
        The patches whose cells shine; all by default. The rows of others are 0.

    Returns
    -------
    (3, M, n) float32
        Scene-linear radiance by colour, cell and pixel. 0 where nothing was captured. Light that
        falls below 0, as a plane beside a bright spot does, is kept, as `relight` keeps it.

    Raises
    ------
    FieldError
        The field is damaged.
    """
    height, width = field.shape
    column = np.arange(height * width)
    if pixels is not None:
        column[:] = -1
        column[pixels] = np.arange(len(pixels))
    out = np.zeros((3, cells.count, height * width if pixels is None else len(pixels)), np.float32)
    lit = np.ones(len(cells.sides), bool)
    if patches is not None:
        lit[:] = False
        lit[patches] = True
    lights = list(cells.lights())
    for light in lights:
        light.polynomial((0,))  # what all threads share is worked out before they start
    for tile in field.tiles:
        tile.open()
        places = column[_places(tile, width)]
        with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
            jobs = [
                pool.submit(_add_block, out, tile, block, places, cells, lights, lit)
                for block in range(len(tile.blocks))
            ]
            for job in jobs:
                job.result()
    return out


def _places(tile: Tile, width: int) -> NDArray[np.intp]:
    """Where the pixels of a tile are in the whole picture, row by row."""
    r = tile.region
    rows, columns = np.divmod(np.arange(r.pixels), r.width)
    return (rows + r.y) * width + columns + r.x


def _shares_of_narrow(field: Field) -> NDArray[np.float64]:
    """How much of each pixel's answers to light narrow supports have, 0 to 1."""
    height, width = field.shape
    every, narrow = np.zeros(height * width), np.zeros(height * width)
    for tile in field.tiles:
        tile.open()
        places = _places(tile, width)
        for model in tile.models:
            for block, where in enumerate(tile.blocks):
                mine = places[where]
                for k in np.flatnonzero(model.counts[block]).tolist():
                    met = mine[model.pixels(block, k)]
                    light = model.codes[1, model.at(block, k)].astype(np.float64) ** 2
                    every[met] += light
                    if model.support.code in NARROW:
                        narrow[met] += light
    return np.divide(narrow, every, out=narrow, where=every > 0)


def _add_block(
    out: NDArray[np.float32],
    tile: Tile,
    block: int,
    places: NDArray[np.intp],
    cells: Cells,
    lights: list[PatchLight],
    lit: NDArray[np.bool_],
) -> None:
    """Add the answers of a block. places: where the tile's pixels are in `out`, -1 for nowhere.

    lit: (K,), the patches whose cells shine.
    """
    where = tile.blocks[block]
    ones, mine = tile.ones(where).T, places[where]
    if (mine < 0).all():
        return
    for model in tile.models:
        for k in np.flatnonzero((model.counts[block] > 0) & lit).tolist():
            at, pixels = model.at(block, k), model.pixels(block, k)
            some = np.flatnonzero(mine[pixels] >= 0)
            if not len(some):
                continue
            to = mine[pixels[some]]
            reflects = model.shares(at)[:, some] * ones[:, pixels[some]]
            given = model.parameters_of(at)[some]
            first, count = int(cells.starts[k]), int(cells.sides[k] ** 2)
            for t in range(-(-count // 3)):
                found = model.support.average(lights[t], k, given).astype(np.float32).T
                for i in range(min(3, count - 3 * t)):
                    for c in range(3):
                        out[c, first + 3 * t + i][to] += reflects[c] * found[i]
    _add_rest(out, tile, where, mine, cells, lit)


def _add_rest(
    out: NDArray[np.float32],
    tile: Tile,
    where: slice,
    mine: NDArray[np.intp],
    cells: Cells,
    lit: NDArray[np.bool_],
) -> None:
    """Add what was too small to be an entry, see `Tile.rest`: it sees patches evenly."""
    weights = tile.rest_weights
    if weights is None:
        return
    bits = np.unpackbits(tile.rest_patches[:, where], axis=0, count=tile.patches, bitorder="little")
    share = bits * weights[:, None]
    total = share.sum(axis=0)
    np.divide(share, total, out=share, where=total > 0)
    rest = tile.rest(where).T
    whole = np.add.reduceat(cells.solid_angles, cells.starts[:-1])
    for k in np.flatnonzero(bits.any(axis=1) & lit).tolist():
        there = np.flatnonzero(bits[k].astype(bool) & (mine >= 0))
        light = share[k, there] * rest[:, there]
        for j in range(int(cells.starts[k]), int(cells.starts[k + 1])):
            part = np.float32(cells.solid_angles[j] / whole[k])
            for c in range(3):
                out[c, j][mine[there]] += part * light[c]
