"""Make the core's `Shot`, which says what picture of what scene Blender is about to render."""

from __future__ import annotations

from pathlib import Path

import bpy

from ...core.errors import CaptureSetError
from ...core.region import Region
from ...core.shot import Shot
from ..blender.colour import working_space
from ..blender.markers import camera_of
from ..stage.stage import picture_region, picture_size
from . import home, scene_id


def layer_of(scene: bpy.types.Scene) -> str:
    """The view layer that the artist works in, or the scene's first."""
    context = bpy.context
    if getattr(context, "scene", None) == scene and getattr(context, "view_layer", None):
        return context.view_layer.name
    return scene.view_layers[0].name


def shot_of(
    scene: bpy.types.Scene, view_layer: str | None = None, region: Region | None = None
) -> Shot:
    """Make the shot of a scene as the scene is now; the scene is neither changed nor evaluated.

    view_layer: default: `layer_of`; region: default: what the scene renders of its picture.
    """
    width, height = picture_size(scene)
    camera = camera_of(scene)
    region = region or picture_region(scene)
    return Shot(
        scene=scene.name,
        frame=scene.frame_current,
        width=width,
        height=height,
        camera_matrix=_matrix(camera) if camera else (),
        lens=_lens(scene),
        file=Path(home.file()).stem,
        scene_id=scene_id.of(scene),
        view_layer=view_layer or layer_of(scene),
        camera=camera.name if camera else "",
        subframe=round(scene.frame_subframe, 5),
        region=(region.x, region.y, region.width, region.height),
        colour_space=working_space(),
    )


def _matrix(camera: bpy.types.Object) -> tuple[float, ...]:
    return tuple(round(x, 5) for row in camera.matrix_world for x in row)


def _lens(scene: bpy.types.Scene) -> tuple[object, ...]:
    """The settings of camera and render that decide the framing, without the camera's place."""
    camera = camera_of(scene)
    if not camera or camera.type != "CAMERA":
        return ()
    lens, render = camera.data, scene.render
    kind = lens.type
    names = ["shift_x", "shift_y", "sensor_fit", "sensor_width", "sensor_height"]
    names += {"PERSP": ["lens"], "ORTHO": ["ortho_scale"]}.get(kind, ["panorama_type"])
    values = [getattr(lens, name) for name in names]
    values += [render.pixel_aspect_x, render.pixel_aspect_y]
    return kind, *(round(v, 5) if isinstance(v, float) else v for v in values)


def check_same_shot(scene: bpy.types.Scene, then: Shot | None, what: str, view_layer: str) -> None:
    """Raise CaptureSetError where a file is of another shot than the scene's.

    then: the shot that the file names; None where the file names no shot, which is no error. what:
    names the file in the error.
    """
    if then is None:
        return
    difference = then.difference(shot_of(scene, view_layer))
    if difference:
        raise CaptureSetError(f"{what} is of {difference}: set it back, or capture and fit again")
