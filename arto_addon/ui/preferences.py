"""ARTO's preferences: of the machine, not of a scene."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty

ADDON = __package__.rpartition(".arto_addon")[0]


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
    """Whether the method's own words are shown."""
    addon = context.preferences.addons.get(ADDON)
    return bool(addon and addon.preferences and addon.preferences.research)


CLASSES = (ArtoPreferences,)
