"""Proxies: a field at a half, a quarter and an eighth of its size, for previews and thumbnails.

A pixel of a proxy is the mean of those that it covers. Coefficients and moments add up, so where
supports are moments its picture is the mean of the picture's pixels, exactly; of boxes, what covers
them all is kept where most of the light is theirs. A field of other models has none.

>>> tile = TileWriter(Region(0, 0, 8, 8), {})
>>> light = np.ones((64, 3))
>>> tile.add(np.full(64, WHOLE.code, np.uint8), light, {WHOLE.code: np.empty((64, 0))})
>>> {f: small.region.pixels for f, small in proxies(tile, Hemicube(patches=1)).items()}
{2: 16, 4: 4, 8: 1}
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..hemicube import Hemicube
from ..measure import box_averages, box_of
from ..patterns import UU, VV, U, V
from ..region import Region
from ..supports import BELL, BOX, LEANING, LINEAR, WHOLE
from ..supports.bell import bells_of, moments_of
from .tile_writer import TileWriter

FACTORS = (2, 4, 8)
BELLS = BELL.code, LEANING.code


def proxies(tile: TileWriter, hemicube: Hemicube, first: bool = True) -> dict[int, TileWriter]:
    """The proxies of a tile.

    Parameters
    ----------
    tile : TileWriter
        What was fitted.
    hemicube : Hemicube
        Its patches.
    first : bool
        Whether the tile is the topmost. Another one must begin with a pixel of the proxy, which no
        two tiles can share.

    Returns
    -------
    dict of int to TileWriter
        By how many pixels a side one pixel of the proxy covers.
    """
    found: dict[int, TileWriter] = {}
    if not set(tile.models) <= {WHOLE.code, LINEAR.code, BOX.code, *BELLS}:
        return found
    last, y = tile, tile.region.y
    for factor in FACTORS:
        if y % factor and not first:
            break
        found[factor] = last = _halved(last, hemicube)
    return found


class _Grid:
    """Which pixel of a proxy covers each pixel of a region, and how many it covers."""

    def __init__(self, region: Region) -> None:
        self.region = region
        x0, y0 = region.x // 2, region.y // 2
        x1, y1 = -(-(region.x + region.width) // 2), -(-(region.y + region.height) // 2)
        self.half = Region(x0, y0, x1 - x0, y1 - y0)
        rows = (region.y + np.arange(region.height)) // 2 - y0
        columns = (region.x + np.arange(region.width)) // 2 - x0
        self.of = (rows[:, None] * self.half.width + columns).ravel()
        self.covers = np.bincount(self.of)

    def blocks(self, image: NDArray) -> NDArray:
        """(h, w, ...) -> (h', 2, w', 2, ...), with zeros where the region has no pixel."""
        top, left = self.region.y % 2, self.region.x % 2
        h, w = self.half.height, self.half.width
        room = np.zeros((2 * h, 2 * w, *image.shape[2:]), image.dtype)
        room[top : top + self.region.height, left : left + self.region.width] = image
        return room.reshape(h, 2, w, 2, *image.shape[2:])

    def mean(self, image: NDArray) -> NDArray:
        """(h, w, ...) -> (h', w', ...)."""
        total = self.blocks(image).sum(axis=(1, 3), dtype=np.float64)
        covers = self.covers.reshape(self.half.height, self.half.width)
        return total / covers.reshape(covers.shape + (1,) * (image.ndim - 2))

    def total(self, pixels: NDArray, values: NDArray) -> NDArray[np.float64]:
        """Sums of values (n,) at some pixels of the region -> (n',)."""
        return np.bincount(self.of[pixels], values, self.half.pixels)


def _halved(tile: TileWriter, hemicube: Hemicube) -> TileWriter:
    grid = _Grid(tile.region)
    shape = tile.region.height, tile.region.width
    # a mean of places is none
    layers = {name: grid.mean(p) for name, p in tile.layers.items() if name != "position"}
    half = TileWriter(grid.half, layers)
    of: dict[int, list[tuple[int, NDArray, NDArray, NDArray]]] = {}
    for code, patches in tile.models.items():
        for k, pixels, coefficient, parameters in patches:
            of.setdefault(k, []).append((code, pixels, coefficient, parameters))
    for k in range(tile.patches):
        if k in of:
            _merge(half, grid, of[k], hemicube, k)
        half.patches += 1
    half.rest = grid.mean(tile.rest.reshape(*shape, 3)).reshape(-1, 3)
    half.rest_of = tile.rest_of
    half.rest_bits = [
        np.bitwise_or.reduce(grid.blocks(bits.reshape(shape)), axis=(1, 3)).ravel()
        for bits in tile.rest_bits
    ]
    return half


def _merge(
    half: TileWriter,
    grid: _Grid,
    entries: list[tuple[int, NDArray, NDArray, NDArray]],
    hemicube: Hemicube,
    k: int,
) -> None:
    """Add a patch's entries to the proxy: (code, pixels, R, parameters) by model."""
    extent = hemicube.extent(k)
    whole = hemicube.uniform_moments(k)
    light = np.zeros((3, grid.half.pixels))
    # sums of R, all channels, times the mean place; and of the boxes' alone, with the squares
    places = np.zeros((2, grid.half.pixels))
    kinds = [code for code, *_ in entries if code in (BOX.code, *BELLS)]
    boxes = np.zeros((5, grid.half.pixels if kinds else 0))
    for code, pixels, coefficient, parameters in entries:
        size = coefficient[0] + coefficient[1] + coefficient[2]
        for row, channel in zip(light, coefficient, strict=True):
            row += grid.total(pixels, channel)
        if code in kinds:
            given = parameters.T / np.float64(65535)
            if code in BELLS:
                # a proxy's bells do not lean: its pixels are many of the field's
                u, uu, v, vv = moments_of(given[:, :4], extent)
            else:
                averages = box_averages(given, extent)
                u, uu, v, vv = (averages[m] for m in (U, UU, V, VV))
            for row, of in zip(boxes, (None, u, v, uu, vv), strict=True):
                row += grid.total(pixels, size if of is None else size * of)
        elif code == LINEAR.code:
            u, v = parameters / np.float32(255)
        else:
            u, v = whole[U], whole[V]
        places[0] += grid.total(pixels, size * u)
        places[1] += grid.total(pixels, size * v)
    total = light[0] + light[1] + light[2]
    lit = np.flatnonzero(total > 0)
    most = boxes[0, lit] > total[lit] / 2 if boxes.size else np.zeros(len(lit), bool)
    light /= grid.covers
    plain, narrow = lit[~most], lit[most]
    means = places[:, plain] / total[plain]
    half.add_entries(LINEAR.code, plain, light[:, plain], means)
    if len(narrow):
        _, u, v, uu, vv = boxes[:, narrow] / boxes[0, narrow]
        spread = np.maximum(uu - u * u, 0), np.maximum(vv - v * v, 0)
        bells = kinds[0] in BELLS
        shaped = bells_of if bells else box_of
        half.add_entries(
            BELL.code if bells else BOX.code,
            narrow,
            light[:, narrow],
            shaped((u, v), spread, extent).T,
        )
