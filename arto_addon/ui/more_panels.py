"""The closed panels: frames, layers, storage, and the method's own words where asked for."""

from __future__ import annotations

import bpy

from ...core.capture.kinds import Keep
from ...core.errors import ArtoError
from ...core.faces import SIDES
from ...core.units import size
from ..blender.words import tr
from ..capture import planes
from ..settings.table import in_panel
from ..shot import paths, status
from ..shot.shot import layer_of
from .places import Draws, say, slot
from .preferences import research


class Main(Draws):
    """ARTO: the light of a finished shot"""

    label = "ARTO Relighting"

    @staticmethod
    def draw_column(column: bpy.types.UILayout, context: bpy.types.Context) -> None:
        column.operator("arto.open_guide", icon="HELP")


class Frames(Draws):
    """A capture of each frame, and plates as a sequence"""

    label = "Frames"
    closed = True

    @staticmethod
    def draw_column(column: bpy.types.UILayout, context: bpy.types.Context) -> None:
        scene = context.scene
        row = column.row(align=True)
        row.prop(scene, "frame_start", text="Start")
        row.prop(scene, "frame_end", text="End")
        row.prop(scene, "frame_step", text="Step")
        column.operator("arto.capture_frames", icon="RENDER_ANIMATION")
        column.operator("arto.relight_frames", icon="WORLD")


class Layers(Draws):
    """The light apart, and footage"""

    label = "Layers and Footage"
    closed = True

    @staticmethod
    def draw_column(column: bpy.types.UILayout, context: bpy.types.Context) -> None:
        settings = context.scene.arto
        column.prop(settings, "layers", text="")
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
                say(column, context, "Painted")
                column.prop(group, "mask", text="")
                if not group.mask:
                    for name in ("azimuth", "elevation", "radius", "soft"):
                        column.prop(group, name)
        if settings.layers != "OFF":
            column.prop(settings, "layer_prefix", text="Prefix")
            column.prop(settings, "layers_files", text="")
            column.prop(settings, "layers_half")
            column.prop(settings, "scripts")
            column.operator("arto.mix_to_scene", icon="WORLD_DATA")
        say(column, context, "Footage")
        column.prop(settings, "footage", text="")
        column.prop(settings, "shadows", text="")
        column.prop(settings, "write_data")
        if settings.write_data:
            column.prop(settings, "cryptomatte", text="")
        say(column, context, "Data Window")
        column.prop(settings, "data_window", text="")
        column.prop(settings, "overscan")


class Storage(Draws):
    """What is on disk, and where"""

    label = "Storage"
    closed = True

    @staticmethod
    def draw_column(column: bpy.types.UILayout, context: bpy.types.Context) -> None:
        scene, settings = context.scene, context.scene.arto
        try:
            place = paths.place(scene, layer_of(scene), fresh=bpy.app.background)
        except (ArtoError, OSError) as e:
            say(column, context, str(e), "ERROR")
        else:
            for name, text in (("capture", "Capture"), ("field", "What relighting reads")):
                found = status.disk(place.source / name)
                say(column, context, f"{tr(text)}: {size(found) if found else '-'}")
            row = column.row()
            row.enabled = bool(status.unfinished(place.source))
            row.operator("arto.discard_unfinished", icon="TRASH")
            row = column.row()
            own = place.folder == place.source
            row.enabled = own and (place.source / "capture").is_dir()
            row.operator("arto.delete_capture", icon="TRASH")
        say(column, context, "Folder")
        column.prop(settings, "folder", text="")
        say(column, context, "Relit Picture")
        column.prop(settings, "output", text="")
        column.prop(settings, "overwrite")
        column.prop(settings, "compression", text="")
        column.prop(settings, "depth", text="")
        column.prop(settings, "keep", text="")
        if settings.keep == Keep.FITS:
            column.prop(settings, "keep_limit")
        column.prop(settings, "memory")


class Method(Draws):
    """Patches, patterns and supports, as the paper has them"""

    label = "Method"
    closed = True

    @staticmethod
    def shown(context: bpy.types.Context) -> bool:
        return research(context)

    @staticmethod
    def draw_column(column: bpy.types.UILayout, context: bpy.types.Context) -> None:
        scene, settings = context.scene, context.scene.arto
        column.use_property_split = True
        column.use_property_decorate = False
        row = column.row(align=True)
        row.operator("arto.build_hemicube", icon="MESH_CUBE")
        row.operator("arto.remove_hemicube", text="", icon="TRASH")
        if there := planes.built(scene):
            hemicube, radius = there
            degrees = hemicube.parallax_degrees(radius)
            column.label(text=f"{len(hemicube)} patches, parallax {degrees:.2g}°")
        apply = {
            "faces": settings.preset == "custom",
            "half_sides": any(face in settings.faces for face in SIDES),
            "size": not settings.far,
        }
        for name in in_panel("Method", "hemicube"):
            sub = column.column()
            sub.active = apply.get(name, True)
            if name != "faces" or sub.active:
                sub.prop(settings, name)
        for name in in_panel("Method", "capture"):
            column.prop(settings, name)
        column.separator()
        column.operator("arto.capture", icon="RENDER_STILL")
        _line(column, context, status.capture_line(scene))
        for name in in_panel("Method", "fit"):
            column.prop(settings, name)
        column.operator("arto.fit", icon="MOD_LATTICE")
        _line(column, context, status.field_line(scene))


def _line(
    column: bpy.types.UILayout, context: bpy.types.Context, found: status.Line | None
) -> None:
    text, serves = found or ("-", False)
    icon = "CHECKMARK" if serves else "ERROR"
    slot(column, context, text, icon if found else "NONE")
