"""The studio: a scene of nothing but the artist's world, in which the world can be rendered."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ..blender.output import float_exr, write_to
from ..work import Render, blocking_render


@contextmanager
def studio_scene(
    scene: bpy.types.Scene, world: bpy.types.World, name: str
) -> Iterator[tuple[bpy.types.Scene, list[bpy.types.ID]]]:
    """A new scene with a world of the artist's, the scene's frame and nothing else; removed at the
    end.

    Yields the scene and the list of data-blocks to remove with it.
    """
    studio = bpy.data.scenes.new(name)
    made: list[bpy.types.ID] = []
    try:
        studio.render.engine = "CYCLES"
        studio.world = world.copy()
        made.append(studio.world)
        # nothing is lit here, so no map of where the light comes from is needed
        studio.world.cycles.sampling_method = "NONE"
        studio.frame_set(scene.frame_current, subframe=scene.frame_subframe)
        studio.cycles.device = scene.cycles.device
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
    """Render a studio scene -> (H, W, 4) float32, rows top-down."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.exr"
        write_to(studio.render, path)
        request = Render(studio.name, 0, "world")
        blocking_render(request)
        request.check()
        return next(iter(exr.read(path).values()))
