"""The nodes of a world or a material that a render asks: those that lead to its output.

What is muted, not linked, or mixed in by a factor of 0 shows nothing, so nothing is asked of it.
"""

from __future__ import annotations

from collections.abc import Iterator

import bpy

from .nodes import shader_tree

# The group nodes around a tree, the outermost first: a group may be used twice.
Around = tuple[bpy.types.Node, ...]
_Place = tuple[bpy.types.NodeSocket, Around]
_GROUP = "ShaderNodeGroup"


def reached(block: bpy.types.ID) -> list[bpy.types.Node]:
    """The nodes that lead to the output of a world or a material in Cycles, groups included."""
    return list({node.as_pointer(): node for node, _ in reached_places(block)}.values())


def reached_places(block: bpy.types.ID) -> list[tuple[bpy.types.Node, Around]]:
    """`reached`, each node with the group nodes around it, and once for each way of groups."""
    tree = shader_tree(block)
    out = tree.get_output_node("CYCLES") if tree else None
    return above(out, ()) if out else []


def above(
    node: bpy.types.Node, around: Around, ends: frozenset[str] = frozenset()
) -> list[tuple[bpy.types.Node, Around]]:
    """The nodes that lead to a node, each with the group nodes around it.

    around: the group nodes around the node; ends: kinds of nodes at which the search stops.
    """
    found: dict[tuple[int, ...], tuple[bpy.types.Node, Around]] = {}
    seen: set[tuple[int, ...]] = set()
    todo: list[_Place] = _weighed(node, [*node.inputs], around)
    while todo:
        socket, outside = todo.pop()
        key = socket.as_pointer(), *(n.as_pointer() for n in outside)
        if key in seen:
            continue
        seen.add(key)
        for source, inside in _sources(socket, outside):
            one = source.node
            if one.mute or one.bl_idname in {_GROUP, "NodeGroupInput"}:
                todo += _asked(source, inside)
                continue
            found[one.as_pointer(), *(n.as_pointer() for n in inside)] = one, inside
            if one.bl_idname not in ends:
                todo += _asked(source, inside)
    return list(found.values())


def gives(node: bpy.types.Node) -> list[str]:
    """The names of a node's outputs that are linked."""
    return [socket.name for socket in node.outputs if socket.is_linked]


def _sources(socket: bpy.types.NodeSocket, around: Around) -> Iterator[_Place]:
    """The outputs that a socket gets its value from; none where the value is its own."""
    # Blender looks at all links of a tree to list those of a socket.
    for link in socket.links if socket.is_linked else ():
        if not link.is_muted and link.is_valid:
            yield link.from_socket, around


def _asked(source: bpy.types.NodeSocket, around: Around) -> list[_Place]:
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
    if node.bl_idname.endswith("Output"):  # The end of a zone asks what its beginning is given.
        begins = [n for n in node.id_data.nodes if getattr(n, "paired_output_node", None) == node]
        sockets += [socket for begin in begins for socket in begin.inputs]
    return _weighed(node, sockets, around)


def _weighed(
    node: bpy.types.Node, sockets: list[bpy.types.NodeSocket], around: Around
) -> list[_Place]:
    """The inputs of a node that count: not those that its factor of 0 or 1 leaves out."""
    counted = [(socket, around) for socket in sockets if socket.enabled]
    kind = node.bl_idname
    if kind in {"ShaderNodeBackground", "ShaderNodeEmission"}:
        strength = node.inputs["Strength"]
        return [(strength, around)] if value_of(strength, around) == 0 else counted
    mixes = kind == "ShaderNodeMixShader" or (
        getattr(node, "blend_type", "MIX") == "MIX"
        and kind in {"ShaderNodeMix", "ShaderNodeMixRGB"}
        and getattr(node, "factor_mode", "UNIFORM") == "UNIFORM"
    )
    if not mixes or len(counted) != 3:
        return counted
    factor = value_of(*counted[0])
    clamped = kind == "ShaderNodeMixShader" or getattr(node, "clamp_factor", True)
    if factor is None or not (factor in {0.0, 1.0} or clamped):
        return counted
    if factor <= 0:
        return counted[:2]
    return [counted[0], counted[2]] if factor >= 1 else counted


def origin(
    socket: bpy.types.NodeSocket, around: Around = ()
) -> tuple[bpy.types.NodeSocket | None, Around]:
    """Where a socket's value comes from, through groups, reroutes and muted nodes.

    -> (the output of the node that makes the value, or the input that holds it; the group nodes
    around it). (None, ()) where nothing can be told. around: the group nodes around the socket.
    """
    while True:
        found = next(_sources(socket, around), None)
        if found is None:
            return socket, around
        source, around = found
        node = source.node
        if not (node.mute or node.bl_idname in {"NodeReroute", "NodeGroupInput", _GROUP}):
            return source, around
        asked = _asked(source, around)
        if len(asked) != 1:
            return None, ()
        socket, around = asked[0]


def value_of(socket: bpy.types.NodeSocket, around: Around = ()) -> float | None:
    """The number that a socket has wherever it is asked; None where nodes work it out."""
    found, _ = origin(socket, around)
    if found is None or (found.is_output and found.node.bl_idname != "ShaderNodeValue"):
        return None
    value = getattr(found, "default_value", None)
    return float(value) if isinstance(value, int | float) else None
