"""The base and the backdrop of a kit as nodes: an HDRI, a gradient, black, or other nodes."""

from __future__ import annotations

import math
from pathlib import Path

import bpy

from ...core.errors import KitError
from ...core.kit.model import Base, BaseKind
from ..blender import sequences
from ..blender.nodes import shader_tree
from ..blender.reached import origin
from . import groups

DIRECTION, TURN = "ARTO Kit Direction", "ARTO Kit Turn"
# The names of the nodes of a base begin with one of these.
BASE, BACKDROP = "ARTO Base", "ARTO Backdrop"
_PARTS = ("Turn", "Blur", "HDRI", "Gradient", "Strength")
Socket = bpy.types.NodeSocket


def place_node(node: bpy.types.Node, at: tuple[float, float]) -> None:
    """Put a new node to a place in the node editor."""
    node.location = at


def put(socket: Socket, value: float, part: int | None = None) -> None:
    """Set a socket's value, or a part of it, unless it is there already in single precision."""
    now = socket.default_value if part is None else socket.default_value[part]
    if math.isclose(now, value, rel_tol=1e-6, abs_tol=1e-9):
        return
    if part is None:
        socket.default_value = value
    else:
        socket.default_value[part] = value


def _origin(socket: Socket) -> Socket:
    if not socket.is_linked:
        return socket
    found, _ = origin(socket)
    if found is None or (
        found.is_output and found.node.bl_idname not in {"ShaderNodeValue", "ShaderNodeRGB"}
    ):
        raise KitError(
            f"'{socket.name}' of '{socket.node.label or socket.node.name}' is worked out by nodes: "
            "give it one value to change the light here"
        )
    return found


def plain(value: float) -> float:
    """A number of single precision without the digits that it does not have."""
    return float(f"{value:.7g}")


def degrees(radians: float) -> float:
    """An angle of single precision in degrees."""
    return round(math.degrees(radians), 4)


def number(socket: Socket) -> float:
    """The number that a socket has. Raises KitError where nodes work it out."""
    return plain(_origin(socket).default_value)


def colour(socket: Socket) -> tuple[float, float, float]:
    """The colour that a socket has, nothing below 0. Raises KitError where nodes work it out."""
    value = _origin(socket).default_value
    if isinstance(value, float):
        value = (value, value, value)
    red, green, blue = (plain(max(x, 0.0)) for x in tuple(value)[:3])
    return red, green, blue


def text_of(image: bpy.types.Image | None) -> str:
    """How a kit names an image: by its file, or by its name where it is in no file."""
    if image is None:
        return ""
    on_disk = image.source in {"FILE", "SEQUENCE", "MOVIE"} and image.filepath
    return image.filepath if on_disk and image.packed_file is None else image.name


def image_of(text: str) -> bpy.types.Image:
    """The image that a kit names. Raises KitError where there is none."""
    if text in bpy.data.images:
        return bpy.data.images[text]
    same = next((i for i in bpy.data.images if i.filepath == text), None)
    if same is not None:
        return same
    path = Path(bpy.path.abspath(text))
    if not path.is_file():
        raise KitError(f"the image '{text}' is neither in this file nor on disk: choose another")
    if wrong := sequences.incomplete(path):
        raise KitError(f"{wrong}: copy the image anew, or choose another")
    try:
        return bpy.data.images.load(str(path), check_existing=True)
    except RuntimeError as e:
        raise KitError(f"the image '{path}' cannot be read ({e}): choose another") from e


def check(base: Base) -> None:
    """Raise KitError where a base's image cannot be found."""
    if base.kind is BaseKind.HDRI:
        if not base.image:
            raise KitError("the base is an HDRI without an image: choose one")
        image_of(base.image)


def direction(tree: bpy.types.NodeTree) -> bpy.types.Node:
    """The mapping node that turns a whole kit; it is made where there is none."""
    node = tree.nodes.get(TURN)
    if node is None or node.bl_idname != "ShaderNodeMapping":
        node = tree.nodes.new("ShaderNodeMapping")
        node.name = node.label = TURN
    into = node.inputs["Vector"]
    if not into.is_linked:
        place = tree.nodes.new("ShaderNodeTexCoord")
        place.name = place.label = DIRECTION
        place.location = node.location[0] - 200, node.location[1]
        tree.links.new(place.outputs["Generated"], into)
    return node


def _nodes(tree: bpy.types.NodeTree, prefix: str) -> dict[str, bpy.types.Node]:
    found = {part: tree.nodes.get(f"{prefix} {part}") for part in _PARTS}
    return {part: node for part, node in found.items() if node is not None}


def is_part(node: bpy.types.Node) -> bool:
    """Whether a node is one of a base or a backdrop, and no HDRI."""
    return any(node.name == f"{prefix} {part}" for prefix in (BASE, BACKDROP) for part in _PARTS
               if part != "HDRI")  # fmt: skip


def is_group(tree: bpy.types.NodeTree | None) -> bool:
    """Whether a group is one of a kit's: a light, a blur or a gradient."""
    return bool(groups.what(tree)) or groups.is_blur(tree) or groups.is_gradient(tree)


def remove(tree: bpy.types.NodeTree, prefix: str) -> None:
    """Remove the nodes of a base or a backdrop."""
    for node in _nodes(tree, prefix).values():
        tree.nodes.remove(node)


def owns(tree: bpy.types.NodeTree, prefix: str, into: Socket) -> bool:
    """Whether what a socket is given is a base of ours: black, an HDRI or a gradient."""
    if not into.is_linked:
        return True
    nodes = _nodes(tree, prefix)
    strength = nodes.get("Strength")
    if strength is None or into.links[0].from_node != strength:
        return False
    source = strength.inputs[0].links[0].from_node if strength.inputs[0].is_linked else None
    return source is not None and source in (nodes.get("HDRI"), nodes.get("Gradient"))


def read(tree: bpy.types.NodeTree, prefix: str) -> Base:
    """Read a base or a backdrop. Raises KitError where nodes work out a value of its."""
    nodes = _nodes(tree, prefix)
    strength = nodes.get("Strength")
    if strength is None:
        return Base(BaseKind.NODES if _given(tree, prefix) else BaseKind.BLACK)
    scale = max(number(strength.inputs["Scale"]), 0.0)
    links = strength.inputs[0].links
    source = links[0].from_node if links else None
    if source is not None and source == nodes.get("Gradient"):
        top, horizon, bottom = (
            colour(source.inputs[name]) for name in ("Top", "Horizon", "Bottom")
        )
        return Base(BaseKind.GRADIENT, strength=scale, top=top, horizon=horizon, bottom=bottom)
    if source is not None and source == nodes.get("HDRI"):
        turn, blur = nodes.get("Turn"), nodes.get("Blur")
        return Base(
            BaseKind.HDRI,
            text_of(source.image),
            degrees(turn.inputs["Rotation"].default_value[2]) if turn else 0.0,
            degrees(number(blur.inputs["Blur"])) if blur else 0.0,
            scale,
        )
    return Base(BaseKind.NODES, strength=scale)


def _given(tree: bpy.types.NodeTree, prefix: str) -> bool:
    """Whether nodes that are not ours stand behind the lights, or are the backdrop."""
    if prefix == BACKDROP:
        camera = tree.nodes.get("ARTO Kit Camera")
        return bool(camera and camera.inputs[7].is_linked)
    socket = tree.nodes["ARTO Kit Tinted"].inputs[0]
    while socket.is_linked:
        node = socket.links[0].from_node
        if node.name == "ARTO Kit Camera":
            socket = node.inputs[6]
        elif node.bl_idname == "ShaderNodeGroup" and groups.what(node.node_tree):
            socket = node.inputs["Under"]
        else:
            return True
    return False


def write(
    tree: bpy.types.NodeTree, prefix: str, base: Base, turn: bpy.types.Node, given: Socket | None
) -> Socket | None:
    """Make the nodes of a base or a backdrop -> what it gives; None for black.

    turn: the mapping node of the whole kit; given: what stands there now.
    """
    if base.kind is BaseKind.BLACK:
        remove(tree, prefix)
        return None
    nodes = _nodes(tree, prefix)
    strength = nodes.get("Strength")
    if base.kind is BaseKind.NODES:
        if strength is None and base.strength != 1.0 and given is not None:
            strength = _strength(tree, prefix, turn)
            tree.links.new(given, strength.inputs[0])
        if strength is not None:
            put(strength.inputs["Scale"], base.strength)
            return strength.outputs[0]
        return given
    strength = strength or _strength(tree, prefix, turn)
    put(strength.inputs["Scale"], base.strength)
    make = _hdri if base.kind is BaseKind.HDRI else _gradient
    source = make(tree, prefix, base, turn, nodes)
    if not strength.inputs[0].is_linked or strength.inputs[0].links[0].from_socket != source:
        tree.links.new(source, strength.inputs[0])
    return strength.outputs[0]


def _new(
    tree: bpy.types.NodeTree, prefix: str, part: str, kind: str, turn: bpy.types.Node
) -> bpy.types.Node:
    node = tree.nodes.new(kind)
    node.name = node.label = f"{prefix} {part}"
    below = 300 if prefix == BASE else 620
    along = {"Turn": 200, "Blur": 400, "HDRI": 600, "Gradient": 600, "Strength": 880}[part]
    place_node(node, (turn.location[0] + along - 900, turn.location[1] - below))
    return node


def _strength(tree: bpy.types.NodeTree, prefix: str, turn: bpy.types.Node) -> bpy.types.Node:
    node = _new(tree, prefix, "Strength", "ShaderNodeVectorMath", turn)
    node.operation = "SCALE"
    return node


def _gradient(
    tree: bpy.types.NodeTree,
    prefix: str,
    base: Base,
    turn: bpy.types.Node,
    nodes: dict[str, bpy.types.Node],
) -> Socket:
    for part in ("Turn", "Blur", "HDRI"):
        if part in nodes:
            tree.nodes.remove(nodes[part])
    node = nodes.get("Gradient")
    if node is None:
        node = _new(tree, prefix, "Gradient", "ShaderNodeGroup", turn)
        node.node_tree = groups.gradient_group()
        tree.links.new(turn.outputs[0], node.inputs["Direction"])
    for name, value in (("Top", base.top), ("Horizon", base.horizon), ("Bottom", base.bottom)):
        for i in range(3):
            put(node.inputs[name], value[i], i)
    return node.outputs[0]


def _hdri(
    tree: bpy.types.NodeTree,
    prefix: str,
    base: Base,
    turn: bpy.types.Node,
    nodes: dict[str, bpy.types.Node],
) -> Socket:
    if "Gradient" in nodes:
        tree.nodes.remove(nodes["Gradient"])
    texture = nodes.get("HDRI") or _new(tree, prefix, "HDRI", "ShaderNodeTexEnvironment", turn)
    own = nodes.get("Turn")
    if own is None:
        own = _new(tree, prefix, "Turn", "ShaderNodeMapping", turn)
        tree.links.new(turn.outputs[0], own.inputs["Vector"])
    blur = nodes.get("Blur")
    if blur is None:
        blur = _new(tree, prefix, "Blur", "ShaderNodeGroup", turn)
        blur.node_tree = groups.blur_group()
        tree.links.new(own.outputs[0], blur.inputs["Direction"])
        tree.links.new(blur.outputs[0], texture.inputs["Vector"])
    put(own.inputs["Rotation"], math.radians(base.turn), 2)
    put(blur.inputs["Blur"], math.radians(base.blur))
    image = image_of(base.image)
    if texture.image != image:
        texture.image = image
    return texture.outputs["Color"]


def why_no_base(world: bpy.types.World) -> str:
    """Say why what a world shows cannot be the base of a kit; empty where it can."""
    tree = shader_tree(world)
    out = tree.get_output_node("CYCLES") if tree else None
    links = out.inputs["Surface"].links if out else ()
    if tree is None or not links:
        return ""
    if links[0].from_node.bl_idname != "ShaderNodeBackground":
        return (
            "The world mixes shaders, which cannot stand behind a light kit: mix their colours "
            "before one Background, or make a new world"
        )
    return ""


def taken(world: bpy.types.World) -> Socket | None:
    """Make a base of what a world shows -> what it gives; None for black.

    `why_no_base` must be empty. The world's Background is replaced by the kit's.
    """
    tree = world.node_tree
    out = tree.get_output_node("CYCLES")
    links = out.inputs["Surface"].links if out else ()
    if not links:
        return None
    shown = links[0].from_node
    turn = direction(tree)
    place_node(turn, (shown.location[0] - 900, shown.location[1] - 300))
    colour_in, scale = shown.inputs["Color"], shown.inputs["Strength"]
    if shown.mute or (not scale.is_linked and scale.default_value == 0):
        tree.nodes.remove(shown)
        return None
    if not colour_in.is_linked and not scale.is_linked:
        grey = colour(colour_in)
        base = Base(BaseKind.GRADIENT, strength=scale.default_value, top=grey, horizon=grey,
                    bottom=grey)  # fmt: skip
        tree.nodes.remove(shown)
        return write(tree, BASE, base, turn, None) if any(grey) else None
    strength = _strength(tree, BASE, turn)
    if colour_in.is_linked:
        tree.links.new(colour_in.links[0].from_socket, strength.inputs[0])
    else:
        strength.inputs[0].default_value = colour_in.default_value[:3]
    if scale.is_linked:
        own = _strength(tree, BASE, turn)
        own.name = own.label = f"{BASE} Own Strength"
        tree.links.new(scale.links[0].from_socket, own.inputs["Scale"])
        if colour_in.is_linked:
            tree.links.new(colour_in.links[0].from_socket, own.inputs[0])
        else:
            own.inputs[0].default_value = colour_in.default_value[:3]
        tree.links.new(own.outputs[0], strength.inputs[0])
        strength.inputs["Scale"].default_value = 1.0
    else:
        strength.inputs["Scale"].default_value = scale.default_value
    _own_hdri(tree, strength, turn)
    tree.nodes.remove(shown)
    return strength.outputs[0]


def _own_hdri(tree: bpy.types.NodeTree, strength: bpy.types.Node, turn: bpy.types.Node) -> None:
    """Take a plain HDRI, with or without a mapping that turns it, for the base's own."""
    links = strength.inputs[0].links
    texture = links[0].from_node if links else None
    if texture is None or texture.bl_idname != "ShaderNodeTexEnvironment" or texture.mute:
        return
    if tree.animation_data and (tree.animation_data.action or tree.animation_data.drivers):
        return  # Keys and drivers of the artist's nodes stay where they are.
    into = texture.inputs["Vector"]
    angle = 0.0
    if into.is_linked:
        node = into.links[0].from_node
        if node.bl_idname == "ShaderNodeMapping":
            plain = _turns_only(node)
            if plain is None:
                return
            angle = plain
            into = node.inputs["Vector"]
        if not into.is_linked or into.links[0].from_socket.name != "Generated":
            return
    texture.name = texture.label = f"{BASE} HDRI"
    if texture.image is not None:
        image = text_of(texture.image)
        base = Base(BaseKind.HDRI, image, math.degrees(angle))
        _hdri(tree, BASE, base, turn, {"HDRI": texture})


def _turns_only(node: bpy.types.Node) -> float | None:
    """The angle of a mapping node that does nothing but turn about the vertical; else None."""
    names = ("Location", "Rotation", "Scale")
    if node.mute or node.vector_type != "POINT" or any(node.inputs[n].is_linked for n in names):
        return None
    place, rotation, scale = (node.inputs[n].default_value for n in names)
    if any(place) or any(rotation[:2]) or any(s != 1 for s in scale):
        return None
    return float(rotation[2])
