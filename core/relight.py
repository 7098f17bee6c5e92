"""Relighting: I(p) = sum over patches k of R(p, k) <S(p, k), L_k> (paper 3 and 6)."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from .field import Field
from .field_tile import Model, Tile
from .light import PatchLight
from .region import Region


def relight(
    field: Field, light: PatchLight, own: float = 1.0, region: Region | None = None
) -> NDArray[np.float32]:
    """The picture under `light`.

    own: how much of the scene's own lamps to add; region: the part of the picture that is wanted,
    and read (default: all of it). -> (H, W, 4) float32 of the picture or the region, scene-linear
    radiance with premultiplied alpha; transparent outside the captured region. Linear in the light.
    """
    height, width = field.shape
    asked = region or Region(0, 0, width, height)
    out = np.zeros((asked.height, asked.width, 4), np.float32)
    for tile in field.tiles:
        shared = tile.region.overlap(asked)
        if shared is None:
            continue
        rows = slice(shared.y - tile.region.y, shared.y - tile.region.y + shared.height)
        columns = slice(shared.x - tile.region.x, shared.x - tile.region.x + shared.width)
        n = tile.region.width
        picture = _light(tile, light, slice(rows.start * n, rows.stop * n)).reshape(-1, n, 3)
        picture = picture[:, columns]
        if own:
            picture = picture + np.float32(own) * tile.layer("own", (rows, columns))
        alpha = tile.layer("alpha", (rows, columns))
        at = Region(shared.x - asked.x, shared.y - asked.y, shared.width, shared.height)
        out[at.slices] = np.dstack([picture, alpha])
    return out


def _light(tile: Tile, light: PatchLight, asked: slice) -> NDArray[np.float32]:
    """The light of all patches on some pixels of a tile -> (n, 3)."""
    tile.open()  # which may fail: here, and not in the threads
    # what all blocks share is worked out before the threads start
    tables = _rest_tables(tile, light)
    out = np.empty((asked.stop - asked.start, 3), np.float32)

    rooms = [_Room() for _ in range(os.cpu_count() or 1)]

    def add(block: int) -> None:
        where = tile.blocks[block]
        total = np.zeros((where.stop - where.start, 4), np.float32)
        room = rooms.pop()
        for model in tile.models:
            for k in np.flatnonzero(model.counts[block]).tolist():
                room.add(total, model, block, k, light)
        rooms.append(room)
        light_of = total[:, :3] * tile.ones(where)
        if tables is not None:
            light_of += _rest_light(tile, tables, where)
        inside = slice(max(where.start, asked.start), min(where.stop, asked.stop))
        first, last = inside.start - where.start, inside.stop - where.start
        out[inside.start - asked.start : inside.stop - asked.start] = light_of[first:last]

    blocks = [i for i, b in enumerate(tile.blocks) if b.stop > asked.start and b.start < asked.stop]
    with ThreadPoolExecutor(len(rooms)) as pool:
        list(pool.map(add, blocks))
    return out


class _Room:
    """Memory that a thread works in: making it anew for each patch would take longer than the sum,
    and hold up the other threads."""

    def __init__(self) -> None:
        self._parts: dict[str, NDArray[np.float32]] = {}

    def _part(self, name: str, rows: int, n: int) -> NDArray[np.float32]:
        if name not in self._parts or self._parts[name].size < rows * n:
            self._parts[name] = np.empty(rows * n, np.float32)
        return self._parts[name][: rows * n].reshape(rows, n)

    def add(
        self, total: NDArray[np.float32], model: Model, block: int, k: int, light: PatchLight
    ) -> None:
        """Add the light of patch k's entries to a block, (n, 4), in units of its `ones`."""
        at = model.at(block, k)
        n = at.stop - at.start
        values = self._part("values", 3, n)
        values[...] = model.codes[:, at]
        values *= values
        plane = model.support.plane(light, k)
        if plane is None:
            values *= model.support.average(light, k, model.parameters_of(at)).T
        else:
            constant, slopes = plane
            parameters = self._part("parameters", slopes.shape[1], n)
            parameters[...] = model.parameters[:, at]
            averages = self._part("averages", 3, n)
            np.matmul(slopes / model.end, parameters, out=averages)
            averages += constant[:, None]
            values *= averages
        pixels = model.pixels(block, k)
        # as `total[pixels] += values.T`, but that a pixel is moved as one number of 16 bytes; clip
        # because that is numpy's way without a copy
        sums = self._part("sums", n, 4)
        ones, places = sums.view(np.complex128)[:, 0], total.view(np.complex128)[:, 0]
        places.take(pixels, out=ones, mode="clip")
        for c in range(3):
            sums[:, c] += values[c]
        places[pixels] = ones


def _rest_tables(tile: Tile, light: PatchLight) -> NDArray[np.float32] | None:
    """What each byte of `rest_patches` says: (ceil(K / 8), 256, 4), the sum over its patches of
    weight times mean radiance, and of the weights."""
    weights = tile.rest_weights
    if weights is None:
        return None
    of = np.zeros((-(-tile.patches // 8) * 8, 4))
    of[: tile.patches, :3] = weights[:, None] * light.whole
    of[: tile.patches, 3] = weights
    bits = np.unpackbits(np.arange(256, dtype=np.uint8)[:, None], axis=1, bitorder="little")
    return (bits.astype(float) @ of.reshape(-1, 8, 4)).astype(np.float32)


def _rest_light(tile: Tile, tables: NDArray[np.float32], where: slice) -> NDArray[np.float32]:
    """(n, 3): the rest's R times the mean radiance of the patches that were dropped there, each
    counting as much as was dropped of it in all the tile."""
    total = np.zeros((where.stop - where.start, 4), np.float32)
    for table, patches in zip(tables, tile.rest_patches[:, where], strict=True):
        total += table.take(patches, axis=0)
    weight = total[:, 3:]
    np.divide(total, weight, out=total, where=weight > 0)
    return tile.rest(where) * total[:, :3]


def over(plate: NDArray, background: NDArray) -> NDArray[np.float32]:
    """The plate (premultiplied RGBA) over an opaque background (H, W, 3) -> opaque RGBA."""
    out = plate.astype(np.float32, copy=True)
    out[..., :3] += (1 - plate[..., 3:]) * background
    out[..., 3] = 1
    return out
