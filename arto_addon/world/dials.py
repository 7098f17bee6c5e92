"""The dials of a world, its strength and its turn about the vertical, apart from what it shows.

Where one background node and one mapping node stand for all of it, a map need be made only once for
every strength and turn.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy

from ..blender.nodes import shader_tree
from .detail import values_only


@contextmanager
def without_dials(world: bpy.types.World) -> Iterator[tuple[Any, float, float]]:
    """A copy of the world as it is now without its strength and turn, and those two."""
    plain = world.copy()
    try:
        for block in (plain, plain.node_tree):
            if block:
                block.animation_data_clear()
        background, mapping = dials(plain)
        strength, turn = 1.0, 0.0
        if background:
            strength = background.inputs["Strength"].default_value
            background.inputs["Strength"].default_value = 1.0
        if mapping:
            turn = mapping.inputs["Rotation"].default_value[2] % (2 * math.pi)
            mapping.inputs["Rotation"].default_value[2] = 0.0
        yield plain, strength, turn
    finally:
        bpy.data.worlds.remove(plain)


def dials(world: bpy.types.World) -> tuple[Any, Any]:
    """The background node whose strength is that of all the world, and the mapping node that turns
    it; None where there is no such one."""
    tree = shader_tree(world)
    out = tree.get_output_node("CYCLES") if tree else None
    links = out.inputs["Surface"].links if out else ()
    if not links or links[0].is_muted:
        return None, None
    background = links[0].from_node
    if background.bl_idname != "ShaderNodeBackground" or background.mute:
        return None, None
    dial = None if background.inputs["Strength"].is_linked else background
    nodes = [n for n in tree.nodes if not n.mute]
    textures = [n for n in nodes if n.bl_idname == "ShaderNodeTexEnvironment"]
    mappings = [n for n in nodes if n.bl_idname == "ShaderNodeMapping"]
    if len(textures) != 1 or len(mappings) != 1 or len(nodes) != len(tree.nodes):
        return dial, None
    texture, mapping = textures[0], mappings[0]
    into, source = texture.inputs["Vector"].links, mapping.inputs["Vector"].links
    straight = (
        into
        and into[0].from_node == mapping
        and source
        and source[0].from_node.bl_idname == "ShaderNodeTexCoord"
        and source[0].from_socket.name == "Generated"
        and len(mapping.outputs[0].links) == 1
    )
    # nothing else may know of a direction
    if not straight or not values_only(background, {texture}):
        return dial, None
    if mapping.vector_type != "POINT" or any(
        mapping.inputs[n].is_linked for n in ("Location", "Rotation", "Scale")
    ):
        return dial, None
    scale, place = mapping.inputs["Scale"].default_value, mapping.inputs["Location"].default_value
    rotation = mapping.inputs["Rotation"].default_value
    # what is not scaled alike along x and y is another world when it is turned
    turns = scale[0] == scale[1] and not any(place) and not any(rotation[:2])
    return dial, mapping if turns else None


def read(world: bpy.types.World) -> tuple[float, float, list[Any]]:
    """A world's strength and turn as they are now, and the sockets that say so."""
    background, mapping = dials(world)
    sockets = []
    strength, turn = 1.0, 0.0
    if background:
        sockets.append(background.inputs["Strength"])
        strength = sockets[-1].default_value
    if mapping:
        sockets.append(mapping.inputs["Rotation"])
        turn = sockets[-1].default_value[2] % (2 * math.pi)
    return strength, turn, sockets
