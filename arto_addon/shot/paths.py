"""Where things are kept."""

from __future__ import annotations

import re
from pathlib import Path

import bpy

from ...core.errors import SceneError


def absolute(path: str) -> Path:
    """A path of the artist's, made absolute. Raises SceneError where it hangs on a .blend that
    was never saved."""
    if path.startswith("//") and not bpy.data.filepath:
        raise SceneError(
            "this .blend was never saved, so its files have no place to go: save it, or set "
            "ARTO's folder and output to absolute paths"
        )
    return Path(bpy.path.abspath(path))


def root(scene: bpy.types.Scene) -> Path:
    name = re.sub(r"[^\w .-]", "_", scene.name)
    return absolute(scene.arto.folder) / name


def capture_folder(scene: bpy.types.Scene) -> Path:
    return root(scene) / "capture"


def unfinished_capture_folder(scene: bpy.types.Scene) -> Path:
    """Where a capture grows. It takes the place of the finished one only when it is complete."""
    return root(scene) / "capture.unfinished"


def field_folder(scene: bpy.types.Scene) -> Path:
    return root(scene) / "field"


def relit_file(scene: bpy.types.Scene) -> Path:
    if scene.arto.output:
        path = absolute(scene.arto.output)
        return path if path.suffix.lower() == ".exr" else path.with_suffix(".exr")
    if not bpy.data.filepath:
        raise SceneError(
            "this .blend was never saved, so the relit picture has no place to go: save it, or "
            "set ARTO's output to an absolute path"
        )
    blend = Path(bpy.data.filepath)
    return blend.with_name(f"{blend.stem}_relit.exr")
