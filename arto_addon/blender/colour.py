"""The working space: the colour space in which Blender's numbers are light."""

from __future__ import annotations

import bpy
from mathutils import Color

from ...core.errors import SceneError
from .version import FIVE

_found: list[str] = []


def working_space() -> str:
    """Name the working space as Blender's list of colour spaces for images does.

    Raises SceneError where the name cannot be found out.
    """
    if FIVE:
        return bpy.data.colorspace.working_space
    if not _found:
        _found.append(_looked_up())
    return _found[0]


def _looked_up() -> str:
    """Find the working space of Blender 4.5, which has no property for it.

    A studio's OpenColorIO configuration may choose any space. Blender brings along the library by
    which it reads the configuration, so the library is asked first. A panel may call this while it
    is drawn, so nothing is made in the file.
    """
    listed = bpy.types.ColorManagedInputColorspaceSettings.bl_rna.properties["name"].enum_items
    found = _by_role() or _by_primaries()
    if found not in listed:
        raise SceneError(
            "it cannot be told which colour space Blender works in: look at scene_linear in your "
            "OpenColorIO configuration"
        )
    return found


def _by_role() -> str:
    """Read the working space from Blender's OpenColorIO configuration; empty where none is read."""
    bpy.utils.expose_bundled_modules()
    try:
        import PyOpenColorIO
    except ImportError:  # a Linux distribution's Blender may come without the library
        return ""
    return PyOpenColorIO.GetCurrentConfig().getRoleColorSpace("scene_linear") or ""


def _by_primaries() -> str:
    """Name Blender's default, where the working space has the primaries of Rec. 709; else empty."""
    for i in range(3):
        one = Color([float(i == j) for j in range(3)])
        other = one.from_scene_linear_to_rec709_linear()
        if max(abs(a - b) for a, b in zip(one, other, strict=True)) > 1e-4:
            return ""
    return "Linear Rec.709"


def work_in(space: str) -> None:
    """Have this Blender work in a colour space.

    Call this where no artist's file is open, because the colours in the open file keep their
    numbers.
    Raises SceneError before Blender 5, where the configuration fixes another working space.
    """
    if working_space() == space:
        return
    if not FIVE:
        raise SceneError(f"this Blender works in {working_space()}, and the file in {space}")
    bpy.ops.wm.set_working_color_space(working_space=space, convert_colors=False)
