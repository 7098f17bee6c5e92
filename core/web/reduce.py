"""A field brought to a shot for a page: lobes taken out, the rest as components, all as codes.

Examples
--------
>>> spins(2)
[0.0, 3.141592653589793]
>>> grid = coarse(np.dstack([np.tile(np.linspace(-1, 1, 100), (60, 1))] * 3), 5)
>>> grid.shape, (100 * grid[0, :, 0]).round().tolist()
((3, 5, 3), [-101.0, -51.0, 0.0, 51.0, 101.0])
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..field.field import Field
from . import sphere
from .components import Answers, axes_of, given_by, numbers_of
from .light import light_on
from .lobes import MOST
from .shot import STEPS, THIN, TURNS, LobeCodes, Shot, World, map_of, to_codes
from .smooth import Block, Patches, blocks

# Texels a side of the square on which patches lie.
SIDE = 256
# The most components.
COMPONENTS = 48
# In how many pictures of the worlds components are looked for, about; the fewest and the most turns
# of each world.
PICTURES, SPINS = 32, (4, 16)
# Soft lamps all around, in whose pictures they are looked for as well: how many, how wide they are,
# and how much they count beside a world.
LAMPS, SOFT, ANY = 12, np.radians(25.0), 0.4
# A step of a number, relative to what the pixel shows in white light.
STEP = 0.001
# A pixel counts by its white beside so much of the mean.
DARK = 0.01
# The light of the largest code is that of all pixels but so few.
BRIGHTEST = 99.99
# Columns of the grid of the camera's directions.
COLUMNS = 33

# Takes the noise out of a picture (H, W, 3) of what is not below 0.
Clean = Callable[[NDArray[np.float32]], NDArray[np.float32]]


def spins(count: int) -> list[float]:
    """Turns all around, evenly.

    Parameters
    ----------
    count : int

    Returns
    -------
    list of float
        Radians.
    """
    return [2 * math.pi * i / count for i in range(count)]


@dataclass
class _Planes:
    """The picture's arrays as they fill, block by block; pixels are flat."""

    white: NDArray[np.float32]
    shown: NDArray[np.float32]
    toward: NDArray[np.float32]
    shape: NDArray[np.float32]
    colour: NDArray[np.float32]


def reduced(
    field: Field,
    worlds: Sequence[World],
    rays: NDArray | None = None,
    name: str = "",
    count: int = COMPONENTS,
    step: float = STEP,
    clean: Clean | None = None,
) -> Iterator[float | Shot]:
    """Bring a field to a shot for a page.

    Parameters
    ----------
    field : Field
        At the size of the page's picture.
    worlds : sequence of World
        The light that the page shows.
    rays : (H, W, 3) float, optional
        Where the camera looks in each pixel; without it the world behind is not shown.
    name : str
        Of the shot.
    count : int
        The most components.
    step : float
        A step of a number, relative to what the pixel shows in white light.
    clean : callable, optional
        A denoiser: takes a picture (H, W, 3) of light that is not below 0 and gives it cleaned.

    Yields
    ------
    float or Shot
        The share that is done, and at last the shot.

    Raises
    ------
    FieldError
        The field is damaged.
    """
    height, width = field.shape
    n = height * width
    patches = Patches.of(field.hemicube, SIDE)
    lights = lights_for(patches, worlds)
    out = _Planes(
        np.zeros((n, 3), np.float32),
        np.zeros((lights.shape[2], n, 3), np.float32),
        np.zeros((MOST, n, 3), np.float32),
        np.zeros((MOST, n, 3), np.float32),
        np.zeros((MOST, n, 3), np.float32),
    )
    done = 0
    apart: list[Block] = []
    for block in blocks(field):
        apart.append(block)
        _fill(out, block, lights)
        done += block.pixels
        yield 0.3 * done / n
    whole = out.white + out.colour.sum(axis=0)
    if clean is not None:
        yield from _cleaned(out, field.shape, clean)
    weight = out.white.mean(axis=-1) / (whole.mean(axis=-1) + DARK * whole.mean() + 1e-30)
    over = _one_over(out.white)
    shown = (out.shown * over).transpose(1, 2, 0)
    axes = axes_of(shown, weight, count)
    numbers = numbers_of(shown, axes)
    answers = Answers(len(field.hemicube), numbers, weight)
    for block in apart:
        _answer(answers, block, over[block.at])
    found = answers.solved(lights, given_by(shown, numbers, weight))
    yield 0.9
    yield _coded(field, worlds, rays, name, patches, found, out, numbers, step)


def lights_for(patches: Patches, worlds: Sequence[World]) -> NDArray[np.float32]:
    """The lights in whose pictures components are looked for, each of about mean radiance 1.

    Parameters
    ----------
    patches : Patches
    worlds : sequence of World

    Returns
    -------
    (3 K, 3, S) float32
        Level and slopes, patch by patch.
    """
    found = []
    every = [one for world in worlds for one in (world, *world.lights)]
    for one in every:
        levels = sphere.levels(map_of(one))
        for turn in spins(int(np.clip(PICTURES // len(every), *SPINS))):
            light = light_on(levels, patches.side, turn)
            found.append(light / max(float(np.abs(light).mean()), 1e-12))
    around = sphere.directions(patches.side).reshape(-1, 3)
    for lamp in even(LAMPS):
        light = np.exp((around @ lamp - 1) / SOFT**2)
        found.append(np.repeat((light / light.mean() * ANY)[:, None], 3, axis=1))
    planes = [patches.planes(light).reshape(-1, 3) for light in found]
    return np.stack(planes, axis=-1).astype(np.float32)


def even(count: int) -> NDArray[np.float64]:
    """Directions that are spread evenly.

    Parameters
    ----------
    count : int

    Returns
    -------
    (count, 3) float64
    """
    z = 1 - (2 * np.arange(count) + 1) / count
    azimuth = np.arange(count) * np.pi * (3 - np.sqrt(5))
    flat = np.sqrt(1 - z * z)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), z], axis=-1)


def _one_over(white: NDArray[np.float32]) -> NDArray[np.float32]:
    """One over the white (n, 3) of the pixels; 0 where there is next to none."""
    tiny = 1e-5 * max(float(white.mean()), 1e-12)
    return np.divide(1, white, out=np.zeros_like(white), where=white > tiny)


def coarse(rays: NDArray, columns: int = COLUMNS) -> NDArray[np.float32]:
    """Take few of the camera's directions, evenly from border to border.

    Parameters
    ----------
    rays : (H, W, 3) float
    columns : int

    Returns
    -------
    (h, w, 3) float32
    """
    height, width = rays.shape[:2]
    rows = max(2, round((columns - 1) * height / width) + 1)
    out = rays
    for axis, n, size in ((0, rows, height), (1, columns, width)):
        at = np.linspace(0, size, n) - 0.5
        low = np.clip(np.floor(at).astype(np.intp), 0, max(size - 2, 0))
        part = (at - low).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
        above = np.minimum(low + 1, size - 1)
        out = out.take(low, axis=axis) * (1 - part) + out.take(above, axis=axis) * part
    return np.ascontiguousarray(out, np.float32)


def _answer(answers: Answers, block: Block, over: NDArray[np.float32]) -> None:
    """Add what a block's pixels make of the light."""
    for one in block.entries():
        share = one.light * over[one.pixels]
        level = np.stack([share, share * one.places[..., 0], share * one.places[..., 1]], axis=1)
        answers.add(one.k, block.at[one.pixels], level)
    rest = block.rest()
    if rest is not None:
        light, share = rest
        answers.add_levels(block.at, light * over, share)


def _fill(out: _Planes, block: Block, lights: NDArray[np.float32]) -> None:
    """Add a block's pixels to the picture's arrays."""
    s = lights.shape[2]
    planes = lights.reshape(-1, 3, 3, s)
    shown = np.zeros((3, block.pixels, s), np.float32)
    for one in block.entries():
        for c in range(3):
            u, v = one.places[:, c].T[..., None]
            level, along, up = planes[one.k, :, c]
            shown[c, one.pixels] += one.light[:, c, None] * (level + u * along + v * up)
    rest = block.rest()
    if rest is not None:
        light, share = rest
        for c in range(3):
            shown[c] += light[:, c, None] * (share.T @ planes[:, 0, c])
    out.shown[:, block.at] = shown.transpose(2, 1, 0)
    out.white[block.at] = block.white
    for i, lobe in enumerate(block.lobes):
        at = block.at[lobe.pixels]
        out.toward[i, at], out.colour[i, at] = lobe.toward, lobe.colour
        out.shape[i, at] = np.stack([lobe.along, lobe.across, lobe.slant], axis=-1)


def _cleaned(out: _Planes, shape: tuple[int, int], clean: Clean) -> Iterator[float]:
    """Take the noise out of white, lobes and pictures; yields 0.3 to 0.8."""

    def cleaned(flat: NDArray) -> NDArray[np.float32]:
        # a plane that is fitted to a lamp falls below 0 beside it
        return np.maximum(clean(np.maximum(flat, 0).reshape(*shape, 3)).reshape(-1, 3), 0)

    out.white = cleaned(out.white)
    lobes = out.colour.sum(axis=0)
    if lobes.any():
        # which lobe is the first may change from pixel to pixel: their sum does not
        out.colour *= np.divide(cleaned(lobes), lobes, out=np.ones_like(lobes), where=lobes > 0)
    for i, picture in enumerate(out.shown):
        out.shown[i] = cleaned(picture)
        yield 0.3 + 0.5 * (i + 1) / len(out.shown)


def _coded(
    field: Field,
    worlds: Sequence[World],
    rays: NDArray | None,
    name: str,
    patches: Patches,
    found: NDArray[np.float64],
    out: _Planes,
    numbers: NDArray[np.float32],
    step: float,
) -> Shot:
    height, width = field.shape

    def picture(flat: NDArray) -> NDArray:
        return np.ascontiguousarray(flat.T).reshape(-1, height, width)

    scales = {"white": _brightest(out.white), "lobes": _brightest(out.colour)}
    white = to_codes(picture(out.white), scales["white"])
    # what shows nothing needs no numbers
    numbers[~white.any(axis=0).ravel()] = 0
    low, high = np.minimum(numbers.min(axis=0), 0), np.maximum(numbers.max(axis=0), 0)
    steps = np.maximum((high - low) / 65535, step)
    zeros = np.rint(low / steps) * steps
    codes = np.clip(np.rint((numbers - zeros) / steps), 0, 65535).astype(np.uint16)
    lobes = [
        _lobe_codes(
            picture(out.toward[i]), picture(out.shape[i]), picture(out.colour[i]), scales["lobes"]
        )
        for i in range(MOST)
        if out.colour[i].any()
    ]
    own = {}
    for layer in ("own", *field.own_layers):
        light = field.layer(layer).reshape(-1, 3) if field.has_layer(layer) else np.zeros((1, 3))
        if light.max(initial=0) > 1e-6 * scales["white"]:
            scales[layer] = _brightest(light)
            own[layer] = to_codes(picture(light), scales[layer])
    through = field.through()
    if through is None:
        through = 1 - field.layer("alpha")[..., None]
    seen = np.rint(np.clip(through, 0, 1) * 255).astype(np.uint8).transpose(2, 0, 1)
    if rays is None:
        seen, rays = np.zeros_like(seen), np.zeros((2, 2, 3))
    return Shot(
        name,
        white,
        np.ascontiguousarray(codes.T).reshape(-1, height, width),
        steps.astype(np.float32),
        zeros.astype(np.float32),
        found.astype(np.float16),
        patches.frames.astype(np.float32),
        (patches.at + 1).astype(np.uint16).reshape(patches.side, patches.side),
        tuple(lobes),
        scales,
        own,
        np.ascontiguousarray(seen),
        coarse(rays),
        tuple(worlds),
    )


def _brightest(light: NDArray) -> float:
    lit = light[light > 0]
    return float(np.percentile(lit, BRIGHTEST)) if lit.size else 1.0


def _lobe_codes(toward: NDArray, shape: NDArray, colour: NDArray, scale: float) -> LobeCodes:
    codes = to_codes(colour, scale)
    there = codes.any(axis=0)
    around = np.where(there, toward, np.array([0, 0, 1])[:, None, None]).transpose(1, 2, 0)
    at = np.stack(sphere.places(around.astype(np.float64), 1)) * TURNS
    widths = np.log2(np.maximum(shape[:2], THIN) / THIN) * STEPS
    slant = shape[2:] / np.pi * 256
    of = np.concatenate([np.clip(np.rint(widths), 0, 255), np.mod(np.rint(slant), 256)])
    # round lobes have no slant
    of[2][of[0] == of[1]] = 0
    return LobeCodes(
        (np.clip(np.rint(at), 0, TURNS) * there).astype(np.uint16),
        (of * there).astype(np.uint8),
        codes,
    )
