"""Looking inside a plate: where a pixel's light comes from, and what a place of the HDRI lights."""

from __future__ import annotations

import math
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.inside import drawn, parts_at, shares_at, unfolded
from ...core.light.environment import Environment
from ...core.light.lamps import split
from ...core.light.layers import by_faces, disc, part_of
from ...core.light.light import PatchLight
from ...core.relight import relight
from ..shot.shot import layer_of
from ..world import kept
from ..world.check import check_world
from ..world.own import own_of
from .layers import parts_of
from .shown import Shown, newest

IMAGE, FROM = "ARTO Inside", "ARTO Light From"
SIDE = 192
# How far around a place on the HDRI its light is shown, in radians.
REACH = math.radians(12)
# The hemicube's faces, the HDRI's suns and the other lights in an artist's words.
_WORDS = {
    "top": "the top", "bottom": "below", "left": "the left", "right": "the right",
    "back": "the back", "front": "the front", "suns": "the HDRI's suns",
    "rest": "the rest", "own": "the scene's lamps",
}  # fmt: skip


_PLACES = {
    "top": "at the top", "bottom": "below", "left": "on the left", "right": "on the right",
    "back": "at the back", "front": "in front",
}  # fmt: skip


@dataclass(frozen=True)
class Seen:
    """What a look inside found: sentences, and a picture of the unfolded hemicube, (h, w, 4)."""

    lines: tuple[str, ...]
    picture: NDArray[np.float32]


def environment_of(scene: bpy.types.Scene) -> Environment:
    """The light of the scene's world. Raises SceneError."""
    layer = layer_of(scene)
    check_world(scene, layer)
    return kept.environment(scene, scene.arto.environment_width, layer)


def look(scene: bpy.types.Scene, x: int, y: int) -> Seen:
    """Find where the light of a pixel of the plate comes from.

    x, y: the pixel, counted from the left and the top. Raises SceneError, and FieldError where
    nothing was captured at this pixel.
    """
    layer = layer_of(scene)
    shown = Shown(scene, layer, newest(scene, layer))
    field = shown.takes[-1].field if len(shown.takes) > 1 else shown.field
    environment = environment_of(scene)
    light = PatchLight(environment, field.hemicube)
    asked, (x, y) = (x, y), shown.pixel(x, y)
    parts = parts_at(field, light, x, y)
    own = float(own_of(scene, field)[y, x].sum())
    if scene.arto.layers == "GROUPS" and scene.arto.groups:
        pieces = parts_of(scene, environment, field, check_world(scene, layer))
    else:
        pieces = _pieces(shown, environment)
    shares = shares_at(field, environment, x, y, pieces)
    came = sum(float(p.light.sum()) for p in parts)
    total = came + own
    told = [(name, share * came / total if total else 0.0) for name, share in shares.items()]
    if own:
        told.append(("own", own / total))
    told = sorted((t for t in told if t[1] >= 0.005), key=lambda t: -t[1])
    pixel = np.sum([p.light for p in parts], axis=0) if parts else np.zeros(3)
    lines = [f"Pixel {asked[0]}, {asked[1]}: {pixel[0]:.3g}, {pixel[1]:.3g}, {pixel[2]:.3g}"]
    if told:
        lit = [f"{share:.0%} by {_WORDS.get(name, name)}" for name, share in told[:5]]
        lines.append(f"Lit {', '.join(lit)}")
    elif field.layer("alpha")[y, x] == 0:
        lines.append("Nothing stands here: what is seen is the world")
    else:
        lines.append("No light comes here")
    if parts:
        best = parts[0]
        share = float(best.light.sum()) / came if came else 0.0
        face = field.hemicube.grid[best.patch][0]
        lines.append(f"The brightest of {len(parts)} patches, {_PLACES[face]}, gives {share:.0%}")
    return Seen(tuple(lines), drawn(field.hemicube, environment, parts, SIDE))


def _pieces(shown: Shown, environment: Environment) -> dict[str, NDArray]:
    """The shares of the environment: a share for each face, and one for the suns. They sum to 1."""
    field = shown.field
    found = split(environment, field.hemicube)
    sun = found.lamps.image.sum(axis=-1)
    whole = environment.image.sum(axis=-1)
    suns = np.divide(sun, whole, out=np.zeros_like(sun), where=whole > 0).astype(np.float32)
    out = {"suns": suns} if suns.any() else {}
    for name, share in by_faces(environment, field.hemicube).items():
        out[name] = share * (1 - suns)
    return out


def direction_at(scene: bpy.types.Scene, name: str, u: float, v: float) -> NDArray | None:
    """The direction in the scene that a place of a picture shows.

    name: the picture's, either `IMAGE` or the HDRI of the scene's world, taken as turned now; u, v:
    the place, from the left and the bottom, 0 to 1. None where the place is beside the unfolded
    hemicube.
    """
    if name == IMAGE:
        layer = layer_of(scene)
        shown = Shown(scene, layer, newest(scene, layer))
        around, patch, _, _ = unfolded(shown.field.hemicube, SIDE)
        h, w = patch.shape
        row, column = min(int((1 - v) * h), h - 1), min(int(u * w), w - 1)
        return around[row, column] if patch[row, column] >= 0 else None
    environment = environment_of(scene)
    azimuth = (0.5 - u) * 2 * math.pi - environment.turn
    elevation = (v - 0.5) * math.pi
    across = math.cos(elevation)
    return np.array([across * math.cos(azimuth), across * math.sin(azimuth), math.sin(elevation)])


def light_from(scene: bpy.types.Scene, direction: NDArray) -> tuple[NDArray[np.float32], str]:
    """Show what the light around a direction gives to the picture -> (picture (H, W, 4), sentence).

    Raises SceneError, FieldError.
    """
    layer = layer_of(scene)
    shown = Shown(scene, layer, newest(scene, layer))
    environment = environment_of(scene)
    x, y, z = direction / np.linalg.norm(direction)
    azimuth, elevation = math.atan2(y, x), math.asin(z)
    share = disc(environment, azimuth, elevation, REACH, 0.3)
    hemicube = shown.field.hemicube
    some = relight(shown.field, PatchLight(part_of(environment, share), hemicube), 0.0)
    every = relight(shown.field, PatchLight(environment, hemicube), 0.0)
    whole = float(every[..., :3].sum(dtype=np.float64))
    # the plane fitted through a bright spot falls below 0 beside the spot
    some[..., :3] = np.maximum(some[..., :3], 0)
    part = float(some[..., :3].sum(dtype=np.float64)) / whole if whole else 0.0
    place = f"azimuth {math.degrees(azimuth):.0f}°, elevation {math.degrees(elevation):.0f}°"
    return some, f"{part:.1%} of the picture's light comes from there ({place})"
