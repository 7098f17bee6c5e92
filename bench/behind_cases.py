"""What is seen through things, and light below nothing: more ways to change a small scene."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import bmesh
import bpy

from .building import add_aimed, noded
from .field_cases import CASES, case

__all__ = ["CASES"]

RED, GREEN, BLUE = (0.9, 0.25, 0.1), (0.3, 0.85, 0.4), (0.2, 0.4, 0.95)


def _material(name: str, surface: Callable | None, volume: Callable | None = None) -> Any:
    """A new material; surface, volume: make the shader's socket from the nodes' tree."""
    material = noded(bpy.data.materials.new(name))
    tree = material.node_tree
    tree.nodes.clear()
    out = tree.nodes.new("ShaderNodeOutputMaterial")
    for socket, make in (("Surface", surface), ("Volume", volume)):
        if make:
            tree.links.new(make(tree), out.inputs[socket])
    return material


def _shader(tree: Any, kind: str, **values: Any) -> Any:
    """The socket of a new shader node; values: of its inputs, links where they are sockets."""
    node = tree.nodes.new(f"ShaderNode{kind}")
    for name, value in values.items():
        socket = node.inputs[name.replace("_", " ")]
        if isinstance(value, bpy.types.NodeSocket):
            tree.links.new(value, socket)
        else:
            socket.default_value = (*value, 1.0) if socket.type == "RGBA" else value
    return node.outputs[0]


def _clear(colour: tuple) -> Callable:
    return lambda tree: _shader(tree, "BsdfTransparent", Color=colour)


def _mixed(tree: Any, first: Any, second: Any, share: Any = 0.5) -> Any:
    node = tree.nodes.new("ShaderNodeMixShader")
    if isinstance(share, bpy.types.NodeSocket):
        tree.links.new(share, node.inputs[0])
    else:
        node.inputs[0].default_value = share
    tree.links.new(first, node.inputs[1])
    tree.links.new(second, node.inputs[2])
    return node.outputs[0]


def _pane(material: Any, x: float = 0.0, y: float = -4.0, width: float = 4.0) -> Any:
    """A sheet that stands before the spheres, with the world's rim behind it."""
    mesh, low, high = bpy.data.meshes.new("pane"), 0.6, 5.0
    corners = [(x - width / 2, y, low), (x + width / 2, y, low)]
    corners += [(x + width / 2, y, high), (x - width / 2, y, high)]
    mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    mesh.materials.append(material)
    thing = bpy.data.objects.new("pane", mesh)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def _box(material: Any, size: tuple, place: tuple) -> Any:
    mesh, block = bpy.data.meshes.new("box"), bmesh.new()
    bmesh.ops.create_cube(block, size=1.0)
    bmesh.ops.scale(block, vec=size, verts=block.verts)
    block.to_mesh(mesh)
    block.free()
    mesh.materials.append(material)
    thing = bpy.data.objects.new("box", mesh)
    thing.location = place
    bpy.context.scene.collection.objects.link(thing)
    return thing


@case()
def coloured_pane(scene):
    _pane(_material("pane", _clear(RED)))


@case()
def nested_panes(scene):
    for i, colour in enumerate((RED, GREEN, BLUE)):
        pale = tuple(0.5 + 0.5 * c for c in colour)
        _pane(_material(f"pane{i}", _clear(pale)), x=0.8 * i - 0.8, y=-4 - 0.3 * i)


@case()
def window_glass_by_tint(scene):
    """Glass as it is faked for windows: a mirror by Fresnel before what is clear and tinted."""

    def glass(tree):
        clear, mirror = (
            _shader(tree, "BsdfTransparent", Color=GREEN),
            _shader(tree, "BsdfGlossy", Roughness=0.0),
        )
        return _mixed(tree, clear, mirror, _shader(tree, "Fresnel", IOR=1.5))

    _pane(_material("glass", glass))


@case()
def coloured_leaf_cards(scene):
    """Leaves that are diffuse by half, and let green light through."""

    def leaf(tree):
        clear, matt = (
            _shader(tree, "BsdfTransparent", Color=GREEN),
            _shader(tree, "BsdfDiffuse", Color=(0.1, 0.4, 0.1)),
        )
        return _mixed(tree, clear, matt)

    material = _material("leaf", leaf)
    for i in range(4):
        _pane(material, x=0.7 * i - 1, y=-4 - 0.1 * i, width=2)


@case()
def coloured_shadow(scene):
    material = _material("roof", _clear(BLUE))
    roof = _pane(material)
    roof.rotation_euler, roof.location = (math.pi / 2, 0, 0), (0, 0, -1.0)


@case()
def tinted_fog(scene):
    def fog(tree):
        return _shader(
            tree, "VolumePrincipled", Color=RED, Density=0.06, Absorption_Color=(0.3, 0.1, 0.05)
        )

    _box(_material("fog", None, fog), (12, 12, 5), (0, 0, 2.5))


@case()
def camera_in_tinted_fog(scene):
    def fog(tree):
        return _shader(tree, "VolumeScatter", Color=BLUE, Density=0.03)

    _box(_material("fog", None, fog), (40, 40, 20), (0, 0, 9))


@case()
def grey_fog(scene):
    def fog(tree):
        return _shader(tree, "VolumeScatter", Color=(0.8, 0.8, 0.8), Density=0.06)

    _box(_material("fog", None, fog), (12, 12, 5), (0, 0, 2.5))


@case()
def absorbing_slab(scene):
    def smoke(tree):
        return _shader(tree, "VolumeAbsorption", Color=BLUE, Density=0.8)

    _box(_material("slab", None, smoke), (4, 1, 4), (0, -4, 2.8))


@case()
def coloured_glass_with_absorption(scene):
    def glass(tree):
        return _shader(tree, "BsdfGlass", Color=(0.95, 0.8, 0.6), Roughness=0.0, IOR=1.45)

    def inside(tree):
        return _shader(tree, "VolumeAbsorption", Color=RED, Density=0.8)

    _box(_material("glass", glass, inside), (3, 0.8, 3), (0, -4, 2.4))


@case()
def tinted_fog_over_transparent_film(scene):
    scene.render.film_transparent = True
    tinted_fog(scene)


@case()
def coloured_pane_before_a_holdout(scene):
    scene.objects["mirror"].is_holdout = True
    _pane(_material("pane", _clear(RED)))


def _portal(tree: Any, turned: bool = True, colour: tuple = (1, 1, 1)) -> Any:
    """A portal to ten units higher up; turned: which looks aside, too."""
    place = tree.nodes.new("ShaderNodeVectorMath")
    place.inputs[1].default_value = (0, 0, 10)
    geometry = tree.nodes.new("ShaderNodeNewGeometry")
    tree.links.new(geometry.outputs["Position"], place.inputs[0])
    values: dict[str, Any] = {"Position": place.outputs[0], "Color": colour}
    if turned:
        turn = tree.nodes.new("ShaderNodeVectorRotate")
        turn.rotation_type = "Z_AXIS"
        turn.inputs["Angle"].default_value = 2.0
        back = tree.nodes.new("ShaderNodeVectorMath")
        back.operation, back.inputs["Scale"].default_value = "SCALE", -1.0
        tree.links.new(geometry.outputs["Incoming"], back.inputs[0])
        tree.links.new(back.outputs[0], turn.inputs["Vector"])
        values["Direction"] = turn.outputs[0]
    return _shader(tree, "BsdfRayPortal", **values)


@case()
def ray_portal(scene):
    _pane(_material("portal", _portal))


@case()
def ray_portal_straight_on(scene):
    _pane(_material("portal", lambda tree: _portal(tree, turned=False, colour=BLUE)))


@case()
def ray_portal_in_a_pane(scene):
    """A coloured portal behind a coloured pane, half of which is clear."""

    def half(tree):
        return _mixed(tree, _portal(tree, colour=GREEN), _clear((1, 1, 1))(tree))

    pane = _pane(_material("portal", half))
    # what reaches the spheres by a portal Cycles counts otherwise on shadow rays (docs/plates.md)
    pane.visible_diffuse = pane.visible_glossy = pane.visible_shadow = False
    _pane(_material("pane", _clear(RED)), x=1.0, y=-4.5, width=2)


@case()
def ray_portal_over_transparent_film(scene):
    scene.render.film_transparent = True
    ray_portal(scene)


@case()
def negative_lamp(scene):
    for energy, x in ((-25, 3), (200, -3)):
        lamp = bpy.data.lights.new("lamp", "AREA")
        lamp.energy, lamp.size = energy, 1
        add_aimed(scene, lamp, place=(x, -3, 4), target=(0, 0, 0.5))


@case()
def negative_emission(scene):
    """A box that takes light from what is around, and gives less than it is lit by."""

    def dark(tree):
        less = _shader(tree, "Emission", Color=(1, 0.8, 0.5), Strength=-0.05)
        both = tree.nodes.new("ShaderNodeAddShader")
        tree.links.new(less, both.inputs[0])
        tree.links.new(_shader(tree, "BsdfDiffuse", Color=(0.8, 0.8, 0.8)), both.inputs[1])
        return both.outputs[0]

    _box(_material("dark", dark), (1, 1, 1), (0, -3, 0.5))


@case()
def negative_part_of_a_world(scene):
    """A world less a colour, which is below 0 in places."""
    tree = scene.world.node_tree
    lit = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBackground")
    less = _shader(tree, "Background", Color=(0.3, 0.2, 0.1), Strength=-0.3)
    both = tree.nodes.new("ShaderNodeAddShader")
    tree.links.new(lit.outputs[0], both.inputs[0])
    tree.links.new(less, both.inputs[1])
    tree.links.new(both.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
