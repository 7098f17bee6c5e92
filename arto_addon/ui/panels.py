"""The panel in the render properties: build, capture, fit and relight, in that order."""

from __future__ import annotations

import bpy

from ...core.hemicube import SIDES
from ..capture import planes
from ..capture.planned import guess
from ..job import session
from ..shot import paths, status
from ..shot.status import Line
from ..stage.settings import looks_otherwise
from . import properties


def _line(column: bpy.types.UILayout, found: Line | None) -> None:
    """What is there already, below the button that makes it."""
    if found:
        text, serves = found
        column.label(text=text, icon="CHECKMARK" if serves else "ERROR")


def _settings(column: bpy.types.UILayout, settings: bpy.types.PropertyGroup, *names: str) -> None:
    for name in names:
        column.prop(settings, name)


class Panel:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"

    def column(self) -> bpy.types.UILayout:
        column = self.layout.column()
        column.use_property_split = True
        column.use_property_decorate = False
        return column


class ARTO_PT_main(Panel, bpy.types.Panel):
    bl_label = "ARTO Relighting"
    bl_idname = "ARTO_PT_main"

    def draw(self, context: bpy.types.Context) -> None:
        column, settings = self.column(), context.scene.arto
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
        if not session.current:
            column.label(text=guess(context.scene, short=True), icon="DISK_DRIVE")
        _line(column, status.capture_line(context.scene))
        _line(column, status.caution_line(context.scene))
        if stopped := status.unfinished_line(context.scene):
            row = column.row(align=True)
            _line(row, stopped)
            row.operator("arto.discard_unfinished", text="", icon="TRASH")
        if status.is_of_another(context.scene):
            column.operator("arto.adopt")
        column.separator()
        _settings(column, settings, *properties.FIT)
        column.operator("arto.fit", icon="MOD_LATTICE")
        _line(column, status.field_line(context.scene))
        column.separator()
        _settings(column, settings, "own_lamps", "lamps")
        sub = column.column()
        sub.active = settings.lamps
        _settings(sub, settings, "lamp_samples")
        _settings(column, settings, "denoise", "look")
        column.operator("arto.relight", icon="WORLD")
        for text in looks_otherwise(context.scene):
            column.label(text=text, icon="INFO")
        self._work(column)

    def _work(self, column: bpy.types.UILayout) -> None:
        """What runs, or how the last piece of work ended."""
        if job := session.current:
            column.separator()
            column.label(text=f"{job.state.text[0].upper()}{job.state.text[1:]}")
            row = column.row(align=True)
            row.progress(factor=job.state.share, text=job.line)
            row.operator("arto.cancel", text="", icon="X")
        elif ended := session.outcome:
            icons = {"INFO": "INFO", "WARNING": "ERROR", "ERROR": "CANCEL"}
            column.label(text=ended.text, icon=icons[ended.level])


class ARTO_PT_hemicube(Panel, bpy.types.Panel):
    bl_label = "Hemicube"
    bl_parent_id = "ARTO_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        column, settings = self.column(), context.scene.arto
        apply = {
            "faces": settings.preset == "custom",
            "half_sides": any(face in settings.faces for face in SIDES),
            "size": not settings.far,
        }
        for name in properties.HEMICUBE:
            sub = column.column()
            sub.active = apply.get(name, True)
            if name != "faces" or sub.active:
                sub.prop(settings, name)


class ARTO_PT_frames(Panel, bpy.types.Panel):
    bl_label = "Frames"
    bl_parent_id = "ARTO_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        column, scene = self.column(), context.scene
        row = column.row(align=True)
        row.prop(scene, "frame_start", text="Frames")
        row.prop(scene, "frame_end", text="")
        row.prop(scene, "frame_step", text="")
        column.operator("arto.capture_frames", icon="RENDER_ANIMATION")
        column.operator("arto.relight_frames", icon="WORLD")


class ARTO_PT_capture(Panel, bpy.types.Panel):
    bl_label = "Capture and Files"
    bl_parent_id = "ARTO_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        column, settings = self.column(), context.scene.arto
        _settings(column, settings, *(n for n in properties.CAPTURE if n != "samples"))
        _settings(column, settings, "environment_width", "folder", "output")
        place = paths.shown(context.scene)
        if place:
            column.label(text=place, icon="FILE_FOLDER")


CLASSES = (ARTO_PT_main, ARTO_PT_frames, ARTO_PT_hemicube, ARTO_PT_capture)
