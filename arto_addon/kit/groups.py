"""The node groups of the kit: what a light does with the light behind it, in Blender's own nodes.

The arithmetic is that of `core.kit.shine`. All groups of lights have the same inputs in the same
order, so a light that becomes another kind keeps its values, keys and drivers. Lights of a kind
share a group; each picture has a group of its own, as the image is inside.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import bpy

from ...core.kit.colour import WHITE_KELVIN
from ...core.kit.light import BOUNDS, Blend, Kind
from ...core.kit.shine import HARD
from ..blender.nodes import Nodes

# The version of the groups: groups of another version are made anew.
VERSION = 1
# Under this name a group says what it is: version, kind, blend, and its numbers of nodes and links.
MARK = "arto_kit"
PICTURE, BLUR, GRADIENT = "Picture", "BLUR", "GRADIENT"
_BIG = 1e9
# Before Python 3.12 an enumeration is not asked for a value by `in`.
_KINDS, _BLENDS = {kind.value for kind in Kind}, {blend.value for blend in Blend}
Socket = bpy.types.NodeSocket


@dataclass(frozen=True)
class Input:
    """An input of a light's group. value: the field of `Light` that it holds; empty for none."""

    name: str
    kind: str
    value: str = ""
    subtype: str = "NONE"


INPUTS = (
    Input("Under", "NodeSocketColor"),
    Input("Direction", "NodeSocketVector"),
    Input("Amount", "NodeSocketFloat", "amount", "FACTOR"),
    Input("Strength", "NodeSocketFloat", "strength"),
    Input("Stops", "NodeSocketFloat", "stops"),
    Input("Color", "NodeSocketColor", "colour"),
    Input("Kelvin", "NodeSocketFloat", "kelvin"),
    Input("Tint", "NodeSocketFloat", "tint", "FACTOR"),
    Input("Azimuth", "NodeSocketFloat", "azimuth", "ANGLE"),
    Input("Elevation", "NodeSocketFloat", "elevation", "ANGLE"),
    Input("Roll", "NodeSocketFloat", "roll", "ANGLE"),
    Input("Width", "NodeSocketFloat", "width", "ANGLE"),
    Input("Height", "NodeSocketFloat", "height", "ANGLE"),
    Input("Softness", "NodeSocketFloat", "softness", "FACTOR"),
    Input("Gradient", "NodeSocketFloat", "gradient", "FACTOR"),
    Input("Slope", "NodeSocketFloat", "slope", "FACTOR"),
    Input("Hole", "NodeSocketFloat", "hole", "FACTOR"),
)
_DEFAULTS = {
    "strength": 1.0, "amount": 1.0, "kelvin": WHITE_KELVIN, "width": 30.0, "height": 30.0,
    "hole": 0.6,
}  # fmt: skip


def light_group(kind: Kind, blend: Blend) -> bpy.types.NodeTree:
    """The group of lights of a kind and a blend; of pictures a new one."""
    if kind is not Kind.PICTURE:
        found = _there(kind.value, blend.value)
        if found is not None:
            return found
    tree = bpy.data.node_groups.new(f"ARTO {kind.title()} {blend.title()}", "ShaderNodeTree")
    _interface(tree)
    _draw(tree, kind, blend)
    return _marked(tree, kind.value, blend.value)


def what(tree: bpy.types.NodeTree | None) -> tuple[Kind, Blend] | None:
    """What lights of a group are; None for a group that is no light, or was changed inside."""
    said = _said(tree)
    if said is None or said[0] not in _KINDS or said[1] not in _BLENDS:
        return None
    return Kind(said[0]), Blend(said[1])


def is_blur(tree: bpy.types.NodeTree | None) -> bool:
    """Whether a group is the one that blurs a base's HDRI."""
    return _said(tree) == (BLUR, "")


def is_gradient(tree: bpy.types.NodeTree | None) -> bool:
    """Whether a group is the gradient of a base."""
    return _said(tree) == (GRADIENT, "")


def picture_node(tree: bpy.types.NodeTree) -> bpy.types.Node:
    """The node that holds the image of a picture's group."""
    return tree.nodes[PICTURE]


def _said(tree: bpy.types.NodeTree | None) -> tuple[str, str] | None:
    mark = tree.get(MARK) if tree is not None else None
    words = str(mark).split("|") if mark else []
    if tree is None or len(words) != 4 or words[0] != str(VERSION):
        return None
    same = words[3] == f"{len(tree.nodes)} {len(tree.links)}"
    return (words[1], words[2]) if same else None


def _marked(tree: bpy.types.NodeTree, kind: str, blend: str) -> bpy.types.NodeTree:
    tree[MARK] = f"{VERSION}|{kind}|{blend}|{len(tree.nodes)} {len(tree.links)}"
    return tree


def _there(kind: str, blend: str) -> bpy.types.NodeTree | None:
    trees = (t for t in bpy.data.node_groups if t.bl_idname == "ShaderNodeTree" and not t.library)
    return next((t for t in trees if t.get(MARK) and _said(t) == (kind, blend)), None)


def _interface(tree: bpy.types.NodeTree) -> None:
    for one in INPUTS:
        socket = tree.interface.new_socket(one.name, in_out="INPUT", socket_type=one.kind)
        if one.kind == "NodeSocketVector":
            socket.hide_value = True
        elif one.kind == "NodeSocketColor":
            white = 1.0 if one.value else 0.0
            socket.default_value = (white, white, white, 1.0)
        else:
            socket.subtype = one.subtype
            low, high = BOUNDS[one.value]
            value, unit = _DEFAULTS.get(one.value, 0.0), 1.0
            if one.subtype == "ANGLE":
                unit = math.pi / 180
            socket.min_value, socket.max_value = max(low, -_BIG) * unit, min(high, _BIG) * unit
            socket.default_value = value * unit
    tree.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")


def _draw(tree: bpy.types.NodeTree, kind: Kind, blend: Blend) -> None:
    nodes = Nodes(tree)
    given = tree.nodes.new("NodeGroupInput").outputs
    x, y, half_x, half_y, there = _place(nodes, given, kind)
    cover, out = _shape(nodes, given, kind, x, y, half_x, half_y)
    cover = nodes.math("MULTIPLY", cover, there)
    shade = _shade(nodes, given, out, y)
    emits = nodes.add("ShaderNodeVectorMath", _colour(nodes, given), operation="SCALE")
    scale = nodes.math("MULTIPLY", _strength(nodes, given, kind, blend), shade)
    tree.links.new(scale, emits.inputs["Scale"])
    emitted = emits.outputs[0]
    if kind is Kind.PICTURE:
        cover, emitted = _picture(nodes, cover, emitted, x, y)
    cover = nodes.math("MULTIPLY", cover, given["Amount"])
    _blend(nodes, given["Under"], cover, emitted, blend)


def _place(nodes: Nodes, given: bpy.types.NodeOutputs, kind: Kind) -> tuple[Socket, ...]:
    """Where the direction meets the light's plane: x and y, -1 to 1 within the light; whether."""
    tree = nodes.tree
    below = nodes.math("MULTIPLY", given["Elevation"], -1.0)
    turn = nodes.add("ShaderNodeCombineXYZ", given["Roll"], below, given["Azimuth"])
    own = tree.nodes.new("ShaderNodeMapping")
    own.vector_type = "TEXTURE"
    tree.links.new(given["Direction"], own.inputs["Vector"])
    tree.links.new(turn.outputs[0], own.inputs["Rotation"])
    ahead, left, up = nodes.add("ShaderNodeSeparateXYZ", own.outputs[0]).outputs
    height = given["Width"] if kind is Kind.SUN else given["Height"]
    half_x = nodes.math("TANGENT", nodes.math("MULTIPLY", given["Width"], 0.5))
    half_y = nodes.math("TANGENT", nodes.math("MULTIPLY", height, 0.5))
    depth = nodes.math("MAXIMUM", ahead, 1e-6)
    right = nodes.math("MULTIPLY", left, -1.0)
    x = nodes.math("DIVIDE", right, nodes.math("MULTIPLY", depth, half_x))
    y = nodes.math("DIVIDE", up, nodes.math("MULTIPLY", depth, half_y))
    return x, y, half_x, half_y, nodes.math("GREATER_THAN", ahead, 1e-6)


def _edge(nodes: Nodes, t: Socket, given: bpy.types.NodeOutputs) -> Socket:
    soft = nodes.math("MAXIMUM", given["Softness"], HARD)
    node = nodes.tree.nodes.new("ShaderNodeMapRange")
    node.interpolation_type = "SMOOTHSTEP"
    nodes.tree.links.new(t, node.inputs["Value"])
    nodes.tree.links.new(nodes.math("SUBTRACT", 1.0, soft), node.inputs["From Min"])
    node.inputs["From Max"].default_value = 1.0
    node.inputs["To Min"].default_value, node.inputs["To Max"].default_value = 1.0, 0.0
    return node.outputs[0]


def _shape(
    nodes: Nodes, given: bpy.types.NodeOutputs, kind: Kind,
    x: Socket, y: Socket, half_x: Socket, half_y: Socket,
) -> tuple[Socket, Socket]:  # fmt: skip
    """The cover, and how far out a place is: 1 on the rim."""
    wide, high = nodes.math("ABSOLUTE", x), nodes.math("ABSOLUTE", y)
    if kind in (Kind.RECTANGLE, Kind.PICTURE, Kind.FLAG):
        both = nodes.math("MULTIPLY", _edge(nodes, wide, given), _edge(nodes, high, given))
        return both, nodes.math("MAXIMUM", wide, high)
    if kind is Kind.STRIP:
        r = nodes.math("MINIMUM", half_x, half_y)

        def past(t: Socket, half: Socket) -> Socket:
            inner = nodes.math("SUBTRACT", half, r)
            beyond = nodes.math("SUBTRACT", nodes.math("MULTIPLY", t, half), inner)
            return nodes.math("DIVIDE", nodes.math("MAXIMUM", beyond, 0.0), r)

        out = _length(nodes, past(wide, half_x), past(high, half_y))
    else:
        out = _length(nodes, x, y)
        if kind is Kind.RING:
            twice = nodes.math("MULTIPLY", out, 2.0)
            middle = nodes.math("ADD", given["Hole"], 1.0)
            across = nodes.math("ABSOLUTE", nodes.math("SUBTRACT", twice, middle))
            out = nodes.math("DIVIDE", across, nodes.math("SUBTRACT", 1.0, given["Hole"]))
    return _edge(nodes, out, given), out


def _length(nodes: Nodes, x: Socket, y: Socket) -> Socket:
    flat = nodes.add("ShaderNodeCombineXYZ", x, y, 0.0).outputs[0]
    return nodes.add("ShaderNodeVectorMath", flat, operation="LENGTH").outputs["Value"]


def _shade(nodes: Nodes, given: bpy.types.NodeOutputs, out: Socket, y: Socket) -> Socket:
    """The brightness by gradient and slope."""
    within = nodes.math("MINIMUM", out, 1.0)
    square = nodes.math("MULTIPLY", within, within)
    lost = nodes.math("MULTIPLY", given["Gradient"], square)
    full = nodes.math("ADD", nodes.math("MINIMUM", given["Gradient"], 0.0), 1.0)
    half = nodes.math("MULTIPLY", given["Slope"], 0.5)
    at = nodes.math("MULTIPLY_ADD", half, y, nodes.math("SUBTRACT", 1.0, nodes.math(
        "ABSOLUTE", half)))  # fmt: skip
    clamped = nodes.add("ShaderNodeClamp", at, 0.0, 1.0).outputs[0]
    return nodes.math("MULTIPLY", nodes.math("SUBTRACT", full, lost), clamped)


def _colour(nodes: Nodes, given: bpy.types.NodeOutputs) -> Socket:
    body = nodes.add("ShaderNodeBlackbody", given["Kelvin"]).outputs[0]
    white = nodes.add("ShaderNodeBlackbody", WHITE_KELVIN).outputs[0]
    ratio = nodes.add("ShaderNodeVectorMath", body, white, operation="DIVIDE").outputs[0]
    green = nodes.math("POWER", 2.0, given["Tint"])
    tint = nodes.add("ShaderNodeCombineXYZ", 1.0, green, 1.0).outputs[0]
    both = nodes.add("ShaderNodeVectorMath", ratio, tint, operation="MULTIPLY").outputs[0]
    all_ = nodes.add("ShaderNodeVectorMath", both, given["Color"], operation="MULTIPLY")
    return all_.outputs[0]


def _strength(nodes: Nodes, given: bpy.types.NodeOutputs, kind: Kind, blend: Blend) -> Socket:
    scale = nodes.math("MULTIPLY", given["Strength"], nodes.math("POWER", 2.0, given["Stops"]))
    if kind is not Kind.SUN or blend is Blend.MULTIPLY:
        return scale
    sine = nodes.math("SINE", nodes.math("MULTIPLY", given["Width"], 0.5))
    across = nodes.math("MULTIPLY", nodes.math("MULTIPLY", sine, sine), math.pi)
    return nodes.math("DIVIDE", scale, across)


def _picture(
    nodes: Nodes, cover: Socket, emitted: Socket, x: Socket, y: Socket
) -> tuple[Socket, Socket]:
    u, v = (nodes.math("MULTIPLY_ADD", t, 0.5, 0.5) for t in (x, y))
    place = nodes.add("ShaderNodeCombineXYZ", u, v, 0.0).outputs[0]
    texture = nodes.add("ShaderNodeTexImage", place)
    texture.name = texture.label = PICTURE
    texture.extension = "EXTEND"
    shown = nodes.add(
        "ShaderNodeVectorMath", emitted, texture.outputs["Color"], operation="MULTIPLY"
    )
    return nodes.math("MULTIPLY", cover, texture.outputs["Alpha"]), shown.outputs[0]


def _blend(nodes: Nodes, under: Socket, cover: Socket, emitted: Socket, blend: Blend) -> None:
    tree = nodes.tree
    if blend is Blend.ADD:
        behind = under
    else:
        kept = nodes.math("SUBTRACT", 1.0, cover)
        if blend is Blend.MULTIPLY:
            whole = nodes.add(
                "ShaderNodeVectorMath", emitted, cover, kept, operation="MULTIPLY_ADD"
            ).outputs[0]
            out = nodes.add("ShaderNodeVectorMath", under, whole, operation="MULTIPLY")
            nodes.add("NodeGroupOutput", out.outputs[0])
            return
        behind = nodes.add("ShaderNodeVectorMath", under, kept, operation="MULTIPLY").outputs[0]
    out = nodes.add("ShaderNodeVectorMath", emitted, cover, behind, operation="MULTIPLY_ADD")
    nodes.add("NodeGroupOutput", out.outputs[0])
    assert tree.nodes


def gradient_group() -> bpy.types.NodeTree:
    """The group of a base's gradient, by the elevation."""
    found = _there(GRADIENT, "")
    if found is not None:
        return found
    tree = bpy.data.node_groups.new("ARTO Gradient", "ShaderNodeTree")
    tree.interface.new_socket("Direction", in_out="INPUT", socket_type="NodeSocketVector")
    for name, grey in (("Top", 1.0), ("Horizon", 0.5), ("Bottom", 0.05)):
        one = tree.interface.new_socket(name, in_out="INPUT", socket_type="NodeSocketColor")
        one.default_value = (grey, grey, grey, 1.0)
    tree.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    nodes = Nodes(tree)
    given = tree.nodes.new("NodeGroupInput").outputs
    unit = nodes.add("ShaderNodeVectorMath", given["Direction"], operation="NORMALIZE").outputs[0]
    z = nodes.add("ShaderNodeSeparateXYZ", unit).outputs[2]
    above = nodes.math("MAXIMUM", z, 0.0)
    below = nodes.math("MAXIMUM", nodes.math("MULTIPLY", z, -1.0), 0.0)
    level = nodes.math("SUBTRACT", nodes.math("SUBTRACT", 1.0, above), below)

    def scaled(colour: Socket, by: Socket) -> Socket:
        node = nodes.add("ShaderNodeVectorMath", colour, operation="SCALE")
        tree.links.new(by, node.inputs["Scale"])
        return node.outputs[0]

    both = nodes.add("ShaderNodeVectorMath", scaled(given["Top"], above),
                     scaled(given["Bottom"], below), operation="ADD").outputs[0]  # fmt: skip
    out = nodes.add("ShaderNodeVectorMath", both, scaled(given["Horizon"], level), operation="ADD")
    nodes.add("NodeGroupOutput", out.outputs[0])
    return _marked(tree, GRADIENT, "")


def blur_group() -> bpy.types.NodeTree:
    """The group that blurs what is looked up: directions are scattered over a disc."""
    found = _there(BLUR, "")
    if found is not None:
        return found
    tree = bpy.data.node_groups.new("ARTO Blur", "ShaderNodeTree")
    tree.interface.new_socket("Direction", in_out="INPUT", socket_type="NodeSocketVector")
    blur = tree.interface.new_socket("Blur", in_out="INPUT", socket_type="NodeSocketFloat")
    blur.subtype, blur.min_value, blur.max_value = "ANGLE", 0.0, math.pi
    tree.interface.new_socket("Direction", in_out="OUTPUT", socket_type="NodeSocketVector")
    nodes = Nodes(tree)
    given = tree.nodes.new("NodeGroupInput").outputs
    unit = nodes.add("ShaderNodeVectorMath", given["Direction"], operation="NORMALIZE").outputs[0]
    # A grain so fine that no two samples of a pixel get the same.
    fine = nodes.add("ShaderNodeVectorMath", unit, operation="SCALE")
    fine.inputs["Scale"].default_value = 12345.678
    noise = nodes.add("ShaderNodeTexWhiteNoise", fine.outputs[0])
    a, b, c = nodes.add("ShaderNodeSeparateXYZ", noise.outputs["Color"]).outputs
    # A point spread evenly in a ball.
    z = nodes.math("MULTIPLY_ADD", a, 2.0, -1.0)
    across = nodes.math("SQRT", nodes.math("SUBTRACT", 1.0, nodes.math("MULTIPLY", z, z)))
    turn = nodes.math("MULTIPLY", b, 2 * math.pi)
    x = nodes.math("MULTIPLY", across, nodes.math("COSINE", turn))
    y = nodes.math("MULTIPLY", across, nodes.math("SINE", turn))
    sphere = nodes.add("ShaderNodeCombineXYZ", x, y, z).outputs[0]
    most = nodes.math("TANGENT", nodes.math("MINIMUM", given["Blur"], math.radians(80.0)))
    reach = nodes.math("MULTIPLY", nodes.math("POWER", c, 1 / 3), most)
    shift = nodes.add("ShaderNodeVectorMath", sphere, reach, unit, operation="MULTIPLY_ADD")
    nodes.add("NodeGroupOutput", shift.outputs[0])
    return _marked(tree, BLUR, "")
