"""Suns and lamps of a map as lights of a kit, and the map without them.

Each place that outshines the map by far becomes a light with the same direction, size, colour and
energy. Its hole in the map is filled from around, so that the sun can be moved and leaves nothing.

Examples
--------
>>> image = np.full((128, 256, 3), 0.5, np.float32)
>>> image[60, 20] = 9000.0
>>> rest, lights = lights_of(Environment(image))
>>> [light.name for light in lights], float(rest.image.max())
(['Sun'], 0.5)
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..light.environment import Environment, directions, sample_directions
from ..light.lamps import split
from .light import Blend, Kind, Light
from .model import free_name
from .shine import aimed, frame

# A light narrower than this is a sun.
SUN = 4.0
# A light is worth being one from this share of all light on; and the most lights.
LEAST, MOST = 2e-3, 16
# Texels around a light that belong to it: its glow, and what an HDRI's filter has spread.
_AROUND = 2
_ROUNDS = 400


def lights_of(environment: Environment) -> tuple[Environment, list[Light]]:
    """Take the suns and lamps out of a map.

    Parameters
    ----------
    environment : Environment

    Returns
    -------
    rest : Environment
        The map, the places of the lights filled from around.
    lights : list of Light
        The brightest first. Their light and the rest's sum to that of the map.
    """
    image = environment.image
    found = split(environment)
    bright = found.lamps.image.max(axis=-1) > 0
    labels, count = _pieces(_grown(bright, 1))
    weight = np.broadcast_to(environment.row_solid_angles[:, None], bright.shape)
    whole = float((image.mean(axis=-1, dtype=np.float64) * weight).sum())
    above = found.lamps.image.mean(axis=-1, dtype=np.float64) * weight
    energy = np.bincount(labels.ravel(), above.ravel(), count + 1)[1:]
    order = [int(i) + 1 for i in np.argsort(-energy)[:MOST] if energy[i] > LEAST * whole]
    if not order:
        return environment, []
    hole = _grown(np.isin(labels, order), _AROUND)
    rest = _filled(image, hole)
    taken = image.astype(np.float64) - rest
    owner = _owners(labels, order, hole)
    height, width = bright.shape
    azimuth, latitude, _ = sample_directions(height, width, 1, environment.turn)
    around = directions(azimuth, latitude)
    lights: list[Light] = []
    for label in order:
        these = owner == label
        light = _light(around[these], taken[these], weight[these])
        if light is None:
            rest[these] = image[these]
            continue
        names = {other.name for other in lights}
        like = "Sun" if light.kind is Kind.SUN else "Lamp"
        lights.append(Light(**{**vars(light), "name": free_name(like, names)}))
    return Environment(rest, environment.turn), lights


def _light(around: NDArray, taken: NDArray, weight: NDArray) -> Light | None:
    """The light that has the direction, the size and the energy of some texels."""
    energy = taken * weight[:, None]
    total = energy.sum(axis=0)
    grey = np.maximum(energy.mean(axis=-1), 0)
    if total.max() <= 0 or grey.sum() <= 0:
        return None
    at = grey @ around
    at /= np.linalg.norm(at)
    azimuth, elevation = aimed(at)
    total = np.maximum(total, 0)
    most = float(total.max())
    colour = tuple(float(x) for x in total / most)
    plane = Light("x", azimuth=azimuth, elevation=elevation)
    width, height, roll = _size(plane, around, grey, weight)
    shape = {"azimuth": azimuth, "elevation": elevation, "colour": colour}
    if max(width, height) < SUN:
        return Light("x", Kind.SUN, Blend.ADD, width=max(math.sqrt(width * height), 0.05),
                     strength=most, **shape)  # fmt: skip
    light = Light("x", Kind.RECTANGLE, width=width, height=height, roll=roll, **shape)
    return Light(**{**vars(light), "strength": most / light.solid_angle})


def _size(
    plane: Light, around: NDArray, grey: NDArray, weight: NDArray
) -> tuple[float, float, float]:
    """Width, height and roll in degrees of the rectangle with the second moments of some light."""
    right, up, ahead = (around @ frame(plane).T).T
    some = ahead > 0.1
    if not some.any():
        return 90.0, 90.0, 0.0
    x, y, w = right[some] / ahead[some], up[some] / ahead[some], grey[some]
    w = w / w.sum()
    x, y = x - w @ x, y - w @ y
    a, b, c = float(w @ (x * x)), float(w @ (x * y)), float(w @ (y * y))
    texel = float(weight[some].mean()) / 12  # a single texel has no spread of its own
    spread = math.hypot((a - c) / 2, b)
    major, minor = (math.sqrt(3 * max((a + c) / 2 + s * spread, texel)) for s in (1, -1))
    tilted = spread > 0.05 * (a + c)
    # The roll turns right to down, and the angle of the axes right to up.
    roll = -math.degrees(math.atan2(2 * b, a - c) / 2) if tilted else 0.0
    wide, high = (math.degrees(2 * math.atan(side)) for side in (major, minor))
    return min(wide, 170.0), min(high, 170.0), roll


def _grown(mask: NDArray[np.bool_], by: int) -> NDArray[np.bool_]:
    """A mask with its neighbours, across the seam of the map too."""
    for _ in range(by):
        out = mask | np.roll(mask, 1, axis=1) | np.roll(mask, -1, axis=1)
        out[1:] |= mask[:-1]
        out[:-1] |= mask[1:]
        mask = out
    return mask


def _pieces(mask: NDArray[np.bool_]) -> tuple[NDArray[np.intp], int]:
    """Number the pieces of a mask that hang together, from 1 on; 0 is beside it."""
    height, width = mask.shape
    numbers = np.where(mask, np.arange(1, mask.size + 1).reshape(mask.shape), 0)
    while True:
        best = numbers.copy()
        for axis, by in ((1, 1), (1, -1)):
            best = np.maximum(best, np.roll(numbers, by, axis=axis))
        best[1:] = np.maximum(best[1:], numbers[:-1])
        best[:-1] = np.maximum(best[:-1], numbers[1:])
        best = np.where(mask, best, 0)
        # Each texel then takes the number of the texel that its number names: long pieces are
        # quick to agree.
        flat = best.ravel()
        there = flat > 0
        flat[there] = np.maximum(flat[there], flat[flat[there] - 1])
        if np.array_equal(flat.reshape(height, width), numbers):
            break
        numbers = flat.reshape(height, width)
    names, labels = np.unique(numbers, return_inverse=True)
    labels = labels.reshape(mask.shape) + (0 if names[0] == 0 else 1)
    return labels, len(names) - (1 if names[0] == 0 else 0)


def _owners(labels: NDArray, order: list[int], hole: NDArray[np.bool_]) -> NDArray[np.intp]:
    """The number of the piece that each texel of the holes belongs to: the nearest."""
    out = np.where(np.isin(labels, order), labels, 0)
    while (hole & (out == 0)).any():
        near = np.maximum(np.roll(out, 1, axis=1), np.roll(out, -1, axis=1))
        near[1:] = np.maximum(near[1:], out[:-1])
        near[:-1] = np.maximum(near[:-1], out[1:])
        grown = np.where(hole & (out == 0), near, out)
        if np.array_equal(grown, out):
            break
        out = grown
    return out


def _filled(image: NDArray[np.float32], hole: NDArray[np.bool_]) -> NDArray[np.float32]:
    """An image whose holes are filled from around, as smooth as a soap film."""
    out = image.copy()
    if hole.all():
        return np.zeros_like(image)
    known = ~hole
    # First from the rim inwards, then smoothed until little moves.
    while not known.all():
        total = np.zeros_like(out)
        count = np.zeros(hole.shape, np.float32)
        for shifted, there in _neighbours(out, known):
            total += shifted * there[..., None]
            count += there
        new = ~known & (count > 0)
        out[new] = total[new] / count[new][:, None]
        known |= new
    rows = hole.any(axis=1)
    top, bottom = int(rows.argmax()), len(rows) - int(rows[::-1].argmax())
    part = slice(max(0, top - 1), min(len(rows), bottom + 1))
    inner, where = out[part], hole[part]
    every = np.ones(where.shape, np.float32)
    for _ in range(_ROUNDS):
        total = np.zeros_like(inner)
        count = np.zeros(where.shape, np.float32)
        for shifted, there in _neighbours(inner, every):
            total += shifted * there[..., None]
            count += there
        moved = total[where] / count[where][:, None]
        change = float(np.abs(moved - inner[where]).max())
        inner[where] = moved
        if change <= 1e-3 * float(np.abs(moved).max(initial=1e-6)):
            break
    return out


def _neighbours(image: NDArray, there: NDArray) -> list[tuple[NDArray, NDArray]]:
    """The four neighbours of each texel and whether each is there; none beyond the poles."""
    flags = there.astype(np.float32)
    found = [(np.roll(image, by, axis=1), np.roll(flags, by, axis=1)) for by in (1, -1)]
    for by in (1, -1):
        shifted, beside = np.roll(image, by, axis=0), np.roll(flags, by, axis=0)
        beside[0 if by == 1 else -1] = 0
        found.append((shifted, beside))
    return found
