"""The kit of a world: its nodes made and read.

This is the door for all that works with the kit:

    if has(world): ...                      whether a world has a kit
    kit = read(world)                       its values now, as `core.kit.model.Kit`
    write(world, kit.with_light(light))     the nodes say what a kit says; what is equal stays
    put_in(world)                           a kit over what the world shows now
    node_of(world, "Key")                   the group node, whose inputs are the light's values

`write` changes nodes in place and touches only values that differ. So keys, drivers and the place
of nodes stay, and Blender's undo takes the change back.

The nodes: a direction, turned by the kit, goes to the base and to each light. The lights are a
chain from the base to one Background, by their input *Under*. Where the camera sees a backdrop of
its own, a Mix by *Is Camera Ray* stands after the chain. A tint multiplies all of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import bpy

from ...core.errors import KitError
from ...core.kit.light import Kind, Light
from ...core.kit.model import Kit
from ..blender.nodes import shader_tree, world_of_nodes
from ..blender.reached import Around, value_of
from . import base as of_base
from . import groups
from .base import DIRECTION, TURN, number, place_node, put

OUT, CAMERA, RAYS = "ARTO Kit", "ARTO Kit Camera", "ARTO Kit Rays"
# The node whose colour multiplies all light is that of the slider *Tint* (`world.controls`).
TINTED, TINT = "ARTO Kit Tinted", "ARTO Tint"
# The node that the slider *Strength* adds to worlds without a strength of their own.
STRENGTH = "ARTO Strength"
_OWN = {DIRECTION, TURN, TINTED, TINT, OUT, CAMERA, RAYS}
# What a light's node says beside its values.
ON, SOLO, LOCK = "arto_on", "arto_solo", "arto_lock"


def has(world: bpy.types.World | None) -> bool:
    """Whether a world has a kit whose light reaches its output."""
    return world is not None and out_of(world) is not None


def out_of(world: bpy.types.World) -> bpy.types.Node | None:
    """The Background node of a world's kit; None without a kit."""
    tree = shader_tree(world)
    if tree is None or TINTED not in tree.nodes:
        return None
    node = tree.nodes.get(OUT)
    return node if node and node.bl_idname == "ShaderNodeBackground" else None


def _camera(tree: bpy.types.NodeTree) -> bpy.types.Node | None:
    node = tree.nodes.get(CAMERA)
    return node if node and node.outputs[2].is_linked else None


def _front(tree: bpy.types.NodeTree) -> bpy.types.NodeSocket:
    """The input that the light of the whole kit goes into."""
    camera = _camera(tree)
    return camera.inputs[6] if camera else tree.nodes[TINTED].inputs[0]


def is_light(node: bpy.types.Node) -> bool:
    """Whether a node is a light of the kit."""
    return node.bl_idname == "ShaderNodeGroup" and groups.what(node.node_tree) is not None


def nodes_of(world: bpy.types.World) -> list[bpy.types.Node]:
    """The group nodes of a kit's lights, from the back to the front."""
    return [node for node in reversed(list(_chain(world))) if is_light(node)]


def _chain(world: bpy.types.World) -> Iterator[bpy.types.Node]:
    """The nodes from the front of the kit to its base: its lights, as far as they follow."""
    tree = shader_tree(world)
    socket = _front(tree) if tree and out_of(world) else None
    seen: set[int] = set()
    while socket is not None and socket.is_linked:
        node = socket.links[0].from_node
        if not is_light(node) or node.as_pointer() in seen:
            return
        seen.add(node.as_pointer())
        yield node
        socket = node.inputs["Under"]


def node_of(world: bpy.types.World, name: str) -> bpy.types.Node:
    """The group node of a light. Raises KitError where the kit has no such light."""
    found = next((node for node in nodes_of(world) if node.label == name), None)
    if found is None:
        raise KitError(f"the world '{world.name}' has no light '{name}'")
    return found


def why_not(world: bpy.types.World) -> str:
    """Say why a world's kit cannot be changed, or none put in; empty where it can."""
    if world.library or world.override_library:
        return "The world is linked from a library: make it local to change it"
    return "" if has(world) else of_base.why_no_base(world)


def _checked(world: bpy.types.World) -> None:
    if why := why_not(world):
        raise KitError(f"{why} ('{world.name}')")


def read(world: bpy.types.World) -> Kit:
    """Read the kit of a world, its values as they are now.

    Raises KitError where the world has no kit, or where other nodes work out a light's value.
    """
    out = out_of(world)
    if out is None:
        raise KitError(f"the world '{world.name}' has no light kit: add a light (panel Light)")
    tree = world.node_tree
    chain = nodes_of(world)
    apart = [n for n in tree.nodes if is_light(n) and n not in chain and n.outputs[0].is_linked]
    if apart:
        raise KitError(
            f"other nodes stand among the lights of '{world.name}' (after "
            f"'{apart[0].label}'): lead the lights straight from one to the next, by their input "
            f"Under, up to '{CAMERA if _camera(tree) else TINTED}'"
        )
    turn = tree.nodes.get(TURN)
    tint = tree.nodes[TINTED].inputs[1]
    backdrop = of_base.read(tree, of_base.BACKDROP) if _camera(tree) else None
    return Kit(
        tuple(light_of(node) for node in chain),
        of_base.read(tree, of_base.BASE),
        backdrop,
        of_base.degrees(turn.inputs["Rotation"].default_value[2]) if turn else 0.0,
        max(number(out.inputs["Strength"]), 0.0),
        of_base.colour(tint),
    )


def light_of(node: bpy.types.Node) -> Light:
    """Read a light of its group node. Raises KitError where other nodes work out a value."""
    found = groups.what(node.node_tree)
    if found is None:
        raise KitError(f"the node '{node.name}' is no light of the kit")
    kind, blend = found
    values: dict[str, object] = {}
    for one in groups.INPUTS:
        if not one.value:
            continue
        socket = node.inputs[one.name]
        if one.kind == "NodeSocketColor":
            values[one.value] = of_base.colour(socket)
            continue
        value = number(socket)
        value = of_base.degrees(value) if one.subtype == "ANGLE" else value
        low, high = groups.BOUNDS[one.value]
        # A key or a driver may lead a value anywhere; single precision goes a hair over a bound.
        values[one.value] = min(max(value, low), high)
    image = ""
    if kind is Kind.PICTURE:
        image = of_base.text_of(groups.picture_node(node.node_tree).image)
    alone = bool(node.get(SOLO, False))
    on = bool(node.get(ON, True)) if node.mute and not alone and _any_solo(node) else not node.mute
    lock = bool(node.get(LOCK, False))
    return Light(node.label, kind, blend, on=on, solo=alone, lock=lock, image=image, **values)  # type: ignore[arg-type]


def _any_solo(node: bpy.types.Node) -> bool:
    return any(is_light(other) and other.get(SOLO, False) for other in node.id_data.nodes)


def put_in(world: bpy.types.World) -> Kit:
    """Put a kit into a world, over what it shows now; a world that has one keeps it.

    Raises KitError for a world that is linked, or whose shaders cannot be a base.
    """
    _checked(world)
    if has(world):
        return read(world)
    tree = world_of_nodes(world)
    source = of_base.taken(world)
    out = tree.nodes.new("ShaderNodeBackground")
    out.name = out.label = OUT
    end = tree.get_output_node("CYCLES") or tree.nodes.new("ShaderNodeOutputWorld")
    out.location = end.location[0] - 220, end.location[1]
    tree.links.new(out.outputs[0], end.inputs["Surface"])
    turn = of_base.direction(tree)
    turn.location = out.location[0] - 900, out.location[1] - 300
    for dial in (TINT, STRENGTH):  # they go on changing what is the base now
        if dial in tree.nodes:
            tree.nodes[dial].name = dial.replace("ARTO", "ARTO Former")
    tint = tree.nodes.new("ShaderNodeRGB")
    tint.name = tint.label = TINT
    tint.outputs[0].default_value = (1.0, 1.0, 1.0, 1.0)
    tinted = tree.nodes.new("ShaderNodeVectorMath")
    tinted.name = tinted.label = TINTED
    tinted.operation = "MULTIPLY"
    place_node(tinted, (out.location[0] - 180, out.location[1]))
    place_node(tint, (out.location[0] - 180, out.location[1] - 180))
    tinted.inputs[0].default_value = (0.0, 0.0, 0.0)
    tree.links.new(tint.outputs[0], tinted.inputs[1])
    tree.links.new(tinted.outputs[0], out.inputs["Color"])
    if source is not None:
        tree.links.new(source, tinted.inputs[0])
    return read(world)


def write(world: bpy.types.World, kit: Kit) -> None:
    """Make the nodes of a world say what a kit says. A world without a kit gets one.

    Lights are known by their names. Raises KitError for a world that is linked or whose shaders
    cannot be a base, and where an image cannot be found.
    """
    _checked(world)
    # What may fail comes first, so that a kit is written whole or not at all.
    images = {one.name: of_base.image_of(one.image) for one in kit.lights if one.image}
    of_base.check(kit.base)
    if kit.backdrop is not None:
        of_base.check(kit.backdrop)
    put_in(world)
    tree = world.node_tree
    out = tree.nodes[OUT]
    put(out.inputs["Strength"], kit.strength)
    dial = tree.nodes.get(TINT)
    for i in range(3 if dial else 0):
        put(dial.outputs[0], kit.tint[i], i)
    turn = of_base.direction(tree)
    put(turn.inputs["Rotation"], math.radians(kit.turn), 2)
    there = {node.label: node for node in nodes_of(world)}
    source = _base_source(world)
    source = of_base.write(tree, of_base.BASE, kit.base, turn, source)
    lit = {light.name for light in kit.lit}
    alone = any(light.solo and light.on for light in kit.lights)
    x, y = out.location
    for i, light in enumerate(kit.lights):
        node = there.pop(light.name, None)
        if node is None:
            node = tree.nodes.new("ShaderNodeGroup")
            node.width = 180
            place_node(node, (x - 240 * (len(kit.lights) - i) - 460, y))
        _write_light(node, light, images.get(light.name))
        node.mute = not light.on or (alone and light.name not in lit and not light.solo)
        _link(turn.outputs[0], node.inputs["Direction"])
        _link(source, node.inputs["Under"])
        source = node.outputs[0]
    for node in there.values():
        _remove(tree, node)
    _backdrop(tree, kit, turn, source)


def _base_source(world: bpy.types.World) -> bpy.types.NodeSocket | None:
    """What the base gives now."""
    nodes = nodes_of(world)
    socket = nodes[0].inputs["Under"] if nodes else _front(world.node_tree)
    return socket.links[0].from_socket if socket.is_linked else None


def _write_light(node: bpy.types.Node, light: Light, image: bpy.types.Image | None) -> None:
    if groups.what(node.node_tree) != (light.kind, light.blend):
        before = node.node_tree
        node.node_tree = groups.light_group(light.kind, light.blend)
        _let_go(before)
    if node.label != light.name:
        node.label = light.name
    set_light(node, light)
    for name, value in ((ON, light.on), (SOLO, light.solo), (LOCK, light.lock)):
        if bool(node.get(name, name == ON)) != value:
            node[name] = value
    if light.kind is Kind.PICTURE and groups.picture_node(node.node_tree).image != image:
        if node.node_tree.users > 1:  # a copy of the world has it too
            node.node_tree = groups.light_group(light.kind, light.blend)
        groups.picture_node(node.node_tree).image = image


def set_light(node: bpy.types.Node, light: Light) -> None:
    """Set the inputs of a light's group node."""
    for one in groups.INPUTS:
        if not one.value:
            continue
        value = getattr(light, one.value)
        socket = node.inputs[one.name]
        if one.kind == "NodeSocketColor":
            for i in range(3):
                put(socket, value[i], i)
        else:
            put(socket, math.radians(value) if one.subtype == "ANGLE" else value)


def _backdrop(
    tree: bpy.types.NodeTree,
    kit: Kit,
    turn: bpy.types.Node,
    source: bpy.types.NodeSocket | None,
) -> None:
    """Lead the light to the Background, past a backdrop where the kit has one."""
    out, camera = tree.nodes[TINTED], _camera(tree)
    if kit.backdrop is None:
        of_base.remove(tree, of_base.BACKDROP)
        for name in (CAMERA, RAYS):
            if name in tree.nodes:
                tree.nodes.remove(tree.nodes[name])
        _link(source, out.inputs[0])
        return
    if camera is None:
        camera = tree.nodes.new("ShaderNodeMix")
        camera.name = camera.label = CAMERA
        camera.data_type = "RGBA"
        rays = tree.nodes.new("ShaderNodeLightPath")
        rays.name = rays.label = RAYS
        place_node(camera, (out.location[0] - 190, out.location[1] - 240))
        place_node(rays, (out.location[0] - 390, out.location[1] - 400))
        tree.links.new(rays.outputs["Is Camera Ray"], camera.inputs[0])
        tree.links.new(camera.outputs[2], out.inputs[0])
    was = camera.inputs[7]
    seen = was.links[0].from_socket if was.is_linked else None
    seen = of_base.write(tree, of_base.BACKDROP, kit.backdrop, turn, seen)
    _link(source, camera.inputs[6])
    _link(seen, was)


def _link(source: bpy.types.NodeSocket | None, to: bpy.types.NodeSocket) -> None:
    """Link an input to what it gets; to nothing, with black as its value, for None."""
    tree = to.id_data
    if source is None:
        for link in list(to.links):
            tree.links.remove(link)
        for i in range(3):
            put(to, 0.0, i)
    elif not to.is_linked or to.links[0].from_socket != source:
        tree.links.new(source, to)


def _remove(tree: bpy.types.NodeTree, node: bpy.types.Node) -> None:
    group = node.node_tree
    tree.nodes.remove(node)
    _let_go(group)


def _let_go(group: bpy.types.NodeTree | None) -> None:
    """Remove a group of ours that nothing uses any more."""
    if group and not group.users and not group.library and groups.what(group):
        bpy.data.node_groups.remove(group)


def is_whole(world: bpy.types.World) -> bool:
    """Whether all light of a world is its kit's: no other node changes it, none is its base."""
    tree = shader_tree(world)
    out = out_of(world)
    if tree is None or out is None or out.mute or value_of(out.inputs["Strength"]) is None:
        return False
    end = tree.get_output_node("CYCLES")
    links = end.inputs["Surface"].links if end else ()
    if not links or links[0].is_muted or links[0].from_node != out:
        return False
    into, tinted = out.inputs["Color"], tree.nodes[TINTED]
    if not into.is_linked or into.links[0].from_node != tinted:
        return False
    last = tinted.inputs[0]
    if last.is_linked and last.links[0].from_node.name == CAMERA:
        camera = last.links[0].from_node
        if camera != _camera(tree) or not of_base.owns(tree, of_base.BACKDROP, camera.inputs[7]):
            return False
    nodes = nodes_of(world)
    return of_base.owns(tree, of_base.BASE, nodes[0].inputs["Under"] if nodes else _front(tree))


def owns(node: bpy.types.Node, around: Around) -> bool:
    """Whether a node is one of a kit's own, or stands in a group of a kit.

    around: the group nodes around the node. The artist's nodes behind a kit are none of its own.
    """
    if any(of_base.is_group(group.node_tree) for group in around):
        return True
    return not around and (node.name in _OWN or of_base.is_part(node))


def turns(world: bpy.types.World) -> bpy.types.Node | None:
    """The mapping node that turns all light of a world; None where it is not all the kit's."""
    if not is_whole(world):
        return None
    node = world.node_tree.nodes.get(TURN)
    if node is None or any(s.is_linked for s in node.inputs if s.name != "Vector"):
        return None
    place, rotation, scale = (
        node.inputs[name].default_value for name in ("Location", "Rotation", "Scale")
    )
    plain = not any(place) and not any(rotation[:2]) and all(s == 1 for s in scale)
    return node if plain and node.vector_type == "POINT" and not node.mute else None
