"""Rotation, strength and tint of a world, whatever its nodes: its own where they are found, else
nodes that are put in, where an artist sees them and undo takes them out.

Getters run while a panel is drawn and change nothing; setters are called when a slider is moved.
"""

from __future__ import annotations

from typing import Any

import bpy

from ..blender.nodes import shader_tree, trees, world_of_nodes

# The nodes that are put in.
TURN, STRENGTH, TINT, PLACE = "ARTO Turn", "ARTO Strength", "ARTO Tint", "ARTO Place"
# What has its picture by direction, and the sockets that say so.
_PICTURES = {"ShaderNodeTexEnvironment", "ShaderNodeTexSky"}


def _top(world: bpy.types.World) -> Any:
    return shader_tree(world)


def backgrounds(world: bpy.types.World) -> list[Any]:
    """The background nodes of a world's own tree."""
    tree = _top(world)
    return [n for n in tree.nodes if n.bl_idname == "ShaderNodeBackground"] if tree else []


def _pictures(world: bpy.types.World) -> list[Any]:
    tree = _top(world)
    found = [n for n in tree.nodes if n.bl_idname in _PICTURES] if tree else []
    return [n for n in found if "Vector" in n.inputs and not n.inputs["Vector"].is_unavailable]


def _mapping(world: bpy.types.World) -> Any:
    """The mapping node that turns all pictures of a world; None where there is no such one."""
    found = []
    for picture in _pictures(world):
        links = picture.inputs["Vector"].links
        node = links[0].from_node if links else None
        if node is None or node.bl_idname != "ShaderNodeMapping":
            return None
        if node.inputs["Rotation"].is_linked:
            return None
        found.append(node)
    return found[0] if found and all(n == found[0] for n in found) else None


def why_not_turned(world: bpy.types.World) -> str:
    """Why a world cannot be turned, for a grey slider; empty where it can."""
    if world.library:
        return "The world is linked from a library: make it local to change it"
    if not _pictures(world):
        hidden = any(
            n.bl_idname in _PICTURES for t in trees(shader_tree(world), set()) for n in t.nodes
        )
        if hidden:
            return "The HDRI is in a node group: turn it there"
        return "The world has no HDRI or sky: it is the same from every side"
    if _mapping(world) is not None:
        return ""
    for picture in _pictures(world):
        links = picture.inputs["Vector"].links
        if links and links[0].from_node.bl_idname not in {
            "ShaderNodeTexCoord",
            "ShaderNodeMapping",
            "ShaderNodeNewGeometry",
        }:
            return "The HDRI is turned by nodes of its own: turn it there"
    return ""


def turn(world: bpy.types.World) -> float:
    """Radians about the vertical."""
    node = _mapping(world)
    return node.inputs["Rotation"].default_value[2] if node else 0.0


def set_turn(world: bpy.types.World, angle: float) -> None:
    """Turn a world; a mapping node is put in where there is none."""
    if why_not_turned(world):
        return
    node = _mapping(world) or _add_mapping(world)
    node.inputs["Rotation"].default_value[2] = angle


def _add_mapping(world: bpy.types.World) -> Any:
    tree, pictures = world.node_tree, _pictures(world)
    # one picture that has a mapping of its own whose rotation is free was found already
    node = tree.nodes.new("ShaderNodeMapping")
    node.name = node.label = TURN
    first = pictures[0]
    node.location = (first.location.x - 220, first.location.y)
    links = first.inputs["Vector"].links
    if links:
        source = links[0].from_socket
    else:
        place = tree.nodes.new("ShaderNodeTexCoord")
        place.name = place.label = PLACE
        place.location = (node.location.x - 220, node.location.y)
        source = place.outputs["Generated"]
    tree.links.new(source, node.inputs["Vector"])
    for picture in pictures:
        tree.links.new(node.outputs[0], picture.inputs["Vector"])
    return node


def _strength_socket(world: bpy.types.World) -> Any:
    """The socket that says how bright all of a world is; None where there is no such one."""
    tree = _top(world)
    if tree is None:
        return None
    if STRENGTH in tree.nodes:
        return tree.nodes[STRENGTH].outputs[0]
    found = backgrounds(world)
    if len(found) == 1 and not found[0].inputs["Strength"].is_linked:
        return found[0].inputs["Strength"]
    return None


def strength(world: bpy.types.World) -> float:
    socket = _strength_socket(world)
    return socket.default_value if socket else 1.0


def set_strength(world: bpy.types.World, value: float) -> None:
    """Set how bright a world is; of one with many backgrounds, or a strength that is worked out, a
    factor on all of them."""
    if not world.library:
        world_of_nodes(world)
    if world.library or not backgrounds(world):
        return
    socket = _strength_socket(world)
    if socket is None:
        socket = _add_strength(world)
    socket.default_value = max(value, 0.0)


def _add_strength(world: bpy.types.World) -> Any:
    tree = world.node_tree
    dial = tree.nodes.new("ShaderNodeValue")
    dial.name = dial.label = STRENGTH
    dial.outputs[0].default_value = 1.0
    for background in backgrounds(world):
        into = background.inputs["Strength"]
        times = tree.nodes.new("ShaderNodeMath")
        times.operation, times.label = "MULTIPLY", STRENGTH
        times.location = (background.location.x - 180, background.location.y - 160)
        dial.location = (times.location.x - 180, times.location.y - 60)
        if into.is_linked:
            tree.links.new(into.links[0].from_socket, times.inputs[0])
        else:
            times.inputs[0].default_value = into.default_value
        tree.links.new(dial.outputs[0], times.inputs[1])
        tree.links.new(times.outputs[0], into)
    return dial.outputs[0]


def tint(world: bpy.types.World) -> tuple[float, float, float]:
    tree = _top(world)
    node = tree.nodes.get(TINT) if tree else None
    return tuple(node.outputs[0].default_value[:3]) if node else (1.0, 1.0, 1.0)


def set_tint(world: bpy.types.World, colour: Any) -> None:
    """Set the colour that a world's light is multiplied by."""
    if not world.library:
        world_of_nodes(world)
    if world.library or not backgrounds(world):
        return
    tree = world.node_tree
    node = tree.nodes.get(TINT) or _add_tint(world)
    node.outputs[0].default_value = (*colour[:3], 1.0)


def _add_tint(world: bpy.types.World) -> Any:
    tree = world.node_tree
    dial = tree.nodes.new("ShaderNodeRGB")
    dial.name = dial.label = TINT
    dial.outputs[0].default_value = (1.0, 1.0, 1.0, 1.0)
    for background in backgrounds(world):
        into = background.inputs["Color"]
        times = tree.nodes.new("ShaderNodeMix")
        times.data_type, times.blend_type, times.label = "RGBA", "MULTIPLY", TINT
        times.location = (background.location.x - 180, background.location.y + 120)
        dial.location = (times.location.x - 180, times.location.y + 60)
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
    """The HDRI of a world's own tree, if it has one."""
    return next((n.image for n in texture_nodes(world) if n.image), None)


def texture_nodes(world: bpy.types.World) -> list[Any]:
    """The nodes of a world's own tree that show an HDRI."""
    tree = _top(world)
    kind = "ShaderNodeTexEnvironment"
    return [n for n in tree.nodes if n.bl_idname == kind] if tree else []


def set_hdri(world: bpy.types.World, image: bpy.types.Image) -> None:
    """Light a world with an HDRI: in the node that shows one, else in a new one, linked to its
    background."""
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
