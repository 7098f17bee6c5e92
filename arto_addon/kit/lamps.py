"""The shape of a kit's light as the nodes of an area lamp."""

from __future__ import annotations

import bpy

from ...core.kit.light import Blend, Light
from ..blender.nodes import Nodes, shader_tree
from . import groups
from .kit import set_light


def shade(lamp: bpy.types.Light, light: Light) -> None:
    """Give an area lamp the edges, gradients and the form of a light, by the light's own nodes.

    The lamp keeps its power, which is that of its brightest place over all of its area.
    """
    if shader_tree(lamp) is None:
        lamp.use_nodes = True
    tree = lamp.node_tree
    assert tree is not None
    tree.nodes.clear()
    nodes = Nodes(tree)
    # Across a lamp the parametric coordinates run from 0 to 1.
    place = tree.nodes.new("ShaderNodeNewGeometry").outputs["Parametric"]
    u, v, _ = nodes.add("ShaderNodeSeparateXYZ", place).outputs
    half_x, half_y = light.sides
    # The direction in which a light along +X shows the same place.
    left = nodes.math("MULTIPLY_ADD", u, 2 * half_x, -half_x)
    up = nodes.math("MULTIPLY_ADD", v, 2 * half_y, -half_y)
    around = nodes.add("ShaderNodeCombineXYZ", 1.0, left, up).outputs[0]
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = groups.light_group(light.kind, Blend.ADD)
    plain = Light(
        light.name, light.kind, width=light.width, height=light.height, softness=light.softness,
        gradient=light.gradient, slope=light.slope, hole=light.hole,
    )  # fmt: skip
    set_light(node, plain)
    tree.links.new(around, node.inputs["Direction"])
    emission = nodes.add("ShaderNodeEmission", node.outputs[0], 1.0)
    nodes.add("ShaderNodeOutputLight", emission.outputs[0])
