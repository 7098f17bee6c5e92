"""Node trees, built so that the code reads like the formula."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TypeVar

import bpy

from .version import FIVE

# What goes into a node: a socket to link, or the value of the node's own socket.
Input = bpy.types.NodeSocket | float | Sequence[float]
_Block = TypeVar("_Block", bound=bpy.types.ID)


class Nodes:
    """Calls by which the code that builds a node tree reads like the formula."""

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self.tree = tree

    def add(self, kind: str, *inputs: Input, operation: str = "") -> bpy.types.Node:
        """Add a node. Each input that is a socket is linked, and any other is set as a value."""
        node = self.tree.nodes.new(kind)
        if operation:
            node.operation = operation
        for socket, value in zip(node.inputs, inputs, strict=False):
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, socket)
            else:
                socket.default_value = value
        return node

    def math(self, operation: str, *inputs: Input) -> bpy.types.NodeSocket:
        """Add a Math node, and return its output socket."""
        return self.add("ShaderNodeMath", *inputs, operation=operation).outputs[0]


def new_material(name: str) -> bpy.types.Material:
    """Make a material with Blender's default nodes."""
    return _noded(bpy.data.materials.new(name))


def new_world(name: str) -> bpy.types.World:
    """Make a world with Blender's default nodes."""
    return _noded(bpy.data.worlds.new(name))


def _noded(block: _Block) -> _Block:
    if not FIVE:
        block.use_nodes = True
    return block


def dark_world(world: bpy.types.World | None, name: str) -> bpy.types.World:
    """Make a world without light that has the properties of another, as materials may read them.

    Attribute nodes and drivers find a scene's world by the scene, whatever shader it has.
    """
    if world is None:
        dark = new_world(name)
    else:
        dark = _noded(world.copy())
        dark.name, dark.lightgroup = name, ""
        dark.node_tree.animation_data_clear()
        for rays in dark.cycles_visibility.bl_rna.properties:
            if rays.type == "BOOLEAN" and not rays.is_readonly:
                setattr(dark.cycles_visibility, rays.identifier, True)
    dark.node_tree.nodes.clear()
    return dark


def shader_tree(block: bpy.types.ID) -> bpy.types.NodeTree | None:
    """The node tree by which a material, world or lamp is rendered; None where none is in use."""
    return block.node_tree if FIVE or block.use_nodes else None


def made_of_nodes(material: bpy.types.Material) -> bpy.types.NodeTree:
    """The node tree by which a material of ARTO's own is rendered.

    Before Blender 5 a material can do without nodes. Such a material gets nodes that look the same.
    """
    if shader_tree(material) is None:
        material.use_nodes = True
        tree = material.node_tree
        tree.nodes.clear()
        shader = Nodes(tree).add("ShaderNodeBsdfDiffuse", material.diffuse_color)
        Nodes(tree).add("ShaderNodeOutputMaterial", shader.outputs[0])
    return material.node_tree


def world_of_nodes(world: bpy.types.World) -> bpy.types.NodeTree:
    """The node tree of a world.

    Before Blender 5 a world can do without nodes. Such a world gets nodes that show its colour, as
    the world did before.
    """
    if shader_tree(world) is None:
        world.use_nodes = True
        tree = world.node_tree
        tree.nodes.clear()
        nodes = Nodes(tree)
        light = nodes.add("ShaderNodeBackground", (*world.color, 1.0), 1.0)
        nodes.add("ShaderNodeOutputWorld", light.outputs[0])
    return world.node_tree


def trees(tree: bpy.types.NodeTree | None, seen: set[int]) -> Iterator[bpy.types.NodeTree]:
    """Yield a node tree and the trees of all groups in it, each once."""
    if tree is None or tree.as_pointer() in seen:
        return
    seen.add(tree.as_pointer())
    yield tree
    for node in tree.nodes:
        if node.bl_idname == "ShaderNodeGroup":
            yield from trees(node.node_tree, seen)
