"""The panel *As in a Picture*: the target of a match, and what may change."""

from __future__ import annotations

import bpy

from .places import Draws, say


class MatchPanel(Draws):
    """The light in which the shot looks like a picture"""

    label = "As in a Picture"
    closed = True

    @staticmethod
    def draw_column(column: bpy.types.UILayout, context: bpy.types.Context) -> None:
        settings = context.scene.arto
        column.prop(settings, "match_target", text="")
        row = column.row()
        row.enabled = not settings.match_target
        row.prop(settings, "match_image", text="")
        column.operator("arto.paint_over", icon="BRUSH_DATA")
        column.prop(settings, "match_mask")
        column.prop(settings, "match_keep")
        column.prop(settings, "match_change")
        free = column.row(align=True)
        sub = free.row(align=True)
        sub.enabled = settings.match_change != "LIGHT"
        sub.prop(settings, "match_colours", toggle=True)
        sub.prop(settings, "match_own", toggle=True)
        column.prop(settings, "match_near", slider=True)
        say(column, context, "Do not count of the target")
        free = column.row(align=True)
        free.prop(settings, "match_exposure", toggle=True)
        free.prop(settings, "match_balance", toggle=True)
        row = column.row()
        row.scale_y = 1.3
        row.operator("arto.match", icon="EYEDROPPER")
        row = column.row(align=True)
        row.operator("arto.even_out")
        row.operator("arto.where_from")
        column.operator("arto.show_missing")
