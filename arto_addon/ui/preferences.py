"""ARTO's preferences: they belong to the machine, not to a scene."""

# pyright: reportInvalidTypeForm=false
# Blender reads properties from annotations.
from __future__ import annotations

import bpy
from bpy.props import BoolProperty

from ..blender.addon import ADDON


class ArtoPreferences(bpy.types.AddonPreferences):
    """What holds for every file on this machine."""

    bl_idname = ADDON

    research: BoolProperty(
        name="Research Options",
        description="Show the panel Method in the render properties: patches, patterns and "
        "supports, and capture and fit apart",
        default=False,
    )

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.prop(self, "research")


def research(context: bpy.types.Context) -> bool:
    """Whether the panel with the method's own words is shown."""
    addon = context.preferences.addons.get(ADDON)
    return bool(addon and addon.preferences and addon.preferences.research)


CLASSES = (ArtoPreferences,)
