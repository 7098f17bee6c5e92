"""The studio: a scene with only the artist's world, in which the world can be rendered."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ..blender.front import set_on_world
from ..blender.output import float_exr, write_to
from ..blender.scratch import temporary
from ..work import Render, blocking_render

# Cycles' settings that change how textures and shaders look.
_TEXTURES = ("shading_system", "texture_limit_render", "texture_resolution_render")


def of_textures(scene: bpy.types.Scene) -> list[object]:
    """The settings of a scene that change how textures and shaders look to its renders."""
    return [scene.render.use_simplify, *(getattr(scene.cycles, n, None) for n in _TEXTURES)]


def like_textures(scene: bpy.types.Scene, settings: list[object]) -> None:
    """Set on another scene what `of_textures` has read."""
    scene.render.use_simplify = settings[0]
    for name, value in zip(_TEXTURES, settings[1:], strict=True):
        if hasattr(scene.cycles, name):
            setattr(scene.cycles, name, value)


@contextmanager
def studio_scene(
    scene: bpy.types.Scene, world: bpy.types.World, name: str
) -> Iterator[tuple[bpy.types.Scene, list[bpy.types.ID]]]:
    """Make a new scene with a copy of the artist's world, at the artist's frame.

    Yields the new scene, and a list: data-blocks that are added to the list are removed with the
    scene at the end.
    """
    studio = bpy.data.scenes.new(name)
    made: list[bpy.types.ID] = []
    try:
        studio.render.engine = "CYCLES"
        studio.world = world.copy()
        made.append(studio.world)
        # Nothing is lit here, so Cycles needs no map for importance sampling.
        set_on_world(studio.world, studio, sampling_method="NONE")
        studio.frame_set(scene.frame_current, subframe=scene.frame_subframe)
        studio.cycles.device = scene.cycles.device
        like_textures(studio, of_textures(scene))
        studio.cycles.use_denoising = False
        studio.cycles.use_adaptive_sampling = False
        studio.render.resolution_percentage = 100
        studio.cycles.sample_clamp_direct = 0
        studio.cycles.sample_clamp_indirect = 0
        studio.render.use_compositing = False
        studio.view_layers[0].use_pass_combined = True
        float_exr(studio.render, multilayer=False)
        yield studio, made
    finally:
        bpy.data.batch_remove([*made, studio])


def render(studio: bpy.types.Scene) -> NDArray[np.float32]:
    """Render a studio scene -> (H, W, 4) float32, rows top-down. Raises CancelledError."""
    with temporary() as folder:
        path = folder / "picture.exr"
        write_to(studio.render, path)
        request = Render(studio.name, 0, "world")
        blocking_render(request)
        request.check()
        return next(iter(exr.read(path).values()))
