"""Groups of the world's light, which get layers of their own: their list and panel."""

from __future__ import annotations

import bpy

from .panels import Panel


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


class ARTO_PT_layers(Panel, bpy.types.Panel):
    bl_label = "Layers and Footage"
    bl_parent_id = "ARTO_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        column, settings = self.column(), context.scene.arto
        column.prop(settings, "layers")
        if settings.layers == "GROUPS":
            row = column.row()
            row.template_list(
                "ARTO_UL_groups", "", settings, "groups", settings, "active_group", rows=3
            )
            buttons = row.column(align=True)
            buttons.operator("arto.add_group", text="", icon="ADD")
            buttons.operator("arto.remove_group", text="", icon="REMOVE")
            if 0 <= settings.active_group < len(settings.groups):
                group = settings.groups[settings.active_group]
                column.prop(group, "mask")
                if not group.mask:
                    for name in ("azimuth", "elevation", "radius", "soft"):
                        column.prop(group, name)
        if settings.layers != "OFF":
            column.prop(settings, "layer_prefix")
            column.prop(settings, "layers_files")
            column.prop(settings, "layers_half")
            column.operator("arto.mix_to_scene", icon="WORLD_DATA")
        column.prop(settings, "write_data")
        if settings.write_data:
            column.prop(settings, "cryptomatte")
        column.prop(settings, "data_window")
        column.prop(settings, "overscan")
        column.prop(settings, "footage")
        column.prop(settings, "shadows")
        column.prop(settings, "use_in_compositor")


CLASSES = (ARTO_UL_groups, ARTO_OT_add_group, ARTO_OT_remove_group, ARTO_PT_layers)
