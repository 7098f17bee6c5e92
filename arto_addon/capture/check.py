"""What a scene must have before it can be captured."""

from __future__ import annotations

import bpy

from ...core.errors import SceneError
from ..stage.stage import picture_size
from ..world.check import check_light_of, world_of
from .simulations import unbaked

# The fewest pixels on a side that Blender renders, with denoising and the world behind.
LEAST_PIXELS = 4


def check_scene(scene: bpy.types.Scene, view_layer: str | None = None) -> None:
    """Raise SceneError for settings that cannot be captured.

    Objects are checked later, on the stage (`stage.bounds.Rendered.check`).
    """
    if scene.render.engine != "CYCLES":
        raise SceneError(
            f"the render engine is {scene.render.engine}: ARTO captures with Cycles; choose it in "
            "the render properties"
        )
    if scene.camera is None:
        raise SceneError("the scene has no camera: add one, or make one the scene's camera")
    if world := world_of(scene, view_layer):
        check_light_of(scene, world)
    width, height = picture_size(scene)
    if min(width, height) < LEAST_PIXELS:
        raise SceneError(
            f"the picture has only {width}x{height} pixels: raise the resolution or its percentage"
        )
    if moving := unbaked(scene, view_layer or scene.view_layers[0].name):
        were = "was" if moving.startswith(("the cloth", "the soft", "the hair")) else "were"
        raise SceneError(
            f"{moving} {were} played and not baked, and a capture would show them elsewhere: bake "
            "them (Physics properties, Cache), or go to their first frame"
        )
    if not scene.arto.faces:
        raise SceneError("the hemicube has no faces: choose at least one")
