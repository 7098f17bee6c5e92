"""A look inside a field: where the light of a pixel comes from, patch by patch (paper, figure 3).

And the hemicube unfolded: a picture of what is around, in which a pixel's supports can be drawn.
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
from .supports import BOX, LINEAR

# Where the faces are in the unfolded hemicube, in faces from its left and top; each is seen from
# inside, back in the middle, as the camera of an upright hemicube looks at it.
_CROSS = {
    "top": (1, 0), "left": (0, 1), "back": (1, 1), "right": (2, 1), "front": (3, 1),
    "bottom": (1, 2),
}  # fmt: skip


@dataclass(frozen=True)
class Part:
    """What a patch gives to a pixel. reflects: R, (3,); light: R <S, L>, (3,); support: the name
    of its model; box: (u0, u1, v0, v1), where most of it comes from, None for all of the patch."""

    patch: int
    support: str
    reflects: NDArray[np.float32]
    light: NDArray[np.float32]
    box: tuple[float, float, float, float] | None


def parts_at(field: Field, light: PatchLight, x: int, y: int) -> list[Part]:
    """What each patch gives to the pixel x, y (from the left and the top), the most first.

    What was too small to be an entry is in none. They sum to the pixel without its rest and the
    scene's own lamps. Raises FieldError outside the captured picture.
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
            average = model.support.average(light, k, parameters)[0]
            place = _box_of(model.support.name, parameters[0])
            given = (reflects * np.maximum(average, 0)).astype(np.float32)
            found.append(Part(k, model.support.name, reflects, given, place))
    return sorted(found, key=lambda part: -float(part.light.sum()))


def _box_of(support: str, parameters: NDArray) -> tuple[float, float, float, float] | None:
    """A rectangle to draw for a support, in patch coordinates."""
    if support == BOX.name:
        u0, u1, v0, v1 = (float(p) for p in parameters)
        return u0, u1, v0, v1
    if support == LINEAR.name:
        # only its middle is known: it is drawn as a mark
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
    """How much of a pixel's light each part of an environment gives, of all parts' light.

    parts: shares (H, W) of the environment by name, that sum to 1, see `layers`. -> by name, the
    most first; they sum to 1 unless no light comes at all.
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
    """The hemicube laid out as a cross of faces, `side` pixels each.

    -> directions (3 side, 4 side, 3), patches (-1 where none is), u and v on them; rows run
    top-down.
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
    parts: list[Part],
    side: int = 192,
    show: float = 0.7,
) -> NDArray[np.float32]:
    """The unfolded hemicube with an environment on it and the parts of a pixel: the paper's figure
    3 -> (3 side, 4 side, 4), scene-linear.

    A patch is as bright as it gives light to the pixel, its support is framed in orange, and the
    seams of the patches are dark. show: how dark the rest is, from 0 to 1.
    """
    around, patch, u, v = unfolded(hemicube, side)
    light = environment.at(around)
    # a display shows 1 at most; what is brighter than nearly all is white
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
