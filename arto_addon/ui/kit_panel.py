"""The list of the light kit in the panel *Light*, and the values of the light that is chosen."""

from __future__ import annotations

import bpy

from ...core.kit.light import Blend, Kind
from ..blender.words import tr
from ..kit import groups
from ..kit import kit as kits
from .kit_operators import BLENDS, KINDS, chosen
from .places import say

_ICONS = {Kind(kind): icon for kind, _, _, icon, _ in KINDS}
# Inputs that a kind does not have.
_LACKS = {
    Kind.SUN: {"Height", "Roll", "Hole", "Gradient", "Slope"},
    Kind.RING: set(),
}
PREFIXES = (("ARTO Base", "Base", False), ("ARTO Backdrop", "Backdrop", True))


class ARTO_UL_kit(bpy.types.UIList):
    """The lights of a kit: the nodes of its world that are lights, the front one first."""

    def draw_item(
        self, _context, layout, _data, item, _icon, _active_data, _active_property, _index
    ) -> None:
        found = groups.what(item.node_tree)
        lit, alone = not item.mute, bool(item.get(kits.SOLO, False))
        row = layout.row(align=True)
        name = row.row(align=True)
        name.active = lit
        name.prop(item, "label", text="", emboss=False, icon=_ICONS[found[0]] if found else "NONE")
        for what, icon in (
            ("SOLO", "SOLO_ON" if alone else "SOLO_OFF"),
            ("ON", "HIDE_OFF" if lit else "HIDE_ON"),
            ("LOCK", "LOCKED" if item.get(kits.LOCK, False) else "UNLOCKED"),
        ):
            button = row.operator("arto.kit_switch", text="", icon=icon, emboss=False)
            button.what, button.light = what, item.label

    def filter_items(
        self, _context: bpy.types.Context, data: bpy.types.NodeTree, property: str
    ) -> tuple[list[int], list[int]]:
        nodes = list(getattr(data, property))
        world = next((w for w in bpy.data.worlds if w.node_tree == data), None)
        order = kits.nodes_of(world)[::-1] if world else []
        places = {node.as_pointer(): i for i, node in enumerate(order)}
        flags, orders, after = [], [], len(places)
        for node in nodes:
            place = places.get(node.as_pointer())
            flags.append(0 if place is None else self.bitflag_filter_item)
            # The order has a place for every node: those that are no lights come after.
            orders.append(after if place is None else place)
            after += place is None
        return flags, orders


def draw_kit(
    column: bpy.types.UILayout, context: bpy.types.Context, world: bpy.types.World | None
) -> None:
    """Draw the list of lights, the buttons beside it, and the chosen light."""
    column.separator(factor=0.5)
    header = column.row(align=True)
    header.operator_menu_enum("arto.kit_preset", "preset", text="Preset", icon="PRESET")
    header.operator_menu_enum("arto.kit_add", "kind", text="Add Light", icon="ADD")
    if world is None or not kits.has(world):
        return
    if why := kits.why_not(world):
        say(column, context, why, "INFO")
        return
    row = column.row()
    nodes = kits.nodes_of(world)
    rows = max(3, min(len(nodes), 8))
    row.template_list("ARTO_UL_kit", "", world.node_tree, "nodes", world.arto, "kit_light",
                      rows=rows)  # fmt: skip
    buttons = row.column(align=True)
    buttons.operator("arto.kit_remove", text="", icon="REMOVE").light = ""
    buttons.operator("arto.kit_duplicate", text="", icon="DUPLICATE").light = ""
    up = buttons.operator("arto.kit_move", text="", icon="TRIA_UP")
    up.light, up.by = "", 1
    down = buttons.operator("arto.kit_move", text="", icon="TRIA_DOWN")
    down.light, down.by = "", -1
    place = column.row(align=True)
    for what, name in (("REFLECT", "Reflect"), ("LIGHT", "Light"), ("RIM", "Rim"),
                       ("SHADE", "Shade")):  # fmt: skip
        button = place.operator("arto.put_there", text=name)
        button.what, button.chosen = what, False
    node = chosen(world)
    if node is not None:
        _light(column, node)
    _base(column, world)
    files = column.row(align=True)
    files.operator("arto.kit_load", text="Load", icon="FILE_FOLDER")
    files.operator("arto.kit_save", text="Save", icon="FILE_TICK")
    files.operator("arto.kit_to_hdri", text="HDRI", icon="EXPORT")
    files.operator("arto.kit_to_lamps", text="Lamps", icon="LIGHT_AREA")


def _light(column: bpy.types.UILayout, node: bpy.types.Node) -> None:
    found = groups.what(node.node_tree)
    if found is None:
        return
    kind, blend = found
    box = column.column()
    box.enabled = not node.get(kits.LOCK, False)
    row = box.row(align=True)
    if kind is not Kind.PICTURE:
        name = next(k[1] for k in KINDS if k[0] == kind)
        row.operator_menu_enum("arto.kit_kind", "kind", text=name, icon=_ICONS[kind])
    row.operator_menu_enum("arto.kit_blend", "blend", text=_blend_name(blend))
    place = box.operator_menu_enum("arto.put_there", "what", text="Put It There")
    place.chosen = True
    if kind is Kind.PICTURE:
        box.template_ID(groups.picture_node(node.node_tree), "image", open="image.open")
    lacks = _LACKS.get(kind, {"Hole"})
    values = box.column(align=True)
    for one in groups.INPUTS:
        if one.value and one.name not in lacks and (one.name != "Hole" or kind is Kind.RING):
            socket = node.inputs[one.name]
            text = tr("Size") if kind is Kind.SUN and one.name == "Width" else tr(one.name)
            if socket.is_linked:
                values.label(text=f"{text}: {tr('by nodes')}", translate=False)
            else:
                values.prop(socket, "default_value", text=text, translate=False)


def _blend_name(blend: Blend) -> str:
    return next(b[1] for b in BLENDS if b[0] == blend)


def _base(column: bpy.types.UILayout, world: bpy.types.World) -> None:
    tree = world.node_tree
    for prefix, title, backdrop in PREFIXES:
        row = column.row(align=True)
        button = row.operator_menu_enum("arto.kit_base", "kind", text=title, icon="WORLD")
        button.backdrop = backdrop
        strength, turn = tree.nodes.get(f"{prefix} Strength"), tree.nodes.get(f"{prefix} Turn")
        blur = tree.nodes.get(f"{prefix} Blur")
        if backdrop and strength is not None:
            row.operator("arto.kit_no_backdrop", text="", icon="X")
        if strength is None:
            continue
        values = column.column(align=True)
        values.prop(strength.inputs["Scale"], "default_value", text=tr("Strength"), translate=False)
        if turn is not None:
            values.prop(turn.inputs["Rotation"], "default_value", index=2, text=tr("Rotation"),
                        translate=False)  # fmt: skip
        if blur is not None:
            values.prop(blur.inputs["Blur"], "default_value", text=tr("Blur"), translate=False)
        gradient = tree.nodes.get(f"{prefix} Gradient")
        if gradient is not None:
            colours = values.row(align=True)
            for name in ("Top", "Horizon", "Bottom"):
                colours.prop(gradient.inputs[name], "default_value", text="")
        texture = tree.nodes.get(f"{prefix} HDRI")
        if texture is not None and backdrop:
            values.template_ID(texture, "image", open="image.open")
    column.operator("arto.kit_from_hdri", icon="LIGHT_SUN")
