"""The entries of the artist's lists: looks, groups of the world's light, groups of lamps."""

# pyright: reportInvalidTypeForm=false
# Blender reads properties from annotations.
from __future__ import annotations

import math

import bpy
from bpy.props import BoolProperty, FloatProperty, PointerProperty, StringProperty

from ..relight import looks


class ArtoGroup(bpy.types.PropertyGroup):
    """A part of the world's light that gets a layer of its own. Its name is the layer's."""

    mask: PointerProperty(
        type=bpy.types.Image,
        name="Painted",
        description="An image of the HDRI's shape: where it is white, the light is in this group. "
        "Empty: a round part of the light",
    )
    azimuth: FloatProperty(
        name="Azimuth",
        description="Where its middle is, counterclockwise from +X as seen from above",
        subtype="ANGLE",
        soft_min=-math.pi,
        soft_max=math.pi,
    )
    elevation: FloatProperty(
        name="Elevation",
        description="How high its middle is above the horizon",
        subtype="ANGLE",
        min=-math.pi / 2,
        max=math.pi / 2,
    )
    radius: FloatProperty(
        name="Radius",
        description="How far it reaches from its middle",
        subtype="ANGLE",
        min=0.0,
        max=math.pi,
        default=math.radians(30),
    )
    soft: FloatProperty(
        name="Soft Edge",
        description="Over which share of its radius it fades",
        min=0.0,
        max=1.0,
        default=0.1,
    )


def _look_named(self: ArtoLook, context: bpy.types.Context) -> None:
    looks.named(self.id_data, self)


class ArtoLook(bpy.types.PropertyGroup):
    """A light that the shot is shown in. Its name is that of its plate."""

    name: StringProperty(
        name="Name",
        description="What the look is called; its plate is named after it",
        update=_look_named,
    )
    world: PointerProperty(
        type=bpy.types.World, name="World", description="The world that lights this look"
    )


class ArtoLamps(bpy.types.PropertyGroup):
    """A light group of the scene's own lamps. Its name is the group's."""

    show: BoolProperty(name="Show", description="Whether these lamps are lit", default=True)
    gain: FloatProperty(
        name="Gain",
        description="How much of these lamps' light is shown, as a factor of what was captured",
        min=0.0,
        soft_max=4.0,
        default=1.0,
    )


# The type of a list's entries, by the setting that holds the list.
ENTRIES = {"looks": ArtoLook, "own_groups": ArtoLamps, "groups": ArtoGroup}
