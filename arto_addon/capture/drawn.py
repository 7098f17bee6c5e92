"""What Blender draws over a picture of Cycles, and a relit picture cannot have."""

from __future__ import annotations

import bpy

from ...core.errors import SceneError
from ..shot.fingerprint import rendered_objects
from ..stage.bounds import grease_pencil


def check_drawn(scene: bpy.types.Scene, view_layer: str) -> None:
    """Raise SceneError where a render is more than Cycles' picture of one camera.

    Drawings that other objects make instances of are found on the stage (`stage.bounds.rendered`).
    """
    layer, render = scene.view_layers[view_layer], scene.render
    if render.use_multiview:
        raise SceneError(
            "the scene is rendered in stereo, and a capture is of one camera: turn Stereoscopy off "
            "(Output properties), and capture each eye by a camera of its own"
        )
    style = layer.freestyle_settings
    lines = style.mode == "SCRIPT" or any(s.show_render for s in style.linesets)
    if render.use_freestyle and layer.use_freestyle and lines and not style.as_render_pass:
        raise SceneError(
            "Freestyle draws lines over the render, which a relit picture does not have: turn it "
            "off (Render properties), or let it write a pass (View Layer properties, Freestyle, "
            "As Render Pass), and lay the lines over the picture in the compositor"
        )
    if not layer.use_grease_pencil:
        return
    for thing in rendered_objects(layer):
        if thing.type == "GREASEPENCIL" and _draws(thing):
            raise SceneError(grease_pencil(thing.name))


def _draws(thing: bpy.types.Object) -> bool:
    """Whether a drawing has lines at this frame, or something that may make lines."""
    if len(thing.modifiers):
        return True
    frames = [layer.current_frame() for layer in thing.data.layers if not layer.hide]
    return any(frame and len(frame.drawing.strokes) for frame in frames)
