"""A look inside a field: where the light of a pixel comes from, patch by patch (paper, figure 3).

It also unfolds the hemicube into a picture in which the supports of a pixel can be drawn.

Examples
--------
>>> around, patch, u, v = unfolded(Hemicube(patches=1), 2)  # a cross of six faces of 2 x 2 pixels
>>> around.shape, int((patch >= 0).sum())
((6, 8, 3), 24)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import FieldError
from .field.field import Field
from .hemicube import Hemicube
from .light.environment import Environment
from .light.layers import part_of
from .light.light import PatchLight
from .supports import BELL, BOX, LEANING, LINEAR, Support

# The place of each face in the unfolded hemicube, in faces from its left and top. Faces are seen
# from inside. The back is in the middle, as the camera of an upright hemicube sees it.
_CROSS = {
    "top": (1, 0), "left": (0, 1), "back": (1, 1), "right": (2, 1), "front": (3, 1),
    "bottom": (1, 2),
}  # fmt: skip


@dataclass(frozen=True)
class Contribution:
    """The light that a patch gives to a pixel.

    Parameters
    ----------
    patch : int
    support : str
        The name of the support model.
    reflects : (3,) float32
        R, the reflection coefficient.
    light : (3,) float32
        R <S, L>, scene-linear.
    box : tuple of 4 float or None
        u0, u1, v0, v1: where most of the light comes from; None for the whole patch.
    """

    patch: int
    support: str
    reflects: NDArray[np.float32]
    light: NDArray[np.float32]
    box: tuple[float, float, float, float] | None


def parts_at(field: Field, light: PatchLight, x: int, y: int) -> list[Contribution]:
    """Find the light that each patch gives to a pixel.

    The parts sum to the pixel, without its rest (what was too small to be an entry) and without the
    scene's own lamps.

    Parameters
    ----------
    field : Field
    light : PatchLight
    x, y : int
        The pixel, from the left and from the top.

    Returns
    -------
    list of Contribution
        The brightest first.

    Raises
    ------
    FieldError
        The pixel was not captured.
    """
    found = []
    for k, support, reflects, parameters in entries_at(field, x, y):
        average = support.average(light, k, parameters[None])[0]
        place = _box_of(support.name, parameters)
        given = (reflects * np.maximum(average, 0)).astype(np.float32)
        found.append(Contribution(k, support.name, reflects, given, place))
    return sorted(found, key=lambda part: -float(part.light.sum()))


def entries_at(
    field: Field, x: int, y: int
) -> list[tuple[int, Support, NDArray[np.float32], NDArray[np.float32]]]:
    """Find the entries of a pixel: what it reflects of which patches.

    Parameters
    ----------
    field : Field
    x, y : int
        The pixel, from the left and from the top.

    Returns
    -------
    list of (int, Support, (3,) float32, (p,) float32)
        Of each entry the patch, the support model, R, and the model's parameters.

    Raises
    ------
    FieldError
        The pixel was not captured.
    """
    for tile in field.tiles:
        r = tile.region
        if r.x <= x < r.x + r.width and r.y <= y < r.y + r.height:
            break
    else:
        raise FieldError(f"nothing was captured at {x}, {y}: choose a place inside the picture")
    pixel = (y - r.y) * r.width + x - r.x
    block = next(i for i, b in enumerate(tile.blocks) if b.start <= pixel < b.stop)
    within = pixel - tile.blocks[block].start
    ones = tile.ones(slice(pixel, pixel + 1))[0]
    found = []
    for model in tile.models:
        for k in np.flatnonzero(model.counts[block]).tolist():
            pixels = model.pixels(block, k)
            i = int(np.searchsorted(pixels, within))
            if i == len(pixels) or pixels[i] != within:
                continue
            at = slice(model.at(block, k).start + i, model.at(block, k).start + i + 1)
            reflects = model.shares(at)[:, 0] * ones
            parameters = model.parameters_of(at)
            found.append((k, model.support, reflects, parameters[0]))
    return found


def _box_of(support: str, parameters: NDArray) -> tuple[float, float, float, float] | None:
    """A rectangle to draw for a support, in patch coordinates."""
    if support == BOX.name:
        u0, u1, v0, v1 = (float(p) for p in parameters)
        return u0, u1, v0, v1
    if support in (BELL.name, LEANING.name):
        u, across, v, along = (float(p) for p in parameters[:4])
        return max(u - across, 0), min(u + across, 1), max(v - along, 0), min(v + along, 1)
    if support == LINEAR.name:
        # the model knows the middle alone, which is drawn as a mark
        u, v = (float(p) for p in parameters)
        return max(u - 0.06, 0), min(u + 0.06, 1), max(v - 0.06, 0), min(v + 0.06, 1)
    return None


def shares_at(
    field: Field,
    environment: Environment,
    x: int,
    y: int,
    parts: Mapping[str, NDArray],
) -> dict[str, float]:
    """Compute the share of each part of an environment in a pixel's light.

    Parameters
    ----------
    field : Field
    environment : Environment
    x, y : int
        The pixel, from the left and from the top.
    parts : dict of str to (H, W) float
        The parts by name, as shares of each texel that sum to 1 (`light.layers`).

    Returns
    -------
    dict of str to float
        The largest first. They sum to 1, or are 0 where the pixel gets no light.
    """
    found = {}
    for name, share in parts.items():
        light = PatchLight(part_of(environment, share), field.hemicube)
        found[name] = sum(float(p.light.sum()) for p in parts_at(field, light, x, y))
    total = sum(found.values())
    return {
        name: value / total if total else 0.0
        for name, value in sorted(found.items(), key=lambda item: -item[1])
    }


def unfolded(hemicube: Hemicube, side: int) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Lay the hemicube out as a cross of faces.

    Parameters
    ----------
    hemicube : Hemicube
    side : int
        Pixels along the side of a face.

    Returns
    -------
    directions : (3 side, 4 side, 3) float64
        In the world; 0 beside the cross. Rows run top-down.
    patch : (3 side, 4 side) int
        The number of the patch, or -1.
    u, v : (3 side, 4 side) float
        Patch coordinates.
    """
    height, width = 3 * side, 4 * side
    around = np.zeros((height, width, 3))
    there = np.zeros((height, width), bool)
    across = (np.arange(side) + 0.5) / side * 2 - 1
    s, t = np.meshgrid(across, -across)
    one = np.ones_like(s)
    right, forward, up = np.asarray(hemicube.orientation, float).T
    seen = {
        "back": (s, one, t), "front": (-s, -one, t), "left": (-one, s, t), "right": (one, -s, t),
        "top": (s, -t, one), "bottom": (s, t, -one),
    }  # fmt: skip
    for face, (column, row) in _CROSS.items():
        a, b, c = seen[face]
        place = slice(row * side, (row + 1) * side), slice(column * side, (column + 1) * side)
        around[place] = a[..., None] * right + b[..., None] * forward + c[..., None] * up
        there[place] = True
    patch, u, v = hemicube.locate(around)
    return around, np.where(there, patch, -1), u, v


def drawn(
    hemicube: Hemicube,
    environment: Environment,
    parts: list[Contribution],
    side: int = 192,
    show: float = 0.7,
) -> NDArray[np.float32]:
    """Draw the unfolded hemicube with an environment on it and the parts of a pixel.

    The brightness of a patch is the light that it gives to the pixel. Supports are framed in
    orange, and the seams between patches are dark.

    Parameters
    ----------
    hemicube : Hemicube
    environment : Environment
    parts : list of Contribution
        As `parts_at` gives them.
    side : int
        Pixels along the side of a face.
    show : float
        How dark a patch without light is drawn, 0 to 1.

    Returns
    -------
    (3 side, 4 side, 4) float32
        Scene-linear, transparent beside the cross.

    Source
    ------
    Paper, figure 3.
    """
    around, patch, u, v = unfolded(hemicube, side)
    light = environment.at(around)
    # a display shows 1 at most: the brightest 3 in 100 are white
    light = light / max(float(np.percentile(light.max(axis=-1), 97)), 1e-9)
    given = np.zeros(len(hemicube))
    for part in parts:
        given[part.patch] += float(part.light.sum())
    most = max(float(given.max(initial=0)), 1e-12)
    bright = np.where(patch >= 0, 1 - show + show * np.sqrt(given / most)[patch], 1 - show)
    out = np.clip(light, 0, 1) * bright[..., None]
    # the seams
    other = np.zeros(patch.shape, bool)
    other[:, 1:] |= patch[:, 1:] != patch[:, :-1]
    other[1:] |= patch[1:] != patch[:-1]
    out[other & (patch >= 0)] *= 0.3
    for part in sorted(parts, key=lambda p: float(p.light.sum())):
        if part.box is None or float(part.light.sum()) < 0.01 * most:
            continue
        u0, u1, v0, v1 = part.box
        inside = (patch == part.patch) & (u >= u0) & (u <= u1) & (v >= v0) & (v <= v1)
        core = inside.copy()
        core[1:] &= inside[:-1]
        core[:-1] &= inside[1:]
        core[:, 1:] &= inside[:, :-1]
        core[:, :-1] &= inside[:, 1:]
        out[inside & ~core] = (1.0, 0.35, 0.02)
    alpha = np.zeros((*patch.shape, 1))
    for column, row in _CROSS.values():
        alpha[row * side : (row + 1) * side, column * side : (column + 1) * side] = 1
    return np.concatenate([out * alpha, alpha], axis=-1).astype(np.float32)
