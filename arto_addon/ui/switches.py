"""Properties that no file keeps: switches, the world's dials, and what was looked at."""

# pyright: reportInvalidTypeForm=false
# Blender reads properties from annotations.
from __future__ import annotations

import math
from collections.abc import Sequence

import bpy
from bpy.props import (
    BoolProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ...core.errors import ArtoError
from ..live import live
from ..world import controls
from . import overlay


def _get_live(self: ArtoWindow) -> bool:
    return live.current is not None


def _set_live(self: ArtoWindow, on: bool) -> None:
    if not on:
        live.stop()
        return
    try:
        live.start(bpy.context.scene)
    except ArtoError as e:
        live.trouble = str(e)


# functions with names: Blender evaluates annotations as text, where a lambda finds no module
def _get_overlay(self: ArtoWindow) -> bool:
    return overlay.shown()


def _set_overlay(self: ArtoWindow, on: bool) -> None:
    overlay.switch(on)


def _get_turn(self: ArtoWorld) -> float:
    return controls.turn(self.id_data)


def _set_turn(self: ArtoWorld, angle: float) -> None:
    controls.set_turn(self.id_data, angle)


def _get_strength(self: ArtoWorld) -> float:
    return controls.strength(self.id_data)


def _set_strength(self: ArtoWorld, value: float) -> None:
    controls.set_strength(self.id_data, value)


def _get_tint(self: ArtoWorld) -> tuple[float, float, float]:
    return controls.tint(self.id_data)


def _set_tint(self: ArtoWorld, colour: Sequence[float]) -> None:
    controls.set_tint(self.id_data, colour)


class ArtoWindow(bpy.types.PropertyGroup):
    """Switches and results that belong to the window."""

    live: BoolProperty(
        name="Live",
        description="Follow every change of the world in the image editor while you make it: small "
        "while it moves, whole when it rests, then with the HDRI's suns and denoised",
        get=_get_live,
        set=_set_live,
        options={"SKIP_SAVE"},
    )
    overlay: BoolProperty(
        name="Show Patches",
        description="Draw the patches that the light comes from around the scene, with the HDRI on "
        "them: in the 3D viewport alone, nothing of it is in the scene",
        get=_get_overlay,
        set=_set_overlay,
        options={"SKIP_SAVE"},
    )
    strip: IntProperty(name="Strip", description="Which part of the strip of HDRIs is shown", min=0)
    seen: StringProperty(name="Seen", description="What the last look inside found")
    seen_in: StringProperty(name="Seen In", description="The scene that was looked into")


class ArtoWorld(bpy.types.PropertyGroup):
    """A world's dials. They act on the world's own nodes, or on nodes that ARTO adds."""

    rotation: FloatProperty(
        name="Rotation",
        description="Turn of the HDRI about the vertical, in degrees, clockwise from above",
        subtype="ANGLE",
        soft_min=-math.pi,
        soft_max=math.pi,
        get=_get_turn,
        set=_set_turn,
    )
    strength: FloatProperty(
        name="Strength",
        description="How bright the world is, as a factor of its HDRI",
        min=0.0,
        soft_max=5.0,
        get=_get_strength,
        set=_set_strength,
    )
    tint: FloatVectorProperty(
        name="Tint",
        description="A colour that the world's light is multiplied by; white leaves it as it is",
        subtype="COLOR",
        size=3,
        min=0.0,
        soft_max=1.0,
        get=_get_tint,
        set=_set_tint,
    )

    kit_light: IntProperty(
        name="Light of the Kit",
        description="The light that is chosen in the list",
        options={"HIDDEN"},
    )


CLASSES = (ArtoWindow, ArtoWorld)


def register() -> None:
    bpy.types.WindowManager.arto = PointerProperty(type=ArtoWindow, options={"SKIP_SAVE"})
    bpy.types.World.arto = PointerProperty(type=ArtoWorld)


def unregister() -> None:
    del bpy.types.WindowManager.arto
    del bpy.types.World.arto
