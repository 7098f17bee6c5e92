"""What a scene must have before it can be captured."""

from __future__ import annotations

import bpy

from ...core.errors import SceneError
from ..stage.stage import picture_size
from ..world.check import check_no_volume, world_of

# Blender itself renders none smaller, denoising and the world behind included.
LEAST_PIXELS = 4


def check_scene(scene: bpy.types.Scene, view_layer: str | None = None) -> None:
    """Raise SceneError for a scene that cannot be captured."""
    if scene.render.engine != "CYCLES":
        raise SceneError(
            f"the render engine is {scene.render.engine}: ARTO captures with Cycles; choose it in "
            "the render properties"
        )
    if scene.camera is None:
        raise SceneError("the scene has no camera: add one, or make one the scene's camera")
    if world := world_of(scene, view_layer):
        check_no_volume(world)
    width, height = picture_size(scene)
    if min(width, height) < LEAST_PIXELS:
        raise SceneError(
            f"the picture has only {width}x{height} pixels: raise the resolution or its percentage"
        )
    things = list(scene.objects)
    things += [
        o for e in things if e.instance_collection for o in e.instance_collection.all_objects
    ]
    # a lamp's own flag means nothing
    catchers = [
        o.name for o in things if o.type != "LIGHT" and o.is_shadow_catcher and not o.hide_render
    ]
    if catchers:
        raise SceneError(
            f"'{catchers[0]}' is a shadow catcher, which writes no light groups: turn Shadow "
            "Catcher off (Object properties, Visibility) and capture it as an object"
        )
    if not scene.arto.faces:
        raise SceneError("the hemicube has no faces: choose at least one")
