"""A scene's output: where Blender writes a render, and how."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy

from .version import FIVE

# The render settings that decide how a picture is written or what is laid over it. They do not
# change what is rendered. ARTO sets each to the value here, whatever the artist's file says.
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
    _WRITING["save_output"] = True  # Blender 4.5 always saves what is rendered to a file.


def _as_new(settings: bpy.types.ImageFormatSettings) -> None:
    """Set every format setting to the value in a new scene.

    An older .blend has the values of the Blender that saved it.
    """
    new = bpy.data.scenes.new("ARTO Output")
    try:
        there = new.render.image_settings
        for name in _names(there):
            setattr(settings, name, getattr(there, name))
    finally:
        bpy.data.scenes.remove(new)


def _names(settings: bpy.types.ImageFormatSettings) -> list[str]:
    """The names of all format settings, in an order in which they can be set."""
    # The allowed values of the other settings depend on these.
    first = ["media_type", "file_format"] if FIVE else ["file_format"]
    names = [p.identifier for p in settings.bl_rna.properties if not p.is_readonly]
    return first + [n for n in names if n not in first]


@contextmanager
def borrowed(render: bpy.types.RenderSettings) -> Iterator[None]:
    """Let an artist's scene write a picture as ARTO needs it, and put all its settings back."""
    settings = render.image_settings
    formats = {name: getattr(settings, name) for name in _names(settings)}
    others = {name: getattr(render, name) for name in _WRITING}
    try:
        float_exr(render, multilayer=False)
        yield
    finally:
        for owner, values in ((settings, formats), (render, others)):
            for name, value in values.items():
                setattr(owner, name, value)


def set_format(settings: bpy.types.ImageFormatSettings, media: str, kind: str) -> None:
    """Choose a file format; from Blender 5 on, the medium is chosen first."""
    if FIVE:
        settings.media_type = media
    settings.file_format = kind


def float_exr(render: bpy.types.RenderSettings, multilayer: bool = True) -> None:
    """Set a scene's output to 32-bit float EXR with nothing laid over the picture.

    multilayer: write all passes, from Blender 5 on as a part for each pass; else the picture alone.
    """
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
    settings.exr_codec = "NONE"  # The files are read again at once, and packing would take longer.
    if FIVE:
        settings.use_exr_interleave = False  # A part for each pass; Blender 4.5 writes one for all.
    settings.color_management = "FOLLOW_SCENE"


def write_to(render: bpy.types.RenderSettings, path: Path) -> None:
    """Have a scene's next render written to exactly this path.

    Blender reads an output path as a template, in which a literal brace is written twice.
    """
    render.filepath = str(path).replace("{", "{{").replace("}", "}}")
