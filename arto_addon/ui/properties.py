"""The settings on `scene.arto`."""

from __future__ import annotations

import bpy
from bpy.props import PointerProperty, StringProperty

from .capture_settings import CaptureSettings
from .relight_settings import ArtoGroup, ArtoLamps, ArtoLook, RelightSettings


class ArtoSettings(CaptureSettings, RelightSettings, bpy.types.PropertyGroup):
    """What the artist may choose; capture, fit and relight read it."""

    scene_id: StringProperty(
        name="Scene ID",
        description="By which what was captured of this scene is found when it or its file is "
        "renamed",
        options={"HIDDEN"},
        default="",
    )


# Which settings each piece of work reads: panel and command line take them from here.
HEMICUBE = (
    "preset", "faces", "half_sides", "patches", "adaptive", "align", "rotation", "far", "size",
)  # fmt: skip
CAPTURE = (
    "samples", "quality", "patterns", "grain", "route", "seed", "memory", "keep", "keep_limit",
)  # fmt: skip
FIT = ("support", "separate")
RELIGHT = (
    "own_lamps", "lamps", "lamp_samples", "denoise", "environment_width", "look", "output",
    "layers", "layer_prefix", "layers_files", "layers_half", "write_data", "cryptomatte", "shadows",
    "data_window", "overscan",
)  # fmt: skip

CLASSES = (ArtoGroup, ArtoLook, ArtoLamps, ArtoSettings)


def register() -> None:
    bpy.types.Scene.arto = PointerProperty(type=ArtoSettings)


def unregister() -> None:
    del bpy.types.Scene.arto
