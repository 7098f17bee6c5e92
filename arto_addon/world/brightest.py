"""How bright a world can be at most, read from its nodes by arithmetic with intervals.

Noise, clouds and stars have fine detail, and none of it is a sun: their light has a bound. A world
with such a bound needs no search for lamps smaller than a texel.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import bpy

from ..blender.nodes import shader_tree
from ..blender.reached import Around, origin

Range = tuple[float, float]
_ANY: Range = (-math.inf, math.inf)
_UNIT: Range = (0.0, 1.0)
_SIGNED: Range = (-1.0, 1.0)


def brightest(world: bpy.types.World) -> float:
    """An upper bound of a world's radiance in each channel; infinite where none is known."""
    tree = shader_tree(world)
    out = tree.get_output_node("CYCLES") if tree else None
    if out is None:
        return 0.0
    return _Bounds().of(out.inputs["Surface"], ())[1]


def _hull(*ranges: Range) -> Range:
    return min(low for low, _ in ranges), max(high for _, high in ranges)


def _times(a: Range, b: Range) -> Range:
    every = [0.0 if 0.0 in (x, y) else x * y for x in a for y in b]
    return min(every), max(every)


def _plus(a: Range, b: Range) -> Range:
    return a[0] + b[0], a[1] + b[1]


def _minus(a: Range, b: Range) -> Range:
    return a[0] - b[1], a[1] - b[0]


def _size(a: Range) -> float:
    return max(abs(a[0]), abs(a[1]))


def _over(a: Range, b: Range) -> Range:
    return _ANY if b[0] <= 0 <= b[1] else _times(a, (1 / b[1], 1 / b[0]))


def _power(a: Range, b: Range) -> Range:
    if a[0] < 0 or b[0] < 0 or math.inf in (*a, *b):
        return _ANY
    try:
        return 0.0, max(1.0, a[1]) ** b[1]
    except OverflowError:
        return _ANY


_TWO: dict[str, Callable[[Range, Range], Range]] = {
    "ADD": _plus,
    "SUBTRACT": _minus,
    "MULTIPLY": _times,
    "DIVIDE": _over,
    "POWER": _power,
    "MINIMUM": lambda a, b: (min(a[0], b[0]), min(a[1], b[1])),
    "MAXIMUM": lambda a, b: (max(a[0], b[0]), max(a[1], b[1])),
}
_FIXED: dict[str, Range] = {
    **dict.fromkeys(("GREATER_THAN", "LESS_THAN", "COMPARE", "FRACT", "FRACTION"), _UNIT),
    **dict.fromkeys(("SINE", "COSINE", "SIGN", "NORMALIZE"), _SIGNED),
}
# Kinds of nodes all of whose outputs are within a range, and outputs of other kinds.
_KINDS: dict[str, Range] = {
    "ShaderNodeTexWave": _UNIT,
    "ShaderNodeTexWhiteNoise": _UNIT,
    "ShaderNodeLayerWeight": _UNIT,
    "ShaderNodeFresnel": _UNIT,
    # The redder a body, the larger its red beside a luminance of 1.
    "ShaderNodeBlackbody": (0.0, 8.0),
}
_DIRECTIONS = {
    "ShaderNodeTexCoord": ("Generated", "Normal", "Camera", "Reflection"),
    "ShaderNodeNewGeometry": ("Position", "Normal", "Incoming", "True Normal"),
}


@dataclass
class _Bounds:
    """The ranges of sockets; kept: those that are known, as nodes may lead to many others."""

    kept: dict[tuple[int, ...], Range] = field(default_factory=dict)

    def of(self, socket: bpy.types.NodeSocket, around: Around) -> Range:
        key = socket.as_pointer(), *(node.as_pointer() for node in around)
        if key not in self.kept:
            self.kept[key] = _ANY  # so that a ring of nodes comes to an end
            low, high = self._look(socket, around)
            self.kept[key] = _ANY if math.isnan(low) or math.isnan(high) else (low, high)
        return self.kept[key]

    def _look(self, socket: bpy.types.NodeSocket, around: Around) -> Range:
        found, around = origin(socket, around)
        if found is None:
            return _ANY
        if not found.is_output:
            return _own(found)
        node = found.node
        if names := _DIRECTIONS.get(node.bl_idname):
            return _SIGNED if found.name in names else _ANY
        if node.bl_idname == "ShaderNodeLightPath":
            return _UNIT if found.name.startswith("Is ") else _ANY
        if node.bl_idname in _KINDS:
            return _KINDS[node.bl_idname]
        look = _NODES.get(node.bl_idname)
        if look is None:
            return _ANY
        inputs = [self.of(s, around) for s in node.inputs if s.enabled]
        return look(node, found.name, inputs)


def _own(socket: bpy.types.NodeSocket) -> Range:
    """The range of an input's own value; of none, that is light, 0."""
    value = getattr(socket, "default_value", None)
    if value is None:
        return (0.0, 0.0) if socket.type == "SHADER" else _ANY
    if isinstance(value, bool | int | float):
        return float(value), float(value)
    numbers = [float(x) for x in value] if socket.type in {"RGBA", "VECTOR"} else []
    # Textures take a direction where no vector is linked, and hide the input's value.
    if not numbers or socket.hide_value:
        return _SIGNED if socket.type == "VECTOR" else _ANY
    return min(numbers[:3]), max(numbers[:3])


def _math(node: bpy.types.Node, _: str, of: list[Range]) -> Range:
    kind = node.operation
    if getattr(node, "use_clamp", False):
        return _UNIT
    if kind in _FIXED:
        return _FIXED[kind]
    if kind in _TWO:
        return _TWO[kind](of[0], of[1])
    if kind == "MULTIPLY_ADD":
        return _plus(_times(of[0], of[1]), of[2])
    if kind == "ABSOLUTE":
        return 0.0, _size(of[0])
    if kind == "SQRT":
        return 0.0, max(1.0, of[0][1])
    if kind == "SCALE":
        return _times(of[0], of[-1])
    if kind == "DOT_PRODUCT":
        return _times((3.0, 3.0), _times(of[0], of[1]))
    if kind == "LENGTH":
        return 0.0, 2 * _size(of[0])
    if kind == "DISTANCE":
        return 0.0, 2 * _size(_minus(of[0], of[1]))
    return _ANY


def _mix(node: bpy.types.Node, _: str, of: list[Range]) -> Range:
    if getattr(node, "clamp_result", False) or getattr(node, "use_clamp", False):
        return _UNIT
    if len(of) != 3 or not (getattr(node, "clamp_factor", True) or _within(of[0])):
        return _ANY
    kind = getattr(node, "blend_type", "MIX") if _mixes_colours(node) else "MIX"
    a, b = of[1:]
    if kind in {"MIX", "DARKEN", "LIGHTEN"}:
        return _hull(a, b)
    if kind in {"ADD", "SUBTRACT", "MULTIPLY"}:
        return _hull(a, _TWO[kind](a, b))
    if kind in {"SCREEN", "OVERLAY", "SOFT_LIGHT", "DODGE"} and _within(a) and _within(b):
        return _UNIT
    return _ANY


def _mixes_colours(node: bpy.types.Node) -> bool:
    return getattr(node, "data_type", "RGBA") == "RGBA"


def _within(a: Range) -> bool:
    return a[0] >= 0 and a[1] <= 1


def _ramp(node: bpy.types.Node, name: str, _: list[Range]) -> Range:
    ramp = node.color_ramp
    if name == "Alpha":
        return _UNIT
    values = [x for stop in ramp.elements for x in tuple(stop.color)[:3]]
    low, high = min(values), max(values)
    if ramp.color_mode != "RGB":
        low = min(low, 0.0)
    spread = high - low if ramp.interpolation == "CARDINAL" else 0.0
    return low - spread, high + spread


def _noise(node: bpy.types.Node, _: str, __: list[Range]) -> Range:
    kind = getattr(node, "noise_type", "FBM")
    return _UNIT if kind == "FBM" and getattr(node, "normalize", True) else _ANY


def _cells(node: bpy.types.Node, name: str, _: list[Range]) -> Range:
    if name == "Color":
        return _UNIT
    if name not in {"Distance", "Radius"}:
        return _ANY
    # No point is farther than a few cells from the nearest ones; octaves add up to 16 of these.
    return 0.0, 6.0 * 16


def _gradient(node: bpy.types.Node, _: str, of: list[Range]) -> Range:
    most = _size(of[0])
    kind = node.gradient_type
    if kind in {"LINEAR", "DIAGONAL"}:
        return 0.0, most
    return (0.0, most * most) if kind == "QUADRATIC" else _UNIT


def _mapping(node: bpy.types.Node, _: str, of: list[Range]) -> Range:
    if node.vector_type == "NORMAL":
        return _SIGNED
    if node.vector_type == "TEXTURE":
        return _ANY
    sockets = [s for s in node.inputs if s.enabled]
    by_name = dict(zip((s.name for s in sockets), of, strict=True))
    reach = 2 * _size(by_name["Vector"]) * _size(by_name["Scale"])
    reach += _size(by_name.get("Location", (0.0, 0.0)))
    return -reach, reach


def _rotate(_: bpy.types.Node, __: str, of: list[Range]) -> Range:
    reach = 4 * (_size(of[0]) + _size(of[1]))  # about a centre
    return -reach, reach


def _hue(_: bpy.types.Node, __: str, of: list[Range]) -> Range:
    # Hue, Saturation, Value, Factor, Color
    *_rest, value, _factor, colour = of
    return _hull((0.0, 0.0), colour, _times(colour, value))


def _light(_: bpy.types.Node, __: str, of: list[Range]) -> Range:
    return _hull((0.0, 0.0), _times(of[0], of[1]))


_NODES: dict[str, Callable[[bpy.types.Node, str, list[Range]], Range]] = {
    "ShaderNodeAddShader": lambda _, __, of: _plus(of[0], of[1]),
    "ShaderNodeBackground": _light,
    "ShaderNodeClamp": lambda _, __, of: _hull(of[1], of[2]),
    "ShaderNodeCombineColor": lambda n, _, of: _hull(*of) if n.mode == "RGB" else _ANY,
    "ShaderNodeCombineXYZ": lambda _, __, of: _hull(*of),
    "ShaderNodeEmission": _light,
    "ShaderNodeGamma": lambda _, __, of: _power(of[0], of[1]),
    "ShaderNodeHueSaturation": _hue,
    "ShaderNodeInvert": lambda _, __, of: _hull(of[1], _minus((1.0, 1.0), of[1])),
    "ShaderNodeMapRange": lambda n, _, of: _hull(of[3], of[4]) if n.clamp else _ANY,
    "ShaderNodeMapping": _mapping,
    "ShaderNodeMath": _math,
    "ShaderNodeMix": _mix,
    "ShaderNodeMixRGB": _mix,
    "ShaderNodeMixShader": lambda _, __, of: _hull((0.0, 0.0), of[1], of[2]),
    "ShaderNodeRGB": lambda n, _, __: _own(n.outputs[0]),
    "ShaderNodeRGBToBW": lambda _, __, of: of[0],
    "ShaderNodeSeparateXYZ": lambda _, __, of: of[0],
    "ShaderNodeTexBrick": lambda _, __, of: _hull(_UNIT, *of[1:4]),
    "ShaderNodeTexChecker": lambda _, __, of: _hull(_UNIT, *of[1:3]),
    "ShaderNodeTexGradient": _gradient,
    "ShaderNodeTexNoise": _noise,
    "ShaderNodeTexVoronoi": _cells,
    "ShaderNodeValToRGB": _ramp,
    "ShaderNodeValue": lambda n, _, __: _own(n.outputs[0]),
    "ShaderNodeVectorMath": _math,
    "ShaderNodeVectorRotate": _rotate,
}
