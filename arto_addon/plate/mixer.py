"""The mixer: a compositor node group that adds up a plate's layers, each with a gain and a tint.

The group is made once and then kept, so all that the artist sets or changes in the group stays. The
group works without ARTO, and needs only the file of the layers.
"""

from __future__ import annotations

from pathlib import Path

import bpy

from ...core import exr
from ..blender.compositing import choose, mixed, places_of_groups
from .plate import add_footage, show

EXPOSURE_SOCKET = "Exposure"
SOURCE, ALPHA, EXPOSURE = "ARTO Layers", "ARTO Alpha", "ARTO Exposure"
_BLACK, _WHITE = (0.0, 0.0, 0.0, 1.0), (1.0, 1.0, 1.0, 1.0)


def mixer(path: Path, name: str, share: bpy.types.Image | None = None) -> bpy.types.NodeTree:
    """Make or update the node group of a name for the layers in a file.

    share: see `plate.node_group`.
    """
    image = show(path, name)
    tree = bpy.data.node_groups.get(name)
    if tree is None or tree.bl_idname != "CompositorNodeTree":
        tree = _new(name)
    source = tree.nodes.get(SOURCE)
    if source is None:
        return tree  # The artist has rebuilt the group, so it is left alone.
    source.image = image
    there = {socket.name for socket in tree.interface.items_tree if socket.in_out == "INPUT"}
    for layer in (n for n in exr.part_names(path) if n):
        if layer not in there and EXPOSURE in tree.nodes:
            _add(tree, source, layer)
    if share:
        add_footage(tree, tree.nodes[ALPHA].outputs[0], share)
    return tree


def _new(name: str) -> bpy.types.NodeTree:
    tree = bpy.data.node_groups.new(name, "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    tree.interface.new_socket("Alpha", in_out="OUTPUT", socket_type="NodeSocketFloat")
    tree.interface.new_socket(EXPOSURE_SOCKET, in_out="INPUT", socket_type="NodeSocketFloat")
    source = tree.nodes.new("CompositorNodeImage")
    source.name, source.location = SOURCE, (-400, 0)
    entry, out = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    entry.location, out.location = (-400, -500), (1000, 0)
    exposure = tree.nodes.new("CompositorNodeExposure")
    exposure.name, exposure.location = EXPOSURE, (600, 0)
    exposure.inputs["Image"].default_value = _BLACK
    alpha = tree.nodes.new("CompositorNodeSetAlpha")
    alpha.name, alpha.location = ALPHA, (800, 0)
    choose(alpha, "Type", "Replace Alpha")
    link = tree.links.new
    link(entry.outputs[EXPOSURE_SOCKET], exposure.inputs["Exposure"])
    link(exposure.outputs[0], alpha.inputs["Image"])
    link(alpha.outputs[0], out.inputs["Image"])
    return tree


def _add(tree: bpy.types.NodeTree, source: bpy.types.Node, layer: str) -> None:
    """Add a layer to the sum, with two sockets: a gain with the layer's name, and a tint."""
    gain = tree.interface.new_socket(layer, in_out="INPUT", socket_type="NodeSocketFloat")
    gain.default_value, gain.min_value = 1.0, 0.0
    gain.description = "How much of this layer's light is seen"
    tint = tree.interface.new_socket(f"{layer} Tint", in_out="INPUT", socket_type="NodeSocketColor")
    tint.default_value = _WHITE
    # In nodes that use the group already, new sockets do not get their default value.
    for other in places_of_groups():
        for node in other.nodes:
            if getattr(node, "node_tree", None) == tree:
                node.inputs[layer].default_value = 1.0
                node.inputs[f"{layer} Tint"].default_value = _WHITE
    entry = next(n for n in tree.nodes if n.bl_idname == "NodeGroupInput")
    light = mixed(tree, "MULTIPLY", source.outputs[layer], entry.outputs[f"{layer} Tint"])
    light = mixed(tree, "MULTIPLY", light, entry.outputs[layer])
    into = tree.nodes[EXPOSURE].inputs["Image"]
    if into.is_linked:
        light = mixed(tree, "ADD", into.links[0].from_socket, light)
    else:
        alpha = source.outputs["Alpha"]
        tree.links.new(alpha, tree.nodes[ALPHA].inputs["Alpha"])
        out = next(n for n in tree.nodes if n.bl_idname == "NodeGroupOutput")
        tree.links.new(alpha, out.inputs["Alpha"])
    tree.links.new(light, into)
