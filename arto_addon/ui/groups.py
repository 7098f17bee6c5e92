"""The list of groups of the world's light. Each group gets its own layer."""

from __future__ import annotations

import bpy


class ARTO_UL_groups(bpy.types.UIList):
    """Groups by name."""

    def draw_item(
        self, _context, layout, _data, item, _icon, _active_data, _active_property, _index
    ) -> None:
        layout.prop(item, "name", text="", emboss=False, icon="LIGHT_SUN")


class ARTO_OT_add_group(bpy.types.Operator):
    """Add a group: a round part of the world's light with a layer of its own"""

    bl_idname = "arto.add_group"
    bl_label = "Add Group"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.arto
        taken, number = {group.name for group in settings.groups}, 1
        while f"group{number}" in taken:
            number += 1
        settings.groups.add().name = f"group{number}"
        settings.active_group = len(settings.groups) - 1
        return {"FINISHED"}


class ARTO_OT_remove_group(bpy.types.Operator):
    """Remove the group that is chosen in the list"""

    bl_idname = "arto.remove_group"
    bl_label = "Remove Group"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        settings = context.scene.arto
        if not 0 <= settings.active_group < len(settings.groups):
            cls.poll_message_set("No group is chosen")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.arto
        settings.groups.remove(settings.active_group)
        settings.active_group = max(0, settings.active_group - 1)
        return {"FINISHED"}


CLASSES = (ARTO_UL_groups, ARTO_OT_add_group, ARTO_OT_remove_group)
