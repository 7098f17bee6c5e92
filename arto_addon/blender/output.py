"""A scene's output: where Blender writes a render, and how."""

from __future__ import annotations

import bpy


def float_exr(render: bpy.types.RenderSettings, multilayer: bool = True) -> None:
    """Set a scene's output to 32-bit float EXR."""
    settings = render.image_settings
    settings.media_type = "MULTI_LAYER_IMAGE" if multilayer else "IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER" if multilayer else "OPEN_EXR"
    settings.color_mode = "RGBA"
    settings.color_depth = "32"
    settings.exr_codec = "NONE"  # files that are read again at once; packing takes longer
    settings.color_management = "FOLLOW_SCENE"
