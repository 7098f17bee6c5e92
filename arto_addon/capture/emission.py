"""What the planes of the patches emit: the materials of patterns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import bpy

from ...core.capture.names import GRAIN
from ...core.patterns import ALL, BASE, PatternSet
from ..blender.nodes import Input, Nodes, made_of_nodes, new_material
from .shells import LID, PATTERN

# Grains along a patch's side: far finer than the part of a patch that a pixel reflects.
GRAINS = 2.0**14


def _polynomial(nodes: Nodes, coefficients: Iterable[float]) -> bpy.types.NodeSocket:
    """The value of a polynomial over `patterns.MONOMIALS` of the UV map."""
    split = nodes.add("ShaderNodeSeparateXYZ", nodes.add("ShaderNodeUVMap").outputs[0])
    u, v = split.outputs[0], split.outputs[1]
    terms = (
        1.0,
        u,
        nodes.math("MULTIPLY", u, u),
        v,
        nodes.math("MULTIPLY", v, v),
        nodes.math("MULTIPLY", u, v),
    )
    total: Input = 0.0
    for coefficient, term in zip(coefficients, terms, strict=True):
        if coefficient:
            total = nodes.math("MULTIPLY_ADD", term, float(coefficient), total)
    # at a patch's rim rounding may put u or v below 0, and light must not be negative
    return nodes.math("MAXIMUM", total, 0.0)


def _grain(nodes: Nodes) -> bpy.types.NodeSocket:
    """A random value for each grain: 1 on half of the grains, 0 on the others."""
    scaled = nodes.add(
        "ShaderNodeVectorMath",
        nodes.add("ShaderNodeUVMap").outputs[0],
        (GRAINS,) * 3,
        operation="MULTIPLY",
    )
    cell = nodes.add("ShaderNodeVectorMath", scaled.outputs[0], operation="FLOOR")
    noise = nodes.tree.nodes.new("ShaderNodeTexWhiteNoise")
    noise.noise_dimensions = "3D"
    nodes.tree.links.new(cell.outputs[0], noise.inputs["Vector"])
    return nodes.math("GREATER_THAN", noise.outputs["Value"], 0.5)


def _radiance(nodes: Nodes, name: str, patterns: PatternSet) -> list[Input]:
    """What a pattern of the set, or `GRAIN`, emits: sockets or values, one for all channels or one
    for each."""
    if name == GRAIN:
        return [_grain(nodes)]
    return [
        _grain(nodes) if row is None else _polynomial(nodes, row) for row in patterns.emission(name)
    ]


def _lasting(nodes: Nodes, most: int | None) -> Input:
    """1 for a path that has passed at most so many transparent surfaces, else 0.

    The artist's render ends a path that passes more. A capture lets it go on, as the patterns
    before a plane are transparent too: so it is to find no light. most: None for no limit.
    """
    if most is None:
        return 1.0
    passed = nodes.tree.nodes.new("ShaderNodeLightPath").outputs["Transparent Depth"]
    return nodes.math("LESS_THAN", passed, most + 0.5)


def _shader(
    nodes: Nodes,
    shown: list[Input],
    radiance: float,
    hidden: Input = 0.0,
    lasting: Input = 1.0,
) -> bpy.types.NodeSocket:
    """Emission, plus what lies behind; shown: see `_radiance`; radiance: what 1 of it is.

    hidden: 1 where nothing lies behind; lasting: see `_lasting`.

    The background lies behind the last pattern. There Cycles adds the scene's sun lamps to
    scattered rays. An opaque patch would hide the suns' mirror images.
    """
    if len(shown) == 1:
        colour: Input = (radiance, radiance, radiance, 1)
        strength = _times(nodes, shown[0], lasting)
        light = nodes.add("ShaderNodeEmission", colour, strength).outputs[0]
    else:
        colour = nodes.add("ShaderNodeCombineColor", *shown).outputs[0]
        strength = _times(nodes, radiance, lasting)
        light = nodes.add("ShaderNodeEmission", colour, strength).outputs[0]
    behind = nodes.add("ShaderNodeBsdfTransparent")
    if hidden:
        nodes.tree.links.new(nodes.math("SUBTRACT", 1.0, hidden), behind.inputs[0])
    return nodes.add("ShaderNodeAddShader", light, behind.outputs[0]).outputs[0]


def _times(nodes: Nodes, value: Input, factor: Input) -> Input:
    return value if factor == 1.0 else nodes.math("MULTIPLY", factor, value)


def pattern_material(
    name: str,
    patterns: PatternSet,
    sampled: bool = False,
    radiance: float = 1.0,
    most: int | None = None,
) -> bpy.types.Material:
    """Emission of a pattern of the set (or of `GRAIN`), plus what lies behind. most: see
    `_lasting`."""
    material = new_material(f"ARTO {name}")
    # paths find the patches, and no shadow ray is cast at them: Cycles' limit of 255 light groups
    # for sampled lights does not apply
    material.cycles.emission_sampling = "FRONT_BACK" if sampled else "NONE"
    tree = material.node_tree
    tree.nodes.clear()
    nodes = Nodes(tree)
    nodes.add(
        "ShaderNodeOutputMaterial",
        _shader(
            nodes,
            _radiance(nodes, name, patterns),
            radiance,
            lasting=_lasting(nodes, most),
        ),
    )
    return material


def overriding_material(
    override: bpy.types.Material,
    names: list[str],
    patterns: PatternSet,
    sampled: bool = False,
    radiance: float = 1.0,
    most: Mapping[str, int] | None = None,
) -> bpy.types.Material:
    """A view layer's material override, on the artist's objects; on a plane, its pattern.

    Blender puts the override on every object, whatever the object's slots hold. So one material
    must serve all, and look at the object: a plane has the number of its pattern, from 1, as
    property `PATTERN`. most: for each pattern, see `_lasting`.
    """
    material = override.copy()
    material.cycles.emission_sampling = (
        "FRONT_BACK" if sampled else "NONE"
    )  # as in `pattern_material`
    tree = made_of_nodes(material)
    nodes = Nodes(tree)
    number = tree.nodes.new("ShaderNodeAttribute")
    number.attribute_type, number.attribute_name = "OBJECT", PATTERN
    shown = [_radiance(nodes, name, patterns) for name in names]
    total: list[Input] = [0.0] * max(map(len, shown))
    for i, channels in enumerate(shown, 1):
        mine = nodes.math("COMPARE", number.outputs["Fac"], float(i), 0.5)
        mine = _times(nodes, mine, _lasting(nodes, (most or {}).get(names[i - 1])))
        for c in range(len(total)):
            value = channels[c if len(channels) > 1 else 0]
            total[c] = nodes.math("MULTIPLY_ADD", mine, value, total[c])
    plane = nodes.math("GREATER_THAN", number.outputs["Fac"], 0.5)
    hidden = nodes.math("COMPARE", number.outputs["Fac"], LID, 0.5)
    output = tree.get_output_node("CYCLES") or tree.nodes.new("ShaderNodeOutputMaterial")
    surface = _shader(nodes, total, radiance, hidden)
    for socket, pattern in (("Surface", surface), ("Volume", None)):
        links = output.inputs[socket].links
        if not links and pattern is None:
            continue
        mix = tree.nodes.new("ShaderNodeMixShader")
        tree.links.new(plane, mix.inputs[0])
        if links:
            tree.links.new(links[0].from_socket, mix.inputs[1])
        if pattern:
            tree.links.new(pattern, mix.inputs[2])
        tree.links.new(mix.outputs[0], output.inputs[socket])
    if links := output.inputs["Displacement"].links:
        others = nodes.math("SUBTRACT", 1.0, plane)
        scaled = nodes.add("ShaderNodeVectorMath", links[0].from_socket, operation="SCALE")
        tree.links.new(others, scaled.inputs["Scale"])
        tree.links.new(scaled.outputs[0], output.inputs["Displacement"])
    return material


def most_passed(patterns: PatternSet, names: list[str], through: int) -> dict[str, int]:
    """How many transparent surfaces a path may pass before it meets each pattern.

    These are the scene's own, the threshold, and the patterns in front that the path sees. names:
    the patterns in their order behind each other; through: how many of the scene's own the artist's
    render lets a path pass.
    """
    paths = {name: "" if name == GRAIN else patterns.paths(name) for name in names}
    first = int(len(patterns) > 1)
    found = {}
    for i, name in enumerate(names):
        mine = paths[name] or BASE
        seen = [n for n in names[:i] if ALL in (mine, paths[n]) or paths[n] in (mine, "")]
        found[name] = through + first + len(seen)
    return found
