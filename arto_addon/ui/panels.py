"""The panel in the render properties: build, capture, fit and relight, in that order."""

from __future__ import annotations

import bpy

from ...core.hemicube import SIDES
from ..capture import planes
from ..shot import status


def _line(column: bpy.types.UILayout, found: tuple[str, bool] | None) -> None:
    """What is there already, below the button that makes it."""
    if found:
        text, serves = found
        column.label(text=text, icon="CHECKMARK" if serves else "ERROR")


class _Panel:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"


class ARTO_PT_main(_Panel, bpy.types.Panel):
    bl_label = "ARTO Relighting"
    bl_idname = "ARTO_PT_main"

    def draw(self, context: bpy.types.Context) -> None:
        column = self.layout.column()
        column.use_property_split = True
        column.use_property_decorate = False
        settings = context.scene.arto
        there = planes.built(context.scene)
        row = column.row(align=True)
        row.operator("arto.build_hemicube", icon="MESH_CUBE")
        row.operator("arto.remove_hemicube", text="", icon="TRASH")
        if there:
            hemicube, radius = there
            degrees = hemicube.parallax_degrees(radius)
            column.label(text=f"{len(hemicube)} patches, parallax {degrees:.2g}°")
        column.separator()
        column.prop(settings, "samples")
        column.operator("arto.capture", icon="RENDER_STILL")
        _line(column, status.capture_line(context.scene))
        column.separator()
        column.prop(settings, "support")
        column.prop(settings, "separate")
        column.operator("arto.fit", icon="MOD_LATTICE")
        _line(column, status.field_line(context.scene))
        column.separator()
        column.prop(settings, "own_lamps")
        column.prop(settings, "lamps")
        sub = column.column()
        sub.active = settings.lamps
        sub.prop(settings, "lamp_samples")
        column.prop(settings, "denoise")
        column.operator("arto.relight", icon="WORLD")


class ARTO_PT_hemicube(_Panel, bpy.types.Panel):
    bl_label = "Hemicube"
    bl_parent_id = "ARTO_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        column = self.layout.column()
        column.use_property_split = True
        column.use_property_decorate = False
        settings = context.scene.arto
        column.prop(settings, "preset")
        if settings.preset == "custom":
            column.prop(settings, "faces")
        sub = column.column()
        sub.active = any(face in settings.faces for face in SIDES)
        sub.prop(settings, "half_sides")
        column.prop(settings, "patches")
        column.prop(settings, "adaptive")
        column.prop(settings, "align")
        column.prop(settings, "rotation")
        column.prop(settings, "far")
        sub = column.column()
        sub.active = not settings.far
        sub.prop(settings, "size")


class ARTO_PT_capture(_Panel, bpy.types.Panel):
    bl_label = "Capture and Files"
    bl_parent_id = "ARTO_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        column = self.layout.column()
        column.use_property_split = True
        column.use_property_decorate = False
        settings = context.scene.arto
        for name in (
            "patterns",
            "grain",
            "route",
            "seed",
            "memory",
            "environment_width",
            "folder",
            "output",
        ):
            column.prop(settings, name)


CLASSES = (ARTO_PT_main, ARTO_PT_hemicube, ARTO_PT_capture)
