"""Scenes for checks and benchmarks, built from nothing.

A scene that a script builds needs no file in the repository, is the same on every machine, and says
in text what it contains. Here are the four spheres with which Peers and
Dutre verify the method (2002, section 7), where each sphere isolates one kind of light transport,
and a product shot, where the materials that artists use meet in one frame; `hard_scenes` has a room
lit through its window, and fur, fog and wax out of focus.

World up is +Z and the cameras look along +Y: left is -X, right +X, back +Y, front -Y.

Every material has an index in `MATERIALS`; its objects carry it as `pass_index`, so an object index
pass tells errors apart by material. Needs Blender 5, whose new materials and worlds have nodes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import bpy  # first: bmesh is only there once it is

# isort: split
import bmesh
from mathutils import Euler

from . import hard_scenes
from .building import (
    GLASS,
    JADE,
    MATT,
    METAL,
    PAWN,
    Look,
    Profile,
    add,
    add_aimed,
    add_camera,
    fresh_scene,
    lathe,
    materials_of,
    sphere,
)

_BRUSHED: Look = {"Metallic": 1.0, "Roughness": 0.3, "Anisotropic": 0.8}
_COATED: Look = {"Metallic": 0.7, "Roughness": 0.35, "Coat Weight": 1.0, "Coat Roughness": 0.02}

_LOOKS: dict[str, dict[str, Look]] = {
    "four_spheres": {
        "diffuse": {**MATT, "Base Color": (0.62, 0.13, 0.07)},
        "glossy": {**METAL, "Base Color": (0.94, 0.66, 0.3), "Roughness": 0.25},
        "mirror": {**METAL, "Base Color": (0.95, 0.95, 0.95), "Roughness": 0.0},
        "glass": {**GLASS, "Base Color": (1.0, 1.0, 1.0)},
        "floor": {**MATT, "Base Color": (0.55, 0.55, 0.55)},
    },
    "product": {
        "car_paint": {**_COATED, "Base Color": (0.36, 0.006, 0.012)},
        "brushed_metal": {**_BRUSHED, "Base Color": (0.6, 0.55, 0.5)},
        "glass": {**GLASS, "Base Color": (0.85, 0.96, 0.92)},
        "texture": {"Roughness": 0.35},
        "subsurface": {**JADE, "Base Color": (0.13, 0.4, 0.25), "Roughness": 0.25},
        "backdrop": {"Base Color": (0.42, 0.42, 0.45), "Roughness": 0.7},
    },
}

MATERIALS: dict[str, dict[str, int]] = {
    scene: {name: index for index, name in enumerate(looks, start=1)}
    for scene, looks in {**_LOOKS, **hard_scenes.LOOKS}.items()
}

# Two points close together keep an edge sharp under subdivision.
_PLINTH: Profile = (
    *((0.0, 0.0), (1.2, 0.0), (1.25, 0.02), (1.25, 0.8), (1.22, 0.85)),
    *((1.15, 0.86), (0.3, 0.86), (0.0, 0.86)),
)
_BOTTLE: Profile = (
    *((0.0, 0.0), (0.6, 0.0), (0.7, 0.08), (0.72, 0.9), (0.6, 1.35), (0.24, 1.65), (0.2, 2.2)),
    *((0.3, 2.27), (0.29, 2.4), (0.15, 2.4), (0.12, 2.2), (0.14, 1.65), (0.5, 1.3), (0.6, 0.9)),
    *((0.58, 0.25), (0.5, 0.18), (0.0, 0.18)),
)


def four_spheres(*, width: int = 320, height: int = 240) -> bpy.types.Scene:
    """Build the verification scene: four spheres of different materials on a diffuse disc.

    The disc ends inside the frame, so that the environment is also seen directly, past its rim.
    Source: Peers and Dutre 2002, section 7. Replaces whatever is loaded.
    """
    scene = fresh_scene(width, height)
    materials = materials_of(_LOOKS["four_spheres"])
    places = {
        "diffuse": (-2.1, -0.35, 1.0),
        "mirror": (-0.35, 2.1, 1.0),
        "glass": (0.35, -2.1, 1.0),
        "glossy": (2.1, 0.35, 1.0),
    }
    for name, place in places.items():
        add(scene, name, sphere(1.0), materials[name], place=place)
    disc = bmesh.new()
    bmesh.ops.create_circle(disc, cap_ends=True, segments=128, radius=4.0)
    add(scene, "floor", disc, materials["floor"])
    add_camera(scene, place=(0.0, -9.8, 5.8), target=(0.0, -0.25, 0.3), lens=46.5)
    return scene


def product_shot(*, width: int = 320, height: int = 240, lamps: bool = False) -> bpy.types.Scene:
    """Build a product shot: five objects of five materials on a cyclorama.

    The backdrop hides the environment from the camera, as in a photo studio: every pixel is light
    that went by way of a surface. `lamps` adds one area lamp, for scenes whose own light has to be
    kept apart from the environment's. Replaces whatever is loaded.
    """
    scene = fresh_scene(width, height)
    materials = materials_of(_LOOKS["product"])
    _brush(materials["brushed_metal"])
    _paint_checker(materials["texture"])
    add(scene, "backdrop", _cyclorama(), materials["backdrop"], levels=1)
    plinth, monkey = lathe(_PLINTH), bmesh.new()
    add(scene, "plinth", plinth, materials["brushed_metal"], levels=2, place=(0.0, 0.3, 0.0))
    bmesh.ops.create_monkey(monkey)
    turn = Euler((math.radians(-30.0), 0.0, math.radians(18.0)))
    at_rest = (0.0, 0.3, 1.448)  # chin and nape touch the plinth
    add(scene, "monkey", monkey, materials["car_paint"], levels=2, place=at_rest, turn=turn)
    # Glass that shares a plane with the floor would render as noise: hence the millimetre.
    bottle, pawn = lathe(_BOTTLE), lathe(PAWN)
    add(scene, "bottle", bottle, materials["glass"], levels=2, place=(-2.25, 0.2, 0.001))
    add(scene, "pawn", pawn, materials["subsurface"], levels=2, place=(2.1, 0.1, 0.0))
    add(scene, "ball", sphere(0.55), materials["texture"], place=(-0.95, -1.5, 0.55))
    if lamps:
        softbox = bpy.data.lights.new("softbox", "AREA")
        softbox.energy, softbox.size = 600.0, 2.0
        add_aimed(scene, softbox, place=(-4.0, -4.0, 5.0), target=(0.0, 0.0, 1.0))
    add_camera(scene, place=(0.0, -10.5, 3.0), target=(0.0, 0.0, 1.22), lens=60.0)
    return scene


SCENES: dict[str, Callable[..., bpy.types.Scene]] = {
    "four_spheres": four_spheres,
    "product": product_shot,
    "window": hard_scenes.window,
    "soft": hard_scenes.soft,
}


def _brush(material: bpy.types.Material) -> None:
    """Brush the metal as on a lathe: the grooves run around Z, the highlights across them."""
    nodes, links = material.node_tree.nodes, material.node_tree.links
    tangent = nodes.new("ShaderNodeTangent")
    tangent.direction_type, tangent.axis = "RADIAL", "Z"
    links.new(tangent.outputs["Tangent"], nodes["Principled BSDF"].inputs["Tangent"])


def _paint_checker(material: bpy.types.Material) -> None:
    """Paint a checker that noise bends, so that the texture has both edges and curves."""
    nodes, links = material.node_tree.nodes, material.node_tree.links
    position = nodes.new("ShaderNodeTexCoord").outputs["Object"]
    noise = nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = 2.5
    bend = nodes.new("ShaderNodeVectorMath")
    bend.operation = "MULTIPLY_ADD"
    bend.inputs[1].default_value = (0.35, 0.35, 0.35)
    checker = nodes.new("ShaderNodeTexChecker")
    checker.inputs["Scale"].default_value = 5.0
    checker.inputs["Color1"].default_value = (0.03, 0.12, 0.35, 1.0)
    checker.inputs["Color2"].default_value = (0.85, 0.8, 0.68, 1.0)
    links.new(position, noise.inputs["Vector"])
    links.new(noise.outputs["Color"], bend.inputs[0])
    links.new(position, bend.inputs[2])
    links.new(bend.outputs["Vector"], checker.inputs["Vector"])
    links.new(checker.outputs["Color"], nodes["Principled BSDF"].inputs["Base Color"])


def _cyclorama() -> bmesh.types.BMesh:
    """A floor that sweeps up into a wall, wide and deep enough to fill the frame."""
    half_width, front, bend, radius, top = 9.0, -8.0, 3.0, 2.5, 8.0
    arc = [math.radians(angle) for angle in range(0, 91, 6)]
    curve = [(bend + radius * math.sin(a), radius * (1.0 - math.cos(a))) for a in arc]
    mesh = bmesh.new()
    rows = [
        [mesh.verts.new((x, y, z)) for x in (-half_width, half_width)]
        for y, z in [(front, 0.0), *curve, (bend + radius, top)]
    ]
    for near, far in pairwise(rows):
        mesh.faces.new((*near, *reversed(far)))  # faces up, and toward the camera
    return mesh
