"""The sliders of a world: its rotation, strength and tint, whatever its nodes.

A slider moves a node of the artist's where a fitting node is found. Else a setter adds nodes, which
the artist can see and undo. Getters run while a panel is drawn, and change nothing. Setters run
when a slider is moved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import bpy

from ...core.kit.model import BaseKind
from ..blender.nodes import shader_tree, world_of_nodes
from ..kit import base, kit
from .dials import backgrounds, put_in_scaler, scaler, turn, turn_to, why_not_turned

__all__ = ["turn"]

# The name of the node that `set_tint` adds.
TINT = "ARTO Tint"


def set_turn(world: bpy.types.World, angle: float) -> None:
    """Turn a world to an angle in radians, by its own nodes or by one that is added.

    Nothing happens to a world that cannot be turned (`why_not_turned`).
    """
    if not why_not_turned(world):
        turn_to(world, angle)


def strength(world: bpy.types.World) -> float:
    """How bright a world is, as the slider shows it; 1 where no socket scales the whole world."""
    socket = scaler(world)
    return socket.default_value if socket else 1.0


def set_strength(world: bpy.types.World, value: float) -> None:
    """Set how bright a world is.

    The value is the strength of the world's background node. Where there are several backgrounds,
    or where other nodes work out the strength, it is a factor on all backgrounds. Nothing happens
    to a world that is linked from a library or has no background.
    """
    if not world.library:
        world_of_nodes(world)
    if world.library or not backgrounds(world):
        return
    socket = scaler(world)
    if socket is None:
        socket = put_in_scaler(world)
    socket.default_value = max(value, 0.0)


def tint(world: bpy.types.World) -> tuple[float, float, float]:
    """The colour that multiplies a world's light, white where `set_tint` has added no node."""
    tree = shader_tree(world)
    node = tree.nodes.get(TINT) if tree else None
    return tuple(node.outputs[0].default_value[:3]) if node else (1.0, 1.0, 1.0)


def set_tint(world: bpy.types.World, colour: Sequence[float]) -> None:
    """Set the colour that multiplies a world's light.

    Nothing happens to a world that is linked from a library or has no background.
    """
    if not world.library:
        world_of_nodes(world)
    if world.library or not backgrounds(world):
        return
    tree = world.node_tree
    node = tree.nodes.get(TINT) or _add_tint(world)
    node.outputs[0].default_value = (*colour[:3], 1.0)


def _add_tint(world: bpy.types.World) -> bpy.types.Node:
    tree = world.node_tree
    dial = tree.nodes.new("ShaderNodeRGB")
    dial.name = dial.label = TINT
    dial.outputs[0].default_value = (1.0, 1.0, 1.0, 1.0)
    for background in backgrounds(world):
        into = background.inputs["Color"]
        times = tree.nodes.new("ShaderNodeMix")
        times.data_type, times.blend_type, times.label = "RGBA", "MULTIPLY", TINT
        x, y = background.location
        times.location = (x - 180, y + 120)
        dial.location = (x - 360, y + 180)
        factor, one, other = (s for s in times.inputs if s.enabled)
        factor.default_value = 1.0
        if into.is_linked:
            tree.links.new(into.links[0].from_socket, one)
        else:
            one.default_value = into.default_value
        tree.links.new(dial.outputs[0], other)
        tree.links.new(next(s for s in times.outputs if s.enabled), into)
    return dial


def hdri(world: bpy.types.World) -> bpy.types.Image | None:
    """The HDRI in a world's own tree (not in its groups); None without one."""
    return next((n.image for n in texture_nodes(world) if n.image), None)


def texture_nodes(world: bpy.types.World) -> list[bpy.types.Node]:
    """The nodes of a world's own tree that show an HDRI, without that of a light kit's backdrop."""
    tree = shader_tree(world)
    kind = "ShaderNodeTexEnvironment"
    found = [n for n in tree.nodes if n.bl_idname == kind] if tree else []
    return [n for n in found if n.name != f"{base.BACKDROP} HDRI"]


def set_hdri(world: bpy.types.World, image: bpy.types.Image) -> None:
    """Light a world with an HDRI.

    The first environment texture shows the HDRI. Without such a node, a new one is linked to the
    background. In a light kit the HDRI is the base. Raises KitError for a kit that is linked, or
    whose values other nodes work out.
    """
    if kit.has(world):
        found = kit.read(world)
        new = replace(found.base, kind=BaseKind.HDRI, image=base.text_of(image))
        kit.write(world, replace(found, base=new))
        return
    nodes = texture_nodes(world)
    if nodes:
        nodes[0].image = image
        return
    tree = world_of_nodes(world)
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    found = backgrounds(world)
    background = found[0] if found else tree.nodes.new("ShaderNodeBackground")
    texture.location = (background.location.x - 300, background.location.y)
    tree.links.new(texture.outputs["Color"], background.inputs["Color"])
    if not found:
        out = tree.get_output_node("CYCLES") or tree.nodes.new("ShaderNodeOutputWorld")
        tree.links.new(background.outputs[0], out.inputs["Surface"])
