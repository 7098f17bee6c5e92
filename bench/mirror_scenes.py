"""Scenes in which an artist looks at reflections first: mirrors, glass, panes, coat.

They are compared at the size of a shot, by material, and are no part of the accuracy report, whose
pictures are thumbnails.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import bpy  # first: bmesh is only there once it is

# isort: split
import bmesh
from mathutils import Euler, Matrix, Vector

from . import scenes
from .building import (
    GLASS,
    MATT,
    METAL,
    Look,
    Point,
    Profile,
    add,
    add_camera,
    fresh_scene,
    lathe,
    materials_of,
    sphere,
)

LOOKS: dict[str, dict[str, Look]] = {
    "mirrors": {
        "mirror": {**METAL, "Base Color": (0.95, 0.95, 0.95), "Roughness": 0.0},
        "chrome": {**METAL, "Base Color": (0.9, 0.9, 0.92), "Roughness": 0.02},
        "coat": {
            **{"Base Color": (0.3, 0.01, 0.015), "Metallic": 0.8, "Roughness": 0.4},
            **{"Coat Weight": 1.0, "Coat Roughness": 0.0},
        },
        "glass": {**GLASS, "Base Color": (1.0, 1.0, 1.0)},
        "liquid": {**GLASS, "Base Color": (0.75, 0.08, 0.12), "IOR": 1.34},
        "floor": {"Base Color": (0.16, 0.1, 0.06), "Roughness": 0.06},
    },
    "pane": {
        "pane": {**GLASS, "Base Color": (1.0, 1.0, 1.0)},
        "tinted": {**GLASS, "Base Color": (0.45, 0.8, 0.6)},
        "red": {**GLASS, "Base Color": (0.9, 0.0, 0.0)},
        "frame": {**MATT, "Base Color": (0.5, 0.47, 0.42)},
    },
}
# A goblet, outside and in; what it holds ends a hair inside its wall, as liquids must.
_GOBLET: Profile = (
    *((0.0, 0.0), (0.5, 0.0), (0.52, 0.03), (0.1, 0.1), (0.07, 0.2), (0.07, 0.75), (0.2, 0.85)),
    *((0.5, 1.15), (0.56, 1.5), (0.48, 2.0), (0.45, 2.0), (0.53, 1.5), (0.47, 1.17), (0.18, 0.9)),
    (0.0, 0.86),
)
_WINE: Profile = ((0.0, 0.862), (0.179, 0.902), (0.469, 1.172), (0.515, 1.4), (0.0, 1.4))


def _block(low: Point, high: Point) -> bmesh.types.BMesh:
    mesh = bmesh.new()
    size = Vector(high) - Vector(low)
    middle = (Vector(high) + Vector(low)) / 2
    bmesh.ops.create_cube(mesh, size=1.0, matrix=Matrix.LocRotScale(middle, None, size))
    return mesh


def mirrors(*, width: int = 320, height: int = 240) -> bpy.types.Scene:
    """Build a flat mirror behind a chrome ball, a coated ball and a goblet on a polished floor.
    Replaces whatever is loaded."""
    scene = fresh_scene(width, height)
    materials = materials_of(LOOKS["mirrors"])
    floor = _block((-5.0, -4.0, -0.2), (5.0, 4.0, 0.0))
    add(scene, "floor", floor, materials["floor"], smooth=False)
    glass = _block((-2.6, -0.03, 0.0), (2.6, 0.03, 3.2))
    turn = Euler((math.radians(-6.0), 0.0, math.radians(12.0)))
    add(
        scene, "mirror", glass, materials["mirror"], place=(0.3, 2.2, 0.02), turn=turn, smooth=False
    )
    add(scene, "chrome", sphere(0.95), materials["chrome"], place=(-1.75, 0.0, 0.951))
    add(scene, "coat", sphere(0.8), materials["coat"], place=(1.85, 0.1, 0.801))
    place = (0.1, -0.9, 0.001)
    add(scene, "goblet", lathe(_GOBLET, 48), materials["glass"], levels=1, place=place)
    add(scene, "wine", lathe(_WINE, 48), materials["liquid"], place=place)
    add_camera(scene, place=(0.0, -9.0, 3.0), target=(0.0, 0.2, 1.15), lens=52.0)
    return scene


def pane(*, width: int = 320, height: int = 240) -> bpy.types.Scene:
    """Build three panes in a frame before the world: clear, tinted and pure red. Each is a box with
    two walls. Replaces whatever is loaded."""
    scene = fresh_scene(width, height)
    materials = materials_of(LOOKS["pane"])
    for name, left in (("pane", -2.4), ("tinted", -0.75), ("red", 0.9)):
        glass = _block((left, -0.03, 0.3), (left + 1.5, 0.03, 2.9))
        add(scene, name, glass, materials[name], smooth=False)
    frames: list[tuple[Point, Point]] = [
        ((-2.6, -0.1, 0.1), (2.6, 0.1, 0.28)),
        ((-2.6, -0.1, 2.92), (2.6, 0.1, 3.1)),
        ((-2.6, -0.1, 0.28), (-2.42, 0.1, 2.92)),
        ((-0.88, -0.1, 0.28), (-0.77, 0.1, 2.92)),
        ((0.77, -0.1, 0.28), (0.88, 0.1, 2.92)),
        ((2.42, -0.1, 0.28), (2.6, 0.1, 2.92)),
    ]
    for low, high in frames:
        add(scene, "frame", _block(low, high), materials["frame"], smooth=False)
    add_camera(scene, place=(0.9, -6.4, 1.9), target=(0.0, 0.0, 1.6), lens=40.0)
    return scene


SCENES: dict[str, Callable[..., bpy.types.Scene]] = {"mirrors": mirrors, "pane": pane}


def register() -> None:
    """Have the bench's own ways find these scenes and their materials."""
    scenes.SCENES.update(SCENES)
    for name, looks in LOOKS.items():
        scenes.MATERIALS[name] = {material: i for i, material in enumerate(looks, start=1)}
