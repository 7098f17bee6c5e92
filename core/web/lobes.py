"""Lobes: what mirrors and clear things show, as a few directions for each pixel.

A sum of few components blurs what a mirror shows. So the narrow supports of a pixel are taken out
of the field: those that lie together become one lobe, which has a direction, a width along and
across, a slant and a colour. A viewer looks there on the map of the light.

Examples
--------
Two narrow supports of a pixel that lie together become one lobe, and a third one another:

>>> toward = np.array([[0.0, 0.0, 1.0], [0.01, 0.0, 1.0], [1.0, 0.0, 0.0]])
>>> toward /= np.linalg.norm(toward, axis=-1, keepdims=True)
>>> narrow = Narrow(np.array([5, 5, 5]), toward, np.zeros((3, 3, 3)), np.ones((3, 3)))
>>> found, left = gathered(narrow, 8, np.full(8, 3.0))
>>> [one.pixels.tolist() for one in found], left.tolist()
([[5], [5]], [False, False, False])
>>> found[0].colour.tolist()
[[2.0, 2.0, 2.0]]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..field.tile import Tile
from ..hemicube import Hemicube
from ..supports import BELL, BOX, LEANING

# The models that see a part of a patch, and can be a lobe.
NARROW = (BOX.code, BELL.code, LEANING.code)
# The most lobes of a pixel.
MOST = 4
# What is wider, as a standard deviation in radians, is no lobe: the components show it well.
WIDEST = np.radians(9.0)
# Supports lie together if they are nearer than this many of their widths, or than this angle.
NEAR, NEAREST = 2.5, np.radians(2.5)
# A lobe with a smaller share of its pixel's light is left to the components.
LEAST = 0.01


@dataclass(frozen=True)
class Narrow:
    """Narrow supports of some pixels.

    Parameters
    ----------
    pixels : (n,) int
    toward : (n, 3) float64
        Unit vectors in the world.
    spread : (n, 3, 3) float64
        The covariance of the directions.
    light : (n, 3) float
        The reflection coefficients, by channel.
    """

    pixels: NDArray[np.intp]
    toward: NDArray[np.float64]
    spread: NDArray[np.float64]
    light: NDArray[np.float64]

    def of(self, some: NDArray) -> Narrow:
        """Take some of them.

        Parameters
        ----------
        some : (n,) bool or (m,) int

        Returns
        -------
        Narrow
        """
        return Narrow(self.pixels[some], self.toward[some], self.spread[some], self.light[some])


@dataclass(frozen=True)
class Lobes:
    """A lobe for each of some pixels.

    Parameters
    ----------
    pixels : (n,) int
    toward : (n, 3) float64
        Unit vectors in the world.
    along, across : (n,) float64
        Standard deviations in radians along the longest axis and across it.
    slant : (n,) float64
        The angle of the longest axis in the plane of `axes`, in radians, 0 to pi.
    colour : (n, 3) float64
        The reflection coefficients, by channel.
    """

    pixels: NDArray[np.intp]
    toward: NDArray[np.float64]
    along: NDArray[np.float64]
    across: NDArray[np.float64]
    slant: NDArray[np.float64]
    colour: NDArray[np.float64]


def axes(toward: NDArray) -> tuple[NDArray, NDArray]:
    """Give two axes across directions.

    Parameters
    ----------
    toward : (n, 3) float
        Unit vectors.

    Returns
    -------
    right, up : (n, 3) float
        Unit vectors: level where the direction is no pole, and upright to both.
    """
    x, y, z = toward[:, 0], toward[:, 1], toward[:, 2]
    flat = np.hypot(x, y)
    pole = flat < 1e-4
    flat = np.where(pole, 1, flat)
    right = np.stack(
        [np.where(pole, 1, -y / flat), np.where(pole, 0, x / flat), np.zeros_like(z)], axis=-1
    )
    return right, np.cross(toward, right)


def supports_of(
    hemicube: Hemicube, code: int, k: int, parameters: NDArray
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Find where narrow supports of a patch look, and how wide.

    Parameters
    ----------
    hemicube : Hemicube
    code : int
        One of `NARROW`.
    k : int
        The patch.
    parameters : (n, p) float

    Returns
    -------
    toward : (n, 3) float64
        Unit vectors.
    spread : (n, 3, 3) float64
        The covariance of the directions.
    """
    given = parameters.astype(np.float64)
    if code == BOX.code:
        u, v = (given[:, 0] + given[:, 1]) / 2, (given[:, 2] + given[:, 3]) / 2
        half_u, half_v = (given[:, 1] - given[:, 0]) / 2, (given[:, 3] - given[:, 2]) / 2
    else:
        u, half_u, v, half_v = given[:, :4].T
    x0, x1, y0, y1 = hemicube.extents[k]
    _, right, up = hemicube.frame(hemicube.grid[k][0])
    toward = hemicube.directions(k, u, v)
    # how the unit vector moves with u and v: what is across it, by the distance of the plane
    x, y = x0 + (x1 - x0) * u, y0 + (y1 - y0) * v
    far = np.sqrt(1 + x * x + y * y)[:, None]
    step_u, step_v = (
        (axis - (toward @ axis)[:, None] * toward) * size / far
        for axis, size in ((right, x1 - x0), (up, y1 - y0))
    )
    a, b = step_u * (half_u / np.sqrt(3))[:, None], step_v * (half_v / np.sqrt(3))[:, None]
    spread = a[:, :, None] * a[:, None] + b[:, :, None] * b[:, None]
    if code == LEANING.code:
        both = a[:, :, None] * b[:, None]
        slant = np.clip(2 * given[:, 4] - 1, -1, 1)[:, None, None]
        spread += slant * (both + both.transpose(0, 2, 1))
    return toward, spread


def narrow_of(
    hemicube: Hemicube, tile: Tile, block: int
) -> tuple[Narrow, list[tuple[int, int, slice]]]:
    """Collect the narrow supports of a block of a tile.

    Parameters
    ----------
    hemicube : Hemicube
    tile : Tile
    block : int

    Returns
    -------
    found : Narrow
        Pixels are counted from the block's first.
    where : list of (int, int, slice)
        For each group of them, in order: the model's place in the tile's models, the patch, and
        where the group is among `found`.

    Raises
    ------
    FieldError
        The field is damaged.
    """
    ones = tile.ones(tile.blocks[block])
    parts: list[tuple[NDArray, ...]] = []
    where, n = [], 0
    for i, model in enumerate(tile.models):
        if model.support.code not in NARROW:
            continue
        for k in np.flatnonzero(model.counts[block]).tolist():
            at, pixels = model.at(block, k), model.pixels(block, k)
            toward, spread = supports_of(hemicube, model.support.code, k, model.parameters_of(at))
            light = model.shares(at).T * ones[pixels]
            parts.append((pixels.astype(np.intp), toward, spread, light.astype(np.float64)))
            where.append((i, k, slice(n, n + len(pixels))))
            n += len(pixels)
    if not parts:
        none = np.zeros((0, 3))
        return Narrow(np.zeros(0, np.intp), none, np.zeros((0, 3, 3)), none), []
    return Narrow(*(np.concatenate(each) for each in zip(*parts, strict=True))), where


def gathered(
    narrow: Narrow,
    count: int,
    white: NDArray,
    most: int = MOST,
    only: NDArray[np.bool_] | None = None,
) -> tuple[list[Lobes], NDArray[np.bool_]]:
    """Gather narrow supports into lobes, the strongest of each pixel first.

    Parameters
    ----------
    narrow : Narrow
    count : int
        How many pixels there are.
    white : (count,) float
        What each pixel shows in a light of radiance 1, the mean of the channels.
    most : int
        The most lobes of a pixel.
    only : (count,) bool, optional
        Which pixels may have lobes.

    Returns
    -------
    lobes : list of Lobes
        The first lobe of all pixels that have one, then the second, and so on.
    left : (n,) bool
        Which supports are in no lobe.
    """
    wide = np.sqrt(np.trace(narrow.spread, axis1=1, axis2=2) / 2)
    strength = narrow.light.mean(axis=-1)
    left = (wide < WIDEST) & (strength > 0)
    refused = ~left
    lobes = []
    for _ in range(most):
        some = np.flatnonzero(left)
        if not len(some):
            break
        # the strongest of each pixel
        order = some[np.lexsort((-strength[some], narrow.pixels[some]))]
        first = np.ones(len(order), bool)
        first[1:] = narrow.pixels[order[1:]] != narrow.pixels[order[:-1]]
        seed = np.full(count, -1, np.intp)
        seed[narrow.pixels[order[first]]] = order[first]
        of = seed[narrow.pixels[some]]
        cosine = np.einsum("ij,ij->i", narrow.toward[some], narrow.toward[of])
        reach = np.maximum(NEAREST, NEAR * np.maximum(wide[of], wide[some]))
        met = some[np.arccos(np.clip(cosine, -1, 1)) < reach]
        lobe = _joined(narrow.of(met), count)
        enough = lobe.colour.mean(axis=-1) >= LEAST * white[lobe.pixels]
        enough &= lobe.along < WIDEST
        if only is not None:
            enough &= only[lobe.pixels]
        good = np.zeros(count, bool)
        good[lobe.pixels[enough]] = True
        left[met] = False
        refused[met[~good[narrow.pixels[met]]]] = True
        lobes.append(_some(lobe, enough))
    return lobes, left | refused


def _some(lobe: Lobes, these: NDArray[np.bool_]) -> Lobes:
    return Lobes(
        *(
            getattr(lobe, name)[these]
            for name in ("pixels", "toward", "along", "across", "slant", "colour")
        )
    )


def _joined(narrow: Narrow, count: int) -> Lobes:
    """One lobe for each pixel of its supports, of the same mean direction and spread."""
    there = np.flatnonzero(np.bincount(narrow.pixels, minlength=count))
    of = np.searchsorted(there, narrow.pixels)

    def total(values: NDArray) -> NDArray:
        flat = values.reshape(len(values), -1).T
        sums = [np.bincount(of, row, len(there)) for row in flat]
        return np.stack(sums, axis=-1).reshape(len(there), *values.shape[1:])

    weight = narrow.light.mean(axis=-1)
    whole = np.maximum(total(weight), 1e-30)
    mean = total(narrow.toward * weight[:, None]) / whole[:, None]
    toward = mean / np.linalg.norm(mean, axis=-1, keepdims=True)
    apart = narrow.toward - toward[of]
    spread = narrow.spread + apart[:, :, None] * apart[:, None]
    spread = total(spread * weight[:, None, None]) / whole[:, None, None]
    right, up = axes(toward)
    a = np.einsum("ni,nij,nj->n", right, spread, right)
    b = np.einsum("ni,nij,nj->n", up, spread, up)
    c = np.einsum("ni,nij,nj->n", right, spread, up)
    middle, half = (a + b) / 2, np.hypot((a - b) / 2, c)
    slant = np.mod(np.arctan2(2 * c, a - b) / 2, np.pi)
    return Lobes(
        there,
        toward,
        np.sqrt(middle + half),
        np.sqrt(np.maximum(middle - half, 0)),
        slant,
        total(narrow.light),
    )
