"""Which picture of which scene this is."""

from __future__ import annotations

from typing import Any

import bpy

from ...core.errors import CaptureSetError
from ..stage.stage import picture_size


def shot(scene: bpy.types.Scene) -> dict[str, Any]:
    """What tells one shot from another: which picture of which scene this is."""
    width, height = picture_size(scene)
    camera = scene.camera
    return {
        "scene": scene.name,
        "frame": scene.frame_current,
        "width": width,
        "height": height,
        "camera": [round(x, 5) for row in camera.matrix_world for x in row] if camera else [],
        "lens": _lens(scene),
    }


def _lens(scene: bpy.types.Scene) -> list[Any]:
    """What of the camera decides the framing, beside where it stands."""
    if not scene.camera or scene.camera.type != "CAMERA":
        return []
    lens, render = scene.camera.data, scene.render
    kind = lens.type
    names = ["shift_x", "shift_y", "sensor_fit", "sensor_width", "sensor_height"]
    names += {"PERSP": ["lens"], "ORTHO": ["ortho_scale"]}.get(kind, ["panorama_type"])
    values = [getattr(lens, name) for name in names]
    values += [render.pixel_aspect_x, render.pixel_aspect_y]
    return [kind, *(round(v, 5) if isinstance(v, float) else v for v in values)]


def check_same_shot(scene: bpy.types.Scene, head: dict[str, Any], what: str) -> None:
    """Raise CaptureSetError where a capture set or field is of another shot than the scene's."""
    now = shot(scene)
    then = head.get("shot") or {}
    for key in ("scene", "width", "height", "frame", "camera", "lens"):
        if key in then and then[key] != now[key]:
            shown = "" if key in ("camera", "lens") else f" ({then[key]}, now {now[key]})"
            raise CaptureSetError(
                f"{what} is of another {key}{shown}: set it back, or capture and fit again"
            )
