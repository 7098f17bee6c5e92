"""Where the light of a region comes from: which lights make it, and from which directions."""

from __future__ import annotations

import math
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.errors import FieldError
from ...core.match import ask
from ...core.match.answers import Answers
from ...core.preview import Preview
from ..relight.shown import Shown
from ..shot.shot import layer_of
from ..world import kept
from ..world.check import check_world
from .asked import masks
from .lights import lights_of

# The radius of the region about a click, as a share of the picture's width.
RADIUS = 0.02
# Directions that are told, and the share of a region's light from which on one is.
MOST, LEAST = 4, 0.03


@dataclass(frozen=True)
class Told:
    """What lights a region: parts by name, directions, and both in sentences."""

    parts: tuple[ask.Part, ...]
    directions: tuple[ask.From, ...]
    lines: tuple[str, ...]


def about(shape: tuple[int, int], x: int, y: int) -> NDArray[np.float64]:
    """The pixels about a place, (H, W), 1 inside and 0 outside. x, y: from the left and the top."""
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    reach = max(1.0, RADIUS * shape[1])
    return (np.hypot(columns - x, rows - y) <= reach).astype(np.float64)


def where_from(scene: bpy.types.Scene, at: tuple[int, int] | None = None) -> Told:
    """Find what lights a region.

    at: a pixel, from the left and the top, with those about it; None for the settings' mask. Raises
    TargetError where the region is empty, FieldError where nothing was captured there, SceneError.
    """
    layer = layer_of(scene)
    world = check_world(scene, layer)
    shown = Shown(scene, layer)
    answers = Answers.of(Preview([take.field for take in shown.takes]))
    shape = shown.field.shape
    region = about(shape, *at) if at else masks(scene, shape)[0]
    counts = answers.columns(region) * answers.alpha * answers.sizes
    if not counts.any() and region.any():
        raise FieldError("nothing stands there: what is seen is the world; choose another place")
    lights = lights_of(scene, layer, world, answers, own=True)
    # flags have no picture of their own: what they leave is in the lights behind them
    parts = dict(lights.parts)
    if np.abs(counts @ lights.fixed).sum() > 0:
        parts["the rest"] = lights.fixed
    found = ask.by_lights(parts, counts)
    environment = kept.environment(scene, scene.arto.environment_width, layer, world)
    come = ask.by_directions(answers, answers.cells.radiance(environment), counts)
    lines = [
        "Lit " + ", ".join(f"{p.share:.0%} by {p.name}" for p in found if abs(p.share) > 0.005)
    ]
    told = [f for f in come[:MOST] if f.share >= LEAST]
    if told:
        lines.append("Mostly from " + "; ".join(_place(f) for f in told))
    return Told(tuple(found), tuple(come), tuple(lines))


def _place(found: ask.From) -> str:
    x, y, z = found.direction
    azimuth, elevation = math.degrees(math.atan2(y, x)), math.degrees(math.asin(z))
    return f"azimuth {azimuth:.0f}°, elevation {elevation:.0f}° ({found.share:.0%})"
