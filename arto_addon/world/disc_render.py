"""Render round lights by themselves, in one render: each is a sun in a light group of its own."""

from __future__ import annotations

import math

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from ...core.field.field import Field
from ...core.match.discs import Discs
from ...core.match.target import fitting
from ..stage.small import parts_of
from ..stage.stage import Stage, free_mark, picture_size
from ..work import Steps
from .lamp_render import light_in, lit_by

# Samples of a pixel for each disc, in either of two renders: Cycles looks at one disc at a time.
EACH, LEAST = 1, 8


def disc_light(
    scene: bpy.types.Scene, field: Field, discs: Discs, factor: int, share: float
) -> Steps[NDArray[np.float32]]:
    """Render the picture of each disc with radiance 1, twice -> (2, L, H, W, 3).

    H and W are those of the shot. factor: how many of its pixels a side a pixel of the render
    covers; share: how much of the whole work was done before, 0 to 1. The artist's scene is not
    changed. Raises SceneError, FieldError, CancelledError.
    """
    with lit_by(scene, field) as (on, _):
        width, height = picture_size(on.scene)
        render, mark = on.scene.render, free_mark() + "disc"
        render.use_border = render.use_crop_to_border = False
        render.resolution_x = max(round(width / factor), 1)
        render.resolution_y = max(round(height / factor), 1)
        render.resolution_percentage = 100
        on.change("cycles.samples", max(EACH * len(discs), LEAST))
        for i, (toward, angle) in enumerate(
            zip(discs.directions, discs.angles.tolist(), strict=True)
        ):
            _sun(on, f"{mark}{i:02}", Vector(toward), angle)
        shape, found = (height, width), []
        for seed in (1, 2):
            on.change("cycles.seed", seed)
            parts = yield from parts_of(on, "rendering the lamps that were found", share)
            found += [fitting(light_in(parts, f"{mark}{i:02}"), shape) for i in range(len(discs))]
        return np.array(found, np.float32).reshape(2, len(discs), *shape, 3)


def _sun(on: Stage, group: str, toward: Vector, angle: float) -> None:
    """Add a sun of radiance 1 to the stage."""
    data = bpy.data.lights.new(group, "SUN")
    assert isinstance(data, bpy.types.SunLight)
    lamp = on.made(bpy.data.objects.new(group, data))
    on.made(data)
    data.angle = angle
    data.energy = math.pi * math.sin(angle / 2) ** 2
    data.cycles.max_bounces = 1024
    lamp.rotation_euler = toward.to_track_quat("Z", "Y").to_euler()
    lamp.lightgroup = group
    on.scene.collection.objects.link(lamp)
    on.scene.view_layers[0].lightgroups.add(name=group)
