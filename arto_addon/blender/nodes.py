"""Node trees, built so that the code reads like the formula."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy

from .version import FIVE


class Nodes:
    """A few calls that make building a node tree read like the formula it is."""

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self.tree = tree

    def add(self, kind: str, *inputs: Any, operation: str = "") -> Any:
        """A node with its inputs linked (sockets) or set (values)."""
        node = self.tree.nodes.new(kind)
        if operation:
            node.operation = operation
        for socket, value in zip(node.inputs, inputs, strict=False):
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, socket)
            else:
                socket.default_value = value
        return node

    def math(self, operation: str, *inputs: Any) -> Any:
        return self.add("ShaderNodeMath", *inputs, operation=operation).outputs[0]


def new_material(name: str) -> bpy.types.Material:
    """A material with the nodes that Blender gives it."""
    return _noded(bpy.data.materials.new(name))


def new_world(name: str) -> bpy.types.World:
    """A world with the nodes that Blender gives it."""
    return _noded(bpy.data.worlds.new(name))


def _noded(block: Any) -> Any:
    if not FIVE:
        block.use_nodes = True
    return block


def shader_tree(block: bpy.types.ID) -> bpy.types.NodeTree | None:
    """The tree that a material, world or lamp is rendered by; None where it has none in use."""
    return block.node_tree if FIVE or block.use_nodes else None


def made_of_nodes(material: bpy.types.Material) -> bpy.types.NodeTree:
    """The tree that a material of our own is rendered by. One that does without nodes, as it can
    before Blender 5, gets those that look the same."""
    if shader_tree(material) is None:
        material.use_nodes = True
        tree = material.node_tree
        tree.nodes.clear()
        shader = Nodes(tree).add("ShaderNodeBsdfDiffuse", material.diffuse_color)
        Nodes(tree).add("ShaderNodeOutputMaterial", shader.outputs[0])
    return material.node_tree


def world_of_nodes(world: bpy.types.World) -> bpy.types.NodeTree:
    """The tree of a world, which is given one where it does without, as it can before Blender 5:
    one that shows its colour, as the world did."""
    if shader_tree(world) is None:
        world.use_nodes = True
        tree = world.node_tree
        tree.nodes.clear()
        nodes = Nodes(tree)
        light = nodes.add("ShaderNodeBackground", (*world.color, 1.0), 1.0)
        nodes.add("ShaderNodeOutputWorld", light.outputs[0])
    return world.node_tree


def trees(tree: bpy.types.NodeTree | None, seen: set[int]) -> Iterator[bpy.types.NodeTree]:
    """A node tree and the groups in it, each once."""
    if tree is None or tree.as_pointer() in seen:
        return
    seen.add(tree.as_pointer())
    yield tree
    for node in tree.nodes:
        if node.bl_idname == "ShaderNodeGroup":
            yield from trees(node.node_tree, seen)
