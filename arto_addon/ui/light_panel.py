"""The panel *Light*: the world, live, lamps, and looks."""

from __future__ import annotations

import contextlib

import bpy

from ...core.errors import ArtoError
from ..blender.compositing import compositor
from ..blender.words import tr
from ..live import live
from ..plate.names import relit_file
from ..plate.plate import name_of
from ..plate.present import MIX
from ..relight.layers import prefix_of
from ..shot import status
from ..world import controls, dials
from ..world.check import world_of
from . import strip, thumbnails
from .kit_panel import draw_kit
from .places import Draws, say, sentence, slot
from .result_panel import header_of


class LightPanel(Draws):
    """The world's light, and the scene's own lamps"""

    label = "Light"

    @staticmethod
    def draw_column(column: bpy.types.UILayout, context: bpy.types.Context) -> None:
        scene = context.scene
        world = world_of(scene)
        if world is None:
            say(column, context, "The scene has no world", "ERROR")
            column.operator("arto.open_hdri", icon="FILE_FOLDER")
            strip.draw(column, context, None)
            draw_kit(column, context, None)
            if live.trouble:
                say(column, context, sentence(live.trouble), "ERROR")
            return
        _world(column, context, world)
        _live(column, context)
        draw_kit(column, context, world)
        _own(column, context)
        _layers(column, context)
        _looks(column, context)


def _world(column: bpy.types.UILayout, context: bpy.types.Context, world: bpy.types.World) -> None:
    image = controls.hdri(world)
    if image is not None:
        row = column.row()
        row.alignment = "CENTER"
        row.template_icon(thumbnails.of_hdri(image), scale=4.5)
    strip.draw(column, context, world)
    nodes = controls.texture_nodes(world)
    if nodes:
        column.template_ID(nodes[0], "image", open="image.open")
    else:
        column.operator("arto.open_hdri", icon="FILE_FOLDER")
    sliders = column.column(align=True)
    turned = sliders.row()
    why = dials.why_not_turned(world)
    turned.enabled = not why
    turned.prop(world.arto, "rotation", slider=True)
    rest = sliders.column(align=True)
    rest.enabled = not world.library and bool(dials.backgrounds(world))
    rest.prop(world.arto, "strength")
    rest.prop(world.arto, "tint")
    if why:
        say(column, context, why, "INFO")


def _live(column: bpy.types.UILayout, context: bpy.types.Context) -> None:
    scene = context.scene
    there = status.field_line(scene) is not None or status.has_draft(scene)
    row = column.row(align=True)
    row.scale_y = 1.3
    row.enabled = there or live.current is not None
    switch = context.window_manager.arto
    row.prop(switch, "live", toggle=True, icon="LIGHT_SUN")
    row.prop(scene.arto, "live_finish", text="", icon="CHECKMARK")
    row.prop(switch, "overlay", text="", icon="MESH_CUBE")
    # always two lines, so that what is below does not jump
    if live.current is not None:
        slot(column, context, live.current.trouble or live.current.line)
    elif live.trouble:
        slot(column, context, sentence(live.trouble), "ERROR")
    elif there:
        slot(column, context, "Follows the world as you change it")
    else:
        slot(column, context, "Capture the shot to see it live", "INFO")
    row = column.row()
    row.enabled = not scene.arto.photographs
    row.prop(scene.arto, "lamps")
    if scene.arto.photographs:
        slot(column, context, "Suns shine by the patches: a photographed thing is not rendered")
    elif scene.arto.lamps:
        slot(column, context, lamps_line(scene), lines=1)


def lamps_line(scene: bpy.types.Scene) -> str:
    """What the last plate's header says of the HDRI's suns; empty without a plate."""
    try:
        header = header_of(relit_file(scene))
    except (ArtoError, OSError):
        return ""
    found = str(header.get("arto.lamps", ""))
    if found and found != "no":
        return tr("Suns in the last picture: {found}", found=found)
    return "The last picture had no suns"


def _own(column: bpy.types.UILayout, context: bpy.types.Context) -> None:
    settings = context.scene.arto
    column.separator(factor=0.5)
    column.prop(settings, "own_lamps")
    for group in settings.own_groups:
        row = column.row(align=True)
        icon = "HIDE_OFF" if group.show else "HIDE_ON"
        row.prop(group, "show", text="", icon=icon, emboss=False)
        sub = row.row()
        sub.enabled = group.show
        sub.prop(group, "gain", text=group.name, translate=False)


def mixer_of(scene: bpy.types.Scene) -> bpy.types.Node | None:
    """The node in the scene's compositor that mixes the layers of its plate; None without one."""
    tree, name = compositor(scene), name_of(scene) + MIX
    nodes = tree.nodes if tree else ()
    return next(
        (n for n in nodes if getattr(n, "node_tree", None) and n.node_tree.name == name), None
    )


def _layers(column: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw gains and tints of the plate's layers: the mixer's, where the compositor has a mixer."""
    node = mixer_of(context.scene)
    if node is None or context.scene.arto.layers == "OFF":
        return
    say(column, context, "Layers, in the compositor")
    for socket in node.inputs:
        tint = node.inputs.get(f"{socket.name} Tint")
        if tint is None or socket.is_linked:
            continue
        row = column.row(align=True)
        name = socket.name.removeprefix(prefix_of(context.scene))
        row.prop(socket, "default_value", text=name, translate=False)
        sub = row.row(align=True)
        sub.scale_x = 0.3
        sub.prop(tint, "default_value", text="")


class ARTO_UL_looks(bpy.types.UIList):
    """Looks by name, with their plates."""

    def draw_item(
        self, context, layout, _data, item, _icon, _active_data, _active_property, _index
    ) -> None:
        icon = 0
        with contextlib.suppress(ArtoError):  # a file that was never saved has no place for plates
            icon = thumbnails.of_plate(relit_file(context.scene, item.name))
        row = layout.row(align=True)
        if icon:
            row.template_icon(icon, scale=1.0)
        else:
            row.label(text="", icon="IMAGE_DATA")
        row.prop(item, "name", text="", emboss=False)


def _looks(column: bpy.types.UILayout, context: bpy.types.Context) -> None:
    settings = context.scene.arto
    column.separator(factor=0.5)
    if not settings.looks:
        column.operator("arto.add_look", text="Keep This Light as a Look", icon="ADD")
        return
    row = column.row()
    row.template_list("ARTO_UL_looks", "", settings, "looks", settings, "active_look", rows=3)
    buttons = row.column(align=True)
    buttons.operator("arto.add_look", text="", icon="ADD")
    buttons.operator("arto.remove_look", text="", icon="REMOVE")
    row = column.row(align=True)
    row.operator("arto.relight_looks", icon="RENDERLAYERS")
    row.operator("arto.sheet", icon="IMGDISPLAY")
