"""How fine the detail of a world is, read from its nodes."""

from __future__ import annotations

import math

import bpy

from ...core.errors import KitError
from ...core.kit.light import Kind
from ...core.kit.model import BaseKind
from ..blender.reached import Around, above, gives, reached_places
from ..kit import base, groups, kit

# The width of a map in which a lamp of a tenth of a degree is about two texels wide. Nodes that may
# draw anything count as this fine, and no world counts as finer.
FINEST = 8192

# Nodes that hand on light or a direction, or turn a direction.
_STRUCTURE = {
    "NodeFrame",
    "NodeGroupInput",
    "NodeGroupOutput",
    "NodeReroute",
    "ShaderNodeAddShader",
    "ShaderNodeBackground",
    "ShaderNodeEmission",
    "ShaderNodeGroup",
    "ShaderNodeMapping",
    "ShaderNodeMixShader",
    "ShaderNodeOutputWorld",
    "ShaderNodeTexCoord",
    "ShaderNodeVectorRotate",
}
# Nodes that are a value or compute a value from values. Their output has no detail of its own, as
# long as no direction comes in.
_VALUES = {
    "NodeReroute",
    "ShaderNodeBlackbody",
    "ShaderNodeBrightContrast",
    "ShaderNodeClamp",
    "ShaderNodeCombineColor",
    "ShaderNodeCombineXYZ",
    "ShaderNodeFloatCurve",
    "ShaderNodeGamma",
    "ShaderNodeHueSaturation",
    "ShaderNodeInvert",
    "ShaderNodeLightPath",
    "ShaderNodeMapRange",
    "ShaderNodeMath",
    "ShaderNodeMix",
    "ShaderNodeMixRGB",
    "ShaderNodeRGB",
    "ShaderNodeRGBCurve",
    "ShaderNodeRGBToBW",
    "ShaderNodeSeparateColor",
    "ShaderNodeSeparateXYZ",
    "ShaderNodeValToRGB",
    "ShaderNodeValue",
    "ShaderNodeVectorMath",
    "ShaderNodeWavelength",
}
_TURNED = {"NodeReroute", "ShaderNodeMapping", "ShaderNodeTexCoord", "ShaderNodeVectorRotate"}


def _is_value(node: bpy.types.Node) -> bool:
    of_layer = node.bl_idname == "ShaderNodeAttribute" and node.attribute_type == "VIEW_LAYER"
    return of_layer or node.bl_idname in _VALUES


def values_only(node: bpy.types.Node, ends: set[bpy.types.Node]) -> bool:
    """Whether no node that leads to a node depends on a direction; the search stops at `ends`."""
    found: set[bpy.types.Node] = set()
    todo = [node]
    while todo:
        for socket in todo.pop().inputs:
            for link in socket.links:
                if link.from_node not in found | ends:
                    found.add(link.from_node)
                    todo.append(link.from_node)
    return all(_is_value(n) for n in found)


def _of_texture(node: bpy.types.Node, around: Around) -> int:
    """The width of a map that is as fine as an environment texture behind its mapping nodes."""
    before = [n for n, _ in above(node, around)]
    if node.projection != "EQUIRECTANGULAR":
        return FINEST
    if any(n.bl_idname not in _TURNED and not _is_value(n) for n in before):
        return FINEST
    stretch = 1.0
    for mapping in (n for n in before if n.bl_idname == "ShaderNodeMapping"):
        scale = [abs(x) for x in mapping.inputs["Scale"].default_value]
        moved = any(s.is_linked for s in mapping.inputs if s.name in {"Location", "Scale"}) or any(
            mapping.inputs["Location"].default_value if "Location" in mapping.inputs else ()
        )
        if moved or min(scale) == 0:
            return FINEST
        stretch *= max(scale) / min(scale)
    return math.ceil(node.image.size[0] * stretch) if node.image else 0


# The width of a map that holds a gradient.
_GRADIENT = 64


def _of_kit(world: bpy.types.World) -> int:
    """The width of a map that holds all detail of a light kit."""
    try:
        found = kit.read(world)
    except KitError:  # nodes work out a value
        return FINEST
    widest = _GRADIENT if found.base.kind is BaseKind.GRADIENT else 1
    if found.base.kind is BaseKind.HDRI:
        size = base.image_of(found.base.image).size[0] if found.base.image else 0
        # Every look-up of a blurred HDRI is another direction.
        widest = max(widest, FINEST if found.base.blur > 0 else size)
    for light in found.lit:
        # Two texels across, as for the sun of a sky.
        widest = max(widest, math.ceil(2 * 360 / light.smallest))
        if light.kind is Kind.PICTURE:
            node = groups.picture_node(kit.node_of(world, light.name).node_tree)
            side = node.image.size[0] if node.image else 0
            widest = max(widest, math.ceil(side * 360 / light.width))
    return widest


def detail(world: bpy.types.World) -> int:
    """The width of a map that holds all detail of a world, 1 to `FINEST`.

    A texture is as fine as its pixels, a sky as fine as its sun, and a light kit as fine as its
    smallest light. Any other node that depends on
    a direction may draw anything, so it counts as `FINEST`.
    """
    lights = kit.has(world)
    widest = _of_kit(world) if lights else 1
    if lights and kit.is_whole(world):
        return min(widest, FINEST)
    textures = frozenset({"ShaderNodeTexEnvironment", "ShaderNodeTexSky"})
    for node, around in reached_places(world):
        kind = node.bl_idname
        if (node.outputs and not gives(node)) or (lights and kit.owns(node, around)):
            continue
        if kind == "ShaderNodeTexEnvironment":
            widest = max(widest, _of_texture(node, around))
        elif kind == "ShaderNodeTexSky":
            # Two texels across the sun.
            sun = math.degrees(node.sun_size) if node.sun_disc else 1.0
            widest = max(widest, math.ceil(2 * 360 / max(sun, 1e-3)))
        elif kind in _STRUCTURE:
            continue
        elif not _is_value(node) or any(
            not _is_value(n) and n.bl_idname not in textures and not (lights and kit.owns(n, at))
            for n, at in above(node, around, textures)
        ):
            return FINEST
    return min(widest, FINEST)
