"""The dials of a world: the node that turns the world, and the socket that scales its strength.

Sliders, turntables and the kept maps of worlds all ask here. Two questions have different answers:
- `whole`: which background node and which mapping node change nothing but the strength and the turn
  of all light? A kept map is then used again for every strength and turn.
- `scaler`, `turner`: what does a slider move? Where there is nothing to move, `put_in_scaler` and
  `put_in_turner` add nodes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import bpy

from ...core.errors import SceneError
from ..blender.nodes import shader_tree, trees
from ..kit import kit
from .detail import values_only
from .still import still

# The names of the nodes that are added.
TURN, STRENGTH, PLACE = "ARTO Turn", "ARTO Strength", "ARTO Place"
# Nodes that show a picture by direction.
_PICTURES = {"ShaderNodeTexEnvironment", "ShaderNodeTexSky"}
# The kinds of skies that are turned by the direction that is looked up.
_BY_VECTOR = ("PREETHAM", "HOSEK_WILKIE")
# Nodes after which a mapping node can be added.
_SOURCES = {"ShaderNodeTexCoord", "ShaderNodeMapping", "ShaderNodeNewGeometry"}


def backgrounds(world: bpy.types.World) -> list[bpy.types.Node]:
    """The background nodes of a world's own tree."""
    tree = shader_tree(world)
    return [n for n in tree.nodes if n.bl_idname == "ShaderNodeBackground"] if tree else []


def _pictures(world: bpy.types.World) -> list[bpy.types.Node]:
    """The nodes of a world's own tree that show a picture by direction and have a socket Vector."""
    tree = shader_tree(world)
    found = [n for n in tree.nodes if n.bl_idname in _PICTURES] if tree else []
    return [n for n in found if getattr(n, "sky_type", _BY_VECTOR[0]) in _BY_VECTOR]


def _skies(world: bpy.types.World) -> list[bpy.types.Node]:
    """The skies of a world's own tree that turn by their Sun Rotation: without a socket Vector."""
    tree = shader_tree(world)
    found = [n for n in tree.nodes if n.bl_idname == "ShaderNodeTexSky"] if tree else []
    found = [n for n in found if n.sky_type not in _BY_VECTOR]
    return [n for n in found if any(o.is_linked for o in n.outputs)]


def _groups(world: bpy.types.World) -> list[bpy.types.Node]:
    """The group nodes of a world's own tree whose groups contain a picture."""
    tree = shader_tree(world)
    return [
        node
        for node in (tree.nodes if tree else ())
        if node.bl_idname == "ShaderNodeGroup"
        and any(n.bl_idname in _PICTURES for t in trees(node.node_tree, set()) for n in t.nodes)
    ]


def _mappings_before(sockets: Iterable[bpy.types.NodeSocket]) -> list[bpy.types.Node]:
    """The nearest mapping nodes on all ways that lead to some sockets, each once."""
    found: list[bpy.types.Node] = []
    seen: list[bpy.types.Node] = []
    todo = list(sockets)
    while todo:
        for link in todo.pop().links:
            node = link.from_node
            if node in seen:
                continue
            seen.append(node)
            if node.bl_idname == "ShaderNodeMapping":
                found.append(node)
            else:
                todo += node.inputs
    return found


def turner(world: bpy.types.World) -> bpy.types.Node | None:
    """The mapping node that turns all pictures of a world.

    None where there is no such node, where several nodes turn the pictures, or where other nodes
    work out the rotation.
    """
    if kit.has(world):
        return kit.turns(world)
    ways = [[picture.inputs["Vector"]] for picture in _pictures(world)]
    ways = ways or [list(group.inputs) for group in _groups(world)]
    found = [_mappings_before(sockets) for sockets in ways]
    if not found or len(found[0]) != 1 or any(some != found[0] for some in found):
        return None
    (node,) = found[0]
    return None if node.inputs["Rotation"].is_linked else node


def why_not_turned(world: bpy.types.World) -> str:
    """Say why a world cannot be turned, for a grey slider; empty where it can be turned."""
    if world.library:
        return "The world is linked from a library: make it local to change it"
    if kit.has(world):
        if kit.turns(world) is not None:
            return ""
        return "Other nodes stand around the light kit: turn them and the kit there"
    pictures, skies = _pictures(world), _skies(world)
    if skies and pictures:
        return "The world mixes a sky and HDRIs: turn them one by one"
    if skies or turner(world) is not None:
        return ""
    if not pictures:
        if groups := _groups(world):
            found = [n for group in groups for t in trees(group.node_tree, set()) for n in t.nodes]
            if any(node.bl_idname == "ShaderNodeTexEnvironment" for node in found):
                return "The HDRI is in a node group: turn it there"
            return "The sky is in a node group: turn it there, by its Sun Rotation"
        return "The world has no HDRI or sky: it is the same from every side"
    sources = {_source(picture) for picture in pictures}
    if any(kind not in _SOURCES for kind, _, _ in sources):
        return "The HDRI is turned by nodes of its own: turn it there"
    if len(sources) > 1:
        return "The world's HDRIs are turned one by one: turn them there"
    return ""


def _source(picture: bpy.types.Node) -> tuple[str, str, str]:
    """Where a picture's direction comes from: the kind of node, its name, and the socket's name.

    The name is given for a mapping node alone. Of the other kinds, all nodes give the same
    direction.
    """
    links = picture.inputs["Vector"].links
    if not links:
        return "ShaderNodeTexCoord", "", "Generated"
    node = links[0].from_node
    name = node.name if node.bl_idname == "ShaderNodeMapping" else ""
    return node.bl_idname, name, links[0].from_socket.name


def put_in_turner(world: bpy.types.World) -> bpy.types.Node:
    """Add a mapping node that turns all pictures of a world. `why_not_turned` must be empty."""
    tree, pictures = world.node_tree, _pictures(world)
    node = tree.nodes.new("ShaderNodeMapping")
    node.name = node.label = TURN
    first = pictures[0]
    x, y = first.location
    node.location = (x - 220, y)
    links = first.inputs["Vector"].links
    if links:
        source = links[0].from_socket
    else:
        place = tree.nodes.new("ShaderNodeTexCoord")
        place.name = place.label = PLACE
        place.location = (x - 440, y)
        source = place.outputs["Generated"]
    tree.links.new(source, node.inputs["Vector"])
    for picture in pictures:
        tree.links.new(node.outputs[0], picture.inputs["Vector"])
    return node


def turn(world: bpy.types.World) -> float:
    """The rotation of a world about the vertical, in radians, clockwise from above."""
    skies = [] if kit.has(world) else _skies(world)
    if skies:
        return skies[0].sun_rotation
    node = turner(world)
    return node.inputs["Rotation"].default_value[2] if node else 0.0


def turn_to(world: bpy.types.World, angle: float) -> None:
    """Turn a world to an angle in radians; `why_not_turned` must be empty.

    A sky turns by its Sun Rotation, several skies by as much as the first. Pictures turn by a
    mapping node, which is added where there is none.
    """
    skies = [] if kit.has(world) else _skies(world)
    if skies:
        more = angle - skies[0].sun_rotation
        for sky in skies:
            sky.sun_rotation += more
        return
    node = turner(world) or put_in_turner(world)
    node.inputs["Rotation"].default_value[2] = angle


def scaler(world: bpy.types.World) -> bpy.types.NodeSocket | None:
    """The socket that scales the strength of a whole world; None where there is no such socket."""
    tree = shader_tree(world)
    if tree is None:
        return None
    if STRENGTH in tree.nodes:
        return tree.nodes[STRENGTH].outputs[0]
    background, _ = whole(world)
    found = [background] if background else backgrounds(world)
    if len(found) == 1 and not found[0].inputs["Strength"].is_linked:
        return found[0].inputs["Strength"]
    return None


def put_in_scaler(world: bpy.types.World) -> bpy.types.NodeSocket:
    """Add a socket that multiplies the strength of all backgrounds of a world; its value is 1."""
    tree = world.node_tree
    dial = tree.nodes.new("ShaderNodeValue")
    dial.name = dial.label = STRENGTH
    dial.outputs[0].default_value = 1.0
    for background in backgrounds(world):
        into = background.inputs["Strength"]
        times = tree.nodes.new("ShaderNodeMath")
        times.operation, times.label = "MULTIPLY", STRENGTH
        x, y = background.location
        times.location = (x - 180, y - 160)
        dial.location = (x - 360, y - 220)
        if into.is_linked:
            tree.links.new(into.links[0].from_socket, times.inputs[0])
        else:
            times.inputs[0].default_value = into.default_value
        tree.links.new(dial.outputs[0], times.inputs[1])
        tree.links.new(times.outputs[0], into)
    return dial.outputs[0]


def whole(world: bpy.types.World) -> tuple[bpy.types.Node | None, bpy.types.Node | None]:
    """Find the nodes whose strength and turn are the strength and turn of all the world's light.

    Returns the background node whose strength scales all light, and the mapping node whose rotation
    about the vertical turns all light; None for each that does not exist.
    """
    tree = shader_tree(world)
    out = tree.get_output_node("CYCLES") if tree else None
    links = out.inputs["Surface"].links if out else ()
    if tree is None or not links or links[0].is_muted:
        return None, None
    background = links[0].from_node
    if background.bl_idname != "ShaderNodeBackground" or background.mute:
        return None, None
    dial = None if background.inputs["Strength"].is_linked else background
    if kit.has(world):
        return dial, kit.turns(world)
    nodes = [n for n in tree.nodes if not n.mute]
    textures = [n for n in nodes if n.bl_idname == "ShaderNodeTexEnvironment"]
    mappings = [n for n in nodes if n.bl_idname == "ShaderNodeMapping"]
    if len(textures) != 1 or len(mappings) != 1 or len(nodes) != len(tree.nodes):
        return dial, None
    texture, mapping = textures[0], mappings[0]
    into, source = texture.inputs["Vector"].links, mapping.inputs["Vector"].links
    straight = (
        into
        and into[0].from_node == mapping
        and source
        and source[0].from_node.bl_idname == "ShaderNodeTexCoord"
        and source[0].from_socket.name == "Generated"
        and len(mapping.outputs[0].links) == 1
    )
    # No other node may depend on a direction.
    if not straight or not values_only(background, {texture}):
        return dial, None
    if mapping.vector_type != "POINT" or any(
        mapping.inputs[n].is_linked for n in ("Location", "Rotation", "Scale")
    ):
        return dial, None
    scale, place = mapping.inputs["Scale"].default_value, mapping.inputs["Location"].default_value
    rotation = mapping.inputs["Rotation"].default_value
    # Where x and y are scaled differently, a turn of the node is not a turn of the light.
    turns = scale[0] == scale[1] and not any(place) and not any(rotation[:2])
    return dial, mapping if turns else None


def read(world: bpy.types.World) -> tuple[float, float, list[bpy.types.Node]]:
    """Read the strength and the turn of all light of a world, and the sockets that hold them.

    Without such a socket, the strength is 1 and the turn 0.
    """
    background, mapping = whole(world)
    sockets = []
    strength, turn = 1.0, 0.0
    if background:
        sockets.append(background.inputs["Strength"])
        strength = sockets[-1].default_value
    if mapping:
        sockets.append(mapping.inputs["Rotation"])
        turn = sockets[-1].default_value[2] % (2 * math.pi)
    return strength, turn, sockets


@contextmanager
def without_dials(
    scene: bpy.types.Scene, view_layer: str, world: bpy.types.World
) -> Iterator[tuple[bpy.types.World, float, float]]:
    """Copy a world as it is now, with a strength of 1 and a turn of 0 -> (copy, strength, turn).

    The copy stands still (`still`), and is removed at the end.
    """
    with still(scene, view_layer, world) as plain:
        strength, turn, _ = read(plain)
        background, mapping = whole(plain)
        if background:
            background.inputs["Strength"].default_value = 1.0
        if mapping:
            mapping.inputs["Rotation"].default_value[2] = 0.0
        yield plain, strength, turn


@contextmanager
def turned(
    scene: bpy.types.Scene, view_layer: str, world: bpy.types.World, angle: float
) -> Iterator[bpy.types.World]:
    """Copy a world as it is now and turn the copy about the vertical, as the slider would.

    angle: in radians, added to the world's turn. The copy is removed at the end. Raises SceneError
    for a world that cannot be turned.
    """
    with still(scene, view_layer, world, camera=False) as copy:
        if why := why_not_turned(copy):
            raise SceneError(
                f"the world '{world.name}' cannot be turned ({why[0].lower()}{why[1:]}): add one "
                "Mapping node before its texture, or give maps by --worlds"
            )
        turn_to(copy, turn(copy) + angle)
        yield copy
