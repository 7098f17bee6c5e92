"""The scene in which lights are put: each thing shows the light in another way."""

from __future__ import annotations

import math

import bpy  # first: bmesh is only there once it is

# isort: split
import bmesh
from mathutils import Euler

from .building import GLASS, MATT, METAL, Look, add, add_camera, fresh_scene, materials_of, sphere

LOOKS: dict[str, Look] = {
    "chrome": {**METAL, "Base Color": (0.9, 0.9, 0.9), "Roughness": 0.0},
    "mirror": {**METAL, "Base Color": (0.95, 0.95, 0.95), "Roughness": 0.0},
    "pane": {**GLASS, "Base Color": (1.0, 1.0, 1.0)},
    "coat": {
        **{"Base Color": (0.3, 0.01, 0.015), "Metallic": 0.0, "Roughness": 0.5},
        **{"Coat Weight": 1.0, "Coat Roughness": 0.0, "Specular IOR Level": 0.0},
    },
    "brushed": {**METAL, "Base Color": (0.8, 0.8, 0.82), "Roughness": 0.28},
    "matt": {**MATT, "Base Color": (0.7, 0.6, 0.5)},
    "floor": {**MATT, "Base Color": (0.2, 0.2, 0.2)},
}


def _block(width: float, depth: float, height: float) -> bmesh.types.BMesh:
    mesh = bmesh.new()
    bmesh.ops.create_cube(mesh, size=1.0)
    bmesh.ops.scale(mesh, vec=(width, depth, height), verts=mesh.verts)
    return mesh


def place_shot(*, width: int = 480, height: int = 360) -> bpy.types.Scene:
    """Build a chrome ball, a mirror behind a pane, a coated ball, a brushed cylinder and a matt
    ball on a dark floor. Replaces whatever is loaded."""
    scene = fresh_scene(width, height)
    materials = materials_of(LOOKS)
    add(scene, "floor", _block(12, 9, 0.2), materials["floor"], place=(0, 1, -0.1), smooth=False)
    add(scene, "chrome", sphere(0.75), materials["chrome"], place=(-2.4, 0.0, 0.751))
    add(scene, "coat", sphere(0.75), materials["coat"], place=(-0.75, -0.3, 0.751))
    add(scene, "matt", sphere(0.75), materials["matt"], place=(2.5, 0.1, 0.751))
    drum = bmesh.new()
    bmesh.ops.create_cone(drum, cap_ends=True, segments=128, radius1=0.55, radius2=0.55, depth=1.9)
    add(scene, "brushed", drum, materials["brushed"], place=(0.9, 0.0, 0.951))
    edges = scene.objects["brushed"].data
    for polygon in edges.polygons:
        polygon.use_smooth = abs(polygon.normal.z) < 0.5
    turn = Euler((math.radians(-8.0), 0.0, 0.0))
    place = (0.0, 2.6, 2.55)
    add(scene, "mirror", _block(3.2, 0.06, 1.5), materials["mirror"], place=place, turn=turn,
        smooth=False)  # fmt: skip
    add(scene, "pane", _block(3.6, 0.04, 1.7), materials["pane"], place=(0.0, 1.9, 2.6),
        smooth=False)  # fmt: skip
    add_camera(scene, place=(0.0, -9.5, 2.6), target=(0.0, 0.2, 1.35), lens=48.0)
    return scene
