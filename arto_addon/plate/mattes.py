"""The Cryptomattes of the artist's own render, which a plate's data file hands on."""

from __future__ import annotations

from pathlib import Path

import bpy

from ...core import cryptomatte
from ...core.cryptomatte import Mattes
from ...core.errors import SceneError
from ...core.field.field import Field
from ..shot import home
from .names import at_frame, has_number


def file_of(scene: bpy.types.Scene, field: Field) -> Path | None:
    """The file with the Cryptomattes of a field's shot; None where the settings ask for none.

    Hashes in the name stand for the frame that was captured.
    """
    settings = scene.arto
    if not settings.write_data or not settings.cryptomatte:
        return None
    path = home.absolute(settings.cryptomatte)
    return at_frame(path, _frame(scene, field)) if has_number(path) else path


def _frame(scene: bpy.types.Scene, field: Field) -> int:
    shot = field.about.shot
    return shot.frame if shot else scene.frame_current


def read(scene: bpy.types.Scene, field: Field) -> Mattes | None:
    """Read the Cryptomattes for a field's shot; None where the settings ask for none.

    Raises SceneError where the render is of another size, frame or camera; ExrError.
    """
    path = file_of(scene, field)
    if path is None:
        return None
    found = cryptomatte.read(path)
    sizes = {plane.shape for plane in found.planes.values()}
    if sizes != {field.shape}:
        height, width = next(iter(sizes - {field.shape}))
        raise SceneError(
            f"{path} is a render of {width}x{height} pixels, and the picture has "
            f"{field.shape[1]}x{field.shape[0]}: render this shot again"
        )
    frame, shot = _frame(scene, field), field.about.shot
    if found.frame is not None and found.frame != frame:
        hint = "" if has_number(home.absolute(scene.arto.cryptomatte)) else _HINT
        raise SceneError(
            f"{path} is a render of frame {found.frame}, and the picture is of frame {frame}: "
            f"give a render of that frame{hint}"
        )
    camera = shot.camera if shot else scene.camera.name if scene.camera else ""
    if found.camera and camera and found.camera != camera:
        raise SceneError(
            f"{path} is a render through the camera '{found.camera}', and the picture is through "
            f"'{camera}': give a render through that camera"
        )
    return found


_HINT = ", and write #### for its number where there are several frames"
