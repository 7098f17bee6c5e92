"""Photographs in the light of one lamp at a time as a capture set: a Light Stage (paper 2, 8).

What is there without a lamp is taken off. It is a light of its own where the camera's darkness is
known too. The set is written tile by tile, within a budget of memory.

Examples
--------
>>> import tempfile
>>> from arto.core.capture.capture_set import CaptureSet
>>> from arto.core.photographs.description import Lamp, Photograph
>>> from arto.core.photographs.reader import InMemory
>>> lamps = (Lamp((0.0, 0.0, 1.0)), Lamp((1.0, 0.0, 1.0)))
>>> photos = tuple(Photograph(str(k), Kind.LIGHT, lamp=k) for k in (0, 1))
>>> grey = InMemory(np.full((4, 6, 3), 0.25), linear=True)
>>> there = Photographs(Path(), Description(photos, lamps), lambda path: grey)
>>> with tempfile.TemporaryDirectory() as folder:
...     for share in write(Path(folder), there):
...         pass
...     tile = CaptureSet(Path(folder)).read(0)
>>> tile.basis.shape, round(float(tile.basis.sum(axis=0).max()), 3)
((2, 1, 4, 6, 3), 0.5)
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import exr
from ..capture import head as heads
from ..capture.head import CaptureHead
from ..capture.names import COMBINED, group_name
from ..capture.tile_entry import TileEntry, sums_of
from ..errors import PhotographsError
from ..memory import memory
from ..patterns import pattern_set
from ..region import Region
from . import lamps as lamps_of_dome
from .description import Description, Kind
from .lamps import Lamps
from .opened import Photographs

# In a white world, without a white target: what is bright in the picture is as bright as this.
BRIGHT, OF_PIXELS = 0.5, 95.0
# Bytes of a pixel of one lamp while a tile is made, and the share of free memory that it may take.
BYTES, OF_MEMORY = 40, 0.25
LEAST = 64 << 20
# Pixels of the pictures by which the level is chosen.
SMALL = 1 << 18
# How different, of the brighter, a pixel of the empty set is from the thing: surely not, surely so.
SAME, OTHER = 0.04, 0.16
PATTERN = "white"


@dataclass(frozen=True)
class Written:
    """What was found while photographs became a capture set.

    Parameters
    ----------
    lamps : Lamps
    hole : float
        The share of all directions for which no lamp stands, 0 to 1.
    saturated : float
        The share of pixels that are saturated in every exposure of some lamp.
    level : float
        What the pictures were multiplied by, beside the lamps' strengths.
    reach : float
        Degrees around its direction for which a lamp stands.
    """

    lamps: Lamps
    hole: float
    saturated: float
    level: float
    reach: float = 180.0


def rows_at_once(count: int, width: int, budget: int | None = None) -> int:
    """Choose how many rows of a picture are worked on at a time.

    Parameters
    ----------
    count : int
        The lamps.
    width : int
        Of the picture.
    budget : int, optional
        Bytes; a share of what is free by default.

    Returns
    -------
    int
        At least 1.

    Examples
    --------
    >>> rows_at_once(64, 11600, 2 << 30)  # a photograph of 100 megapixels
    72
    """
    if budget is None:
        total, free = memory()
        budget = max(LEAST, int(OF_MEMORY * (total / 4 if free is None else free)))
    return max(1, budget // (count * width * BYTES))


def write(
    folder: Path, photos: Photographs, budget: int | None = None, **about: Any
) -> Generator[float, None, Written]:
    """Write the photographs of a dome as a capture set.

    Parameters
    ----------
    folder : Path
    photos : Photographs
    budget : int, optional
        Bytes of memory that may be taken.
    **about : object
        What else `capture.json` says, by its names there.

    Yields
    ------
    float
        The share that is done.

    Returns
    -------
    Written

    Raises
    ------
    CaptureSetError, ExrError
        The folder cannot be written.
    PhotographsError
        The lamps cannot be found, or a photograph cannot be read.
    """
    said = photos.said
    lamps_of_dome.check_lit(said)
    photos.check_light()
    count, (height, width) = len(said.lamps), photos.shape
    taking = _Taking(photos)
    found = lamps_of_dome.found(photos, taking.rows)
    hemicube = found.hemicube(said.view, said.reach)
    omega = hemicube.solid_angles[:, None]
    level = 1.0 if found.absolute else _level(taking, found, omega)
    gains = (level * omega / found.strengths).astype(np.float32)
    rows = rows_at_once(count, width, budget)
    tiles, saturated = [], 0
    for number, first in enumerate(range(0, height, rows)):
        last = min(first + rows, height)
        basis = np.empty((count, last - first, width, 3), np.float32)
        bright = np.zeros((last - first, width), bool)
        for k in range(count):
            basis[k], over = taking.rows(k, first, last)
            bright |= over
            yield 0.1 + 0.9 * (first + (last - first) * (k + 1) / (count + 1)) / height
        for near in found.near((height, width), first, last):
            at = (slice(near.rows.start - first, near.rows.stop - first), near.columns)
            there = basis[:, *at] * near.falls[..., None]
            basis[:, *at] = np.tensordot(near.turned.astype(np.float32), there, axes=1)
        alpha = taking.alpha(first, last)
        own = taking.own(first, last) * np.float32(level)
        np.maximum(basis, 0, out=basis)
        basis *= gains[:, None, None, :]
        basis *= alpha[..., None]
        saturated += int(bright.sum())
        tiles.append(_write_tile(folder, number, first, basis, own * alpha[..., None], alpha))
    said_so = {"choice": "whole", "separate": False, "route": "photographs"}
    head = CaptureHead(hemicube, pattern_set(PATTERN), height, width, tuple(tiles))
    heads.write(folder, heads.from_json(head.to_json() | said_so | about, folder))
    hole = max(0.0, 1 - float(hemicube.solid_angles.sum()) / (4 * np.pi))
    yield 1.0
    return Written(found, hole, saturated / (height * width), level, hemicube.reach)


def alpha_of(photos: Photographs) -> NDArray[np.float32]:
    """Say how much of each pixel is the thing: by the mask, or where the empty set differs.

    Parameters
    ----------
    photos : Photographs

    Returns
    -------
    (H, W) float32
        1 everywhere where neither is there.
    """
    return _Taking(photos).alpha(0, photos.shape[0])


def small_pictures(
    photos: Photographs, most: int = SMALL
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Read the light of each lamp in every n-th pixel.

    Parameters
    ----------
    photos : Photographs
    most : int
        Pixels of all lamps together, roughly.

    Returns
    -------
    light : (K, h, w, 3) float32
        Without what is there without the lamp; NaN where it is saturated.
    alpha : (h, w) float32
    """
    taking, count = _Taking(photos), len(photos.said.lamps)
    height, width = photos.shape
    step = max(1, int(np.sqrt(height * width * count / (16 * most))))
    pictures = []
    for k in range(count):
        light, bright = lamps_of_dome.small(taking.rows, k, photos.shape, step)
        light[bright] = np.nan
        pictures.append(light)
    return np.stack(pictures), taking.small_alpha(step)


def _write_tile(
    folder: Path, number: int, first: int, basis: NDArray, own: NDArray, alpha: NDArray
) -> TileEntry:
    combined = np.empty((*alpha.shape, 4), np.float32)
    combined[..., :3] = basis.sum(axis=0, dtype=np.float64) + own
    combined[..., 3] = alpha
    layers = {COMBINED: combined}
    for k, image in enumerate(basis):
        layers[f"Combined_{group_name(k, PATTERN)}"] = image
    name = f"tile_{number:04d}.exr"
    exr.write(folder / name, layers)
    region = Region(0, first, alpha.shape[1], alpha.shape[0])
    return TileEntry(region, (name,), done=True, sums=sums_of(folder, [name]))


def _level(taking: _Taking, found: Lamps, omega: NDArray) -> float:
    """What makes the picture in a white world as bright as pictures are."""
    height, width = taking.shape
    step = max(1, int(np.sqrt(height * width / SMALL)))
    total: NDArray | float = 0.0
    for k in range(len(found.directions)):
        light, _ = lamps_of_dome.small(taking.rows, k, taking.shape, step)
        total = total + light * (omega[k] / found.strengths[k])
    grey = np.mean(total, axis=-1)[taking.small_alpha(step) > 0.5]
    bright = float(np.percentile(grey, OF_PIXELS)) if grey.size else 0.0
    if bright <= 0:
        raise PhotographsError(
            "the lamps add nothing to the light without them: photograph with the lamps on, or "
            "leave the ambient and dark pictures out"
        )
    return BRIGHT / bright


class _Taking:
    """What the photographs of a dome show, without what is there without the lamps."""

    def __init__(self, photos: Photographs) -> None:
        self.photos, self.shape = photos, photos.shape
        said: Description = photos.said
        self.ambient, self.dark = said.of(Kind.AMBIENT), said.of(Kind.DARK)
        self.masks, self.empty = said.of(Kind.MASK), said.of(Kind.EMPTY)

    def small_alpha(self, step: int) -> NDArray[np.float32]:
        """The alpha of every n-th pixel of every n-th row."""
        height, width = self.shape
        at_once = max(1, lamps_of_dome.STRIP // (width * step)) * step
        parts = (self.alpha(y, min(y + at_once, height)) for y in range(0, height, at_once))
        return np.concatenate([part[::step, ::step] for part in parts])

    def rows(self, k: int, first: int, last: int) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """The light of one lamp, and where it is saturated."""
        group = self.photos.group(Kind.LIGHT, lamp=k)
        light, bright = self.photos.measured(group, first, last)
        without = self.ambient or self.dark
        if without:
            light = light - self.photos.measured(without, first, last)[0]
        return np.maximum(light, 0), bright

    def own(self, first: int, last: int) -> NDArray[np.float32]:
        """The light that is there without the lamps, without the camera's darkness."""
        if not self.ambient:
            return np.zeros((last - first, self.shape[1], 3), np.float32)
        light = self.photos.measured(self.ambient, first, last)[0]
        if self.dark:
            light = light - self.photos.measured(self.dark, first, last)[0]
        return np.maximum(light, 0)

    def alpha(self, first: int, last: int) -> NDArray[np.float32]:
        """How much of each pixel is the thing: by the mask, or where the empty set differs."""
        if self.masks:
            picture = self.photos.pictures[self.masks[0].file]
            values = picture.rows(first, last).max(axis=-1)
            top = 1.0 if picture.levels else max(float(values.max()), 1.0)
            return np.clip(values / top, 0, 1)
        with_thing = self.ambient or self.photos.group(Kind.LIGHT, lamp=0)
        if not (self.empty and with_thing):
            return np.ones((last - first, self.shape[1]), np.float32)
        one = self.photos.measured(with_thing, first, last)[0]
        other = self.photos.measured(self.empty, first, last)[0]
        most = np.maximum(np.maximum(one, other).max(axis=-1), 1e-4)
        apart = np.abs(one - other).max(axis=-1) / most
        return np.clip((apart - SAME) / (OTHER - SAME), 0, 1).astype(np.float32)
