"""Node trees, built so that the code reads like the formula."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy


class Nodes:
    """A few calls that make building a node tree read like the formula it is."""

    def __init__(self, tree: Any) -> None:
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


def trees(tree: Any, seen: set[int]) -> Iterator[Any]:
    """A node tree and the groups in it, each once."""
    if tree is None or tree.as_pointer() in seen:
        return
    seen.add(tree.as_pointer())
    yield tree
    for node in tree.nodes:
        if node.bl_idname == "ShaderNodeGroup":
            yield from trees(node.node_tree, seen)
