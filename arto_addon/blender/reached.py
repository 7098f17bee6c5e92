"""The nodes of a world or a material that a render asks: those that lead to its output.

What is muted, not linked, or mixed in by a factor of 0 shows nothing, so nothing is asked of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy

from .nodes import shader_tree

# A socket and the group nodes around its tree, the outermost first: a group may be used twice.
_Place = tuple[bpy.types.NodeSocket, tuple[bpy.types.Node, ...]]
_GROUP = "ShaderNodeGroup"


def reached(block: bpy.types.ID) -> list[bpy.types.Node]:
    """The nodes that lead to the output of a world or a material in Cycles, groups included."""
    tree = shader_tree(block)
    out = tree.get_output_node("CYCLES") if tree else None
    return reached_from(out.inputs) if out else []


def reached_from(sockets: Any) -> list[bpy.types.Node]:
    """The nodes that lead to some sockets of a tree that is in no group, groups included."""
    found: dict[int, bpy.types.Node] = {}
    seen: set[tuple[int, tuple[int, ...]]] = set()
    todo: list[_Place] = [(socket, ()) for socket in sockets]
    while todo:
        socket, around = todo.pop()
        key = socket.as_pointer(), tuple(node.as_pointer() for node in around)
        if key in seen:
            continue
        seen.add(key)
        for source, outside in _sources(socket, around):
            node = source.node
            if not node.mute and node.bl_idname not in {_GROUP, "NodeGroupInput"}:
                found[node.as_pointer()] = node
            todo += _asked(source, outside)
    return list(found.values())


def gives(node: bpy.types.Node) -> list[str]:
    """The names of a node's outputs that are linked."""
    return [socket.name for socket in node.outputs if socket.is_linked]


def _sources(
    socket: bpy.types.NodeSocket, around: tuple[bpy.types.Node, ...]
) -> Iterator[tuple[bpy.types.NodeSocket, tuple[bpy.types.Node, ...]]]:
    """The outputs that a socket gets its value from; none where the value is its own."""
    for link in socket.links:
        if not link.is_muted and link.is_valid:
            yield link.from_socket, around


def _asked(source: bpy.types.NodeSocket, around: tuple[bpy.types.Node, ...]) -> list[_Place]:
    """The sockets that an output depends on."""
    node = source.node
    if node.mute:
        return [(i.from_socket, around) for i in node.internal_links if i.to_socket == source]
    if node.bl_idname == "NodeGroupInput":
        outer = around[-1] if around else None
        return [
            (socket, around[:-1])
            for socket in (outer.inputs if outer else ())
            if socket.identifier == source.identifier
        ]
    if node.bl_idname == _GROUP:
        # A group that contains itself cannot be made in Blender, so this comes to an end.
        return [
            (socket, (*around, node))
            for out in (node.node_tree.nodes if node.node_tree else ())
            if out.bl_idname == "NodeGroupOutput" and out.is_active_output
            for socket in out.inputs
            if socket.identifier == source.identifier
        ]
    sockets = [*node.inputs]
    pair = getattr(node, "paired_output_node", None)
    if pair is None:  # The end of a zone asks what its beginning is given.
        begins = [n for n in node.id_data.nodes if getattr(n, "paired_output_node", None) == node]
        sockets += [socket for begin in begins for socket in begin.inputs]
    return [(socket, around) for socket in _weighed(node, sockets, around)]


def _weighed(
    node: bpy.types.Node, sockets: list[bpy.types.NodeSocket], around: tuple[bpy.types.Node, ...]
) -> list[bpy.types.NodeSocket]:
    """The inputs of a node that count: not those that its factor of 0 or 1 leaves out."""
    sockets = [socket for socket in sockets if socket.enabled]
    kind = node.bl_idname
    if kind in {"ShaderNodeBackground", "ShaderNodeEmission"}:
        strength = node.inputs["Strength"]
        return [strength] if value_of(strength, around) == 0 else sockets
    mixes = kind == "ShaderNodeMixShader" or (
        getattr(node, "blend_type", "MIX") == "MIX"
        and kind in {"ShaderNodeMix", "ShaderNodeMixRGB"}
        and getattr(node, "factor_mode", "UNIFORM") == "UNIFORM"
    )
    if not mixes or len(sockets) != 3:
        return sockets
    factor = value_of(sockets[0], around)
    clamped = kind == "ShaderNodeMixShader" or getattr(node, "clamp_factor", True)
    if factor is None or not (factor in {0.0, 1.0} or clamped):
        return sockets
    if factor <= 0:
        return [sockets[0], sockets[1]]
    return [sockets[0], sockets[2]] if factor >= 1 else sockets


def value_of(socket: bpy.types.NodeSocket, around: tuple[bpy.types.Node, ...] = ()) -> float | None:
    """The number that a socket has wherever it is asked; None where nodes work it out."""
    for source, outside in _sources(socket, around):
        node = source.node
        if node.bl_idname == "ShaderNodeValue" and not node.mute:
            return float(source.default_value)
        if node.bl_idname in {"NodeReroute", "NodeGroupInput", _GROUP}:
            asked = _asked(source, outside)
            return value_of(*asked[0]) if len(asked) == 1 else None
        return None
    value = getattr(socket, "default_value", None)
    return float(value) if isinstance(value, int | float) else None
