"""Relighting: I(p) = sum over patches k of R(p, k) <S(p, k), L_k> (paper 3 and 6).

Examples
--------
>>> plate = np.array([[[0.2, 0.2, 0.2, 0.5]]])  # premultiplied, half covered
>>> over(plate, np.full((1, 1, 3), 0.6)).round(6).tolist()
[[[0.5, 0.5, 0.5, 1.0]]]
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .field.field import Field
from .field.model import Model
from .field.through import opaque
from .field.tile import Tile
from .light.light import PatchLight
from .lights import ROOM, Lights
from .region import Region

# The most lights that are added up at a time, and the most bytes that their pictures take.
TOGETHER, PICTURES = 24, 1 << 30
# So many entries of models that are no planes are evaluated at a time: they fit the cache.
AT_ONCE = 1 << 12


def together(field: Field) -> int:
    """Choose how many lights are added up at a time, so that their pictures fit the memory.

    Parameters
    ----------
    field : Field

    Returns
    -------
    int
    """
    height, width = field.shape
    return max(1, min(TOGETHER, PICTURES // (16 * height * width)))


def relight(
    field: Field, light: PatchLight, own: float = 1.0, region: Region | None = None
) -> NDArray[np.float32]:
    """Compute the picture of a field under a light. The picture is linear in the light.

    Parameters
    ----------
    field : Field
    light : PatchLight
    own : float
        The factor for the light of the scene's own lamps.
    region : Region, optional
        The part of the picture that is computed and read; by default all of it.

    Returns
    -------
    (H, W, 4) float32
        The picture or the region: scene-linear radiance with premultiplied alpha, transparent where
        nothing was captured.

    Raises
    ------
    FieldError
        The field is damaged.

    Source
    ------
    Paper 3, equation of the reflectance field; paper 6.
    """
    return relights(field, [light], own, region)[0]


def relights(
    field: Field,
    lights: Sequence[PatchLight],
    own: float = 1.0,
    region: Region | None = None,
    cut: bool = False,
) -> list[NDArray[np.float32]]:
    """Compute the pictures of a field under several lights. The field is read and unpacked once.

    Parameters
    ----------
    field : Field
    lights : sequence of PatchLight
        `together` says for how many lights the pictures fit the memory.
    own : float
        The factor for the light of the scene's own lamps.
    region : Region, optional
        The part of the picture that is computed and read; by default all of it.
    cut : bool
        Whether the light of a patch is cut at 0. A plane fitted to a bright spot undershoots beside
        it, which would hurt where pictures are divided by each other.

    Returns
    -------
    list of (H, W, 4) float32
        As `relight` gives.

    Raises
    ------
    FieldError
        The field is damaged.
    """
    if not lights:
        return []
    height, width = field.shape
    asked = region or Region(0, 0, width, height)
    outs = [np.zeros((asked.height, asked.width, 4), np.float32) for _ in lights]
    for tile in field.tiles:
        shared = tile.region.overlap(asked)
        if shared is None:
            continue
        rows = slice(shared.y - tile.region.y, shared.y - tile.region.y + shared.height)
        columns = slice(shared.x - tile.region.x, shared.x - tile.region.x + shared.width)
        n = tile.region.width
        found = _light(tile, lights, slice(rows.start * n, rows.stop * n), cut)
        alpha = tile.layer("alpha", (rows, columns))
        lamps = np.float32(own) * tile.layer("own", (rows, columns)) if own else None
        at = Region(shared.x - asked.x, shared.y - asked.y, shared.width, shared.height)
        for out, pixels in zip(outs, found, strict=True):
            picture = pixels.reshape(-1, n, 3)[:, columns]
            if lamps is not None:
                picture = picture + lamps
            out[at.slices] = np.dstack([picture, alpha])
    return outs


def _light(
    tile: Tile, lights: Sequence[PatchLight], asked: slice, cut: bool
) -> NDArray[np.float32]:
    """The light of all patches on some pixels of a tile -> (L, n, 3)."""
    tile.open()  # here, so that an error is raised before the threads start
    blocks = [i for i, b in enumerate(tile.blocks) if b.stop > asked.start and b.start < asked.stop]
    out = np.empty((len(lights), asked.stop - asked.start, 3), np.float32)
    threads = os.cpu_count() or 1

    def put(i: int, where: slice, light: NDArray[np.float32]) -> None:
        inside = slice(max(where.start, asked.start), min(where.stop, asked.stop))
        to = slice(inside.start - asked.start, inside.stop - asked.start)
        out[i, to] = light[inside.start - where.start : inside.stop - where.start]

    # a matrix product cannot cut the light of each patch at 0
    add = _one_by_one if len(lights) == 1 or cut else _together
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(add(tile, lights, cut, threads, put), blocks))
    return out


Put = Callable[[int, slice, NDArray[np.float32]], None]


def _one_by_one(
    tile: Tile, lights: Sequence[PatchLight], cut: bool, threads: int, put: Put
) -> Callable[[int], None]:
    """Make the function that adds up a block for each light by itself."""
    # what all blocks share is worked out before the threads start
    tables = [_rest_tables(tile, light) for light in lights]
    rooms = [_Room(cut) for _ in range(threads)]

    def add(block: int) -> None:
        where, room = tile.blocks[block], rooms.pop()
        ones = tile.ones(where)
        for i, (light, of) in enumerate(zip(lights, tables, strict=True)):
            total = np.zeros((where.stop - where.start, 4), np.float32)
            for model in tile.models:
                for some in _groups(model, block, light):
                    room.add(total, model, block, some, light)
            found = total[:, :3] * ones
            if of is not None:
                found += _rest_light(tile, of, where)
            put(i, where, found)
        rooms.append(room)

    return add


def _together(
    tile: Tile, lights: Sequence[PatchLight], cut: bool, threads: int, put: Put
) -> Callable[[int], None]:
    """Make the function that adds up a block for all lights at once, as matrices (`lights`)."""
    every = Lights(tile, lights)
    rooms = [_Room(cut) for _ in range(threads)]

    def add(block: int) -> None:
        where, room = tile.blocks[block], rooms.pop()
        n = where.stop - where.start
        total = np.zeros((3, len(lights), n), np.float32)
        for model in tile.models:
            if every.has(model):
                every.add(total, model, block, room.wide)
                continue
            for i, light in enumerate(lights):
                alone = np.zeros((n, 4), np.float32)
                for some in _groups(model, block, light):
                    room.add(alone, model, block, some, light)
                total[:, i] += alone[:, :3].T
        total *= tile.ones(where).T[:, None]
        rest = every.rest(where)
        if rest is not None:
            total += rest
        for i in range(len(lights)):
            put(i, where, total[:, i].T)
        rooms.append(room)

    return add


class _Room:
    """The memory that a thread works in.

    To allocate it anew for each patch would take longer than the sum and hold up the other threads.
    """

    def __init__(self, cut: bool) -> None:
        self._parts: dict[str, NDArray[np.float32]] = {}
        self._least = np.float32(0 if cut else -np.inf)

    @cached_property
    def wide(self) -> NDArray[np.float32]:
        """`lights.ROOM` bytes."""
        return np.empty(ROOM // 4, np.float32)

    def _part(self, name: str, rows: int, n: int) -> NDArray[np.float32]:
        if name not in self._parts or self._parts[name].size < rows * n:
            self._parts[name] = np.empty(rows * n, np.float32)
        return self._parts[name][: rows * n].reshape(rows, n)

    def add(
        self,
        total: NDArray[np.float32],
        model: Model,
        block: int,
        some: list[int],
        light: PatchLight,
    ) -> None:
        """Add the light of some patches' entries to a block, (n, 4), in units of its `ones`."""
        at = slice(model.at(block, some[0]).start, model.at(block, some[-1]).stop)
        n = at.stop - at.start
        values = self._part("values", 3, n)
        values[...] = model.codes[:, at]
        values *= values
        plane = model.support.plane(light, some[0])
        if plane is None:
            of = np.repeat(some, model.counts[block, some])
            averages = model.support.average(light, of, model.parameters_of(at)).T
            values *= np.maximum(averages, self._least)
        else:
            constant, slopes = plane
            parameters = self._part("parameters", slopes.shape[1], n)
            parameters[...] = model.parameters[:, at]
            averages = self._part("averages", 3, n)
            np.matmul(slopes / model.end, parameters, out=averages)
            averages += constant[:, None]
            if self._least == 0:
                np.maximum(averages, 0, out=averages)
            values *= averages
        done = 0
        for k in some:
            pixels = model.pixels(block, k)
            self._put(total, pixels, values[:, done : done + len(pixels)])
            done += len(pixels)

    def _put(
        self, total: NDArray[np.float32], pixels: NDArray, values: NDArray[np.float32]
    ) -> None:
        """Add values (3, n) to pixels (n,) that are each another one."""
        n = len(pixels)
        # the same as `total[pixels] += values.T`, but each pixel moves as one number of 16 bytes;
        # with mode="clip" numpy makes no copy
        sums = self._part("sums", n, 4)
        ones, places = sums.view(np.complex128)[:, 0], total.view(np.complex128)[:, 0]
        places.take(pixels, out=ones, mode="clip")
        for c in range(3):
            sums[:, c] += values[c]
        places[pixels] = ones


def _groups(model: Model, block: int, light: PatchLight) -> Iterator[list[int]]:
    """The patches that have entries in a block, in groups that are evaluated at once."""
    counts = model.counts[block]
    there = np.flatnonzero(counts)
    if not len(there):
        return
    # a plane is each patch's own; the others are short, so that most of their time would be calls
    alone = model.support.plane(light, int(there[0])) is not None
    group, n = [], 0
    for k in there.tolist():
        group.append(k)
        n += int(counts[k])
        if alone or n >= AT_ONCE:
            yield group
            group, n = [], 0
    if group:
        yield group


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
    """(n, 3): the light of the dropped entries, as the rest's R times a mean radiance.

    The mean is over the patches that were dropped in a pixel. Each patch has the weight of all that
    was dropped of it in the tile.
    """
    total = np.zeros((where.stop - where.start, 4), np.float32)
    for table, patches in zip(tables, tile.rest_patches[:, where], strict=True):
        total += table.take(patches, axis=0)
    weight = total[:, 3:]
    np.divide(total, weight, out=total, where=weight > 0)
    return tile.rest(where) * total[:, :3]


def over(
    plate: NDArray, background: NDArray, through: NDArray | None = None
) -> NDArray[np.float32]:
    """Lay a plate over an opaque background.

    Parameters
    ----------
    plate : (H, W, 4) float
        Scene-linear, premultiplied.
    background : (H, W, 3) float
        Scene-linear.
    through : (H, W, 3) float, optional
        How much of the background is seen, by channel; by default 1 - alpha.

    Returns
    -------
    (H, W, 4) float32
        Opaque, but for the holes that `through` leaves.
    """
    out = plate.astype(np.float32, copy=True)
    if through is None:
        out[..., :3] += (1 - plate[..., 3:]) * background
        out[..., 3] = 1
    else:
        out[..., :3] += through * background
        out[..., 3] = opaque(plate[..., 3], through)
    return out
