"""The colour space that Blender works in: what its numbers mean where they are light."""

from __future__ import annotations

import bpy
from mathutils import Color

from ...core.errors import SceneError
from .version import FIVE

_found: list[str] = []


def working_space() -> str:
    """Its name, as Blender lists it for images. Raises SceneError where that cannot be told."""
    if FIVE:
        return bpy.data.colorspace.working_space
    if not _found:
        _found.append(_looked_up())
    return _found[0]


def _looked_up() -> str:
    """Blender 4.5 says it nowhere, but has the library with it that it reads its configuration by;
    and a studio's may have any space. Asked for while a panel is drawn, which may make nothing."""
    listed = bpy.types.ColorManagedInputColorspaceSettings.bl_rna.properties["name"].enum_items
    found = _by_role() or _by_primaries()
    if found not in listed:
        raise SceneError(
            "it cannot be told which colour space Blender works in: look at scene_linear in your "
            "OpenColorIO configuration"
        )
    return found


def _by_role() -> str:
    """As the configuration that Blender has read names it; empty where nothing reads that."""
    bpy.utils.expose_bundled_modules()
    try:
        import PyOpenColorIO
    except ImportError:  # a distribution's Blender may be without
        return ""
    return PyOpenColorIO.GetCurrentConfig().getRoleColorSpace("scene_linear") or ""


def _by_primaries() -> str:
    """Blender's own, where the numbers are those of it; else empty."""
    for i in range(3):
        one = Color([float(i == j) for j in range(3)])
        other = one.from_scene_linear_to_rec709_linear()
        if max(abs(a - b) for a, b in zip(one, other, strict=True)) > 1e-4:
            return ""
    return "Linear Rec.709"


def work_in(space: str) -> None:
    """Have this Blender work in a space; before Blender 5 all work in that of their configuration.
    The file that is open is no artist's: its colours stay numbers. Raises SceneError."""
    if working_space() == space:
        return
    if not FIVE:
        raise SceneError(f"this Blender works in {working_space()}, and the file in {space}")
    bpy.ops.wm.set_working_color_space(working_space=space, convert_colors=False)
