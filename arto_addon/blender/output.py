"""A scene's output: where Blender writes a render, and how."""

from __future__ import annotations

from pathlib import Path

import bpy

from .version import FIVE

# What of a scene's render settings decides how a picture is written, or what is laid over it, and
# not what is rendered: each as here, whatever the artist's file says.
_WRITING = {
    "use_file_extension": False,
    "use_overwrite": True,
    "use_placeholder": False,
    "use_multiview": False,
    "use_stamp": False,
    "use_sequencer": False,
    "use_freestyle": False,
    "dither_intensity": 0.0,
}
if FIVE:
    _WRITING["save_output"] = True  # before, what is rendered to be written is written


def _as_new(settings: bpy.types.ImageFormatSettings) -> None:
    """Every setting as a new scene has it; a file brings those of the version that made it."""
    new = bpy.data.scenes.new("ARTO Output")
    try:
        there = new.render.image_settings
        # what may be chosen for the rest follows from these
        first = ["media_type", "file_format"] if FIVE else ["file_format"]
        names = [p.identifier for p in there.bl_rna.properties if not p.is_readonly]
        for name in first + [n for n in names if n not in first]:
            setattr(settings, name, getattr(there, name))
    finally:
        bpy.data.scenes.remove(new)


def set_format(settings: bpy.types.ImageFormatSettings, media: str, kind: str) -> None:
    """Choose a file format; from Blender 5 on it is among those of a medium."""
    if FIVE:
        settings.media_type = media
    settings.file_format = kind


def float_exr(render: bpy.types.RenderSettings, multilayer: bool = True) -> None:
    """Set a scene's output to 32-bit float EXR of a part for each pass, and nothing over it."""
    for name, value in _WRITING.items():
        setattr(render, name, value)
    settings = render.image_settings
    _as_new(settings)
    if multilayer:
        set_format(settings, "MULTI_LAYER_IMAGE", "OPEN_EXR_MULTILAYER")
    else:
        set_format(settings, "IMAGE", "OPEN_EXR")
    settings.color_mode = "RGBA"
    settings.color_depth = "32"
    settings.exr_codec = "NONE"  # files that are read again at once; packing takes longer
    if FIVE:
        settings.use_exr_interleave = False  # a part for each layer; before, one of all
    settings.color_management = "FOLLOW_SCENE"


def write_to(render: bpy.types.RenderSettings, path: Path) -> None:
    """Have a scene's next render written to this very path.

    An output path of Blender is a template, in which a brace that is meant stands twice.
    """
    render.filepath = str(path).replace("{", "{{").replace("}", "}}")
