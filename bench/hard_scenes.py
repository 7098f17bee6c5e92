"""Scenes that are hard to light by anything but a long render.

`window`: a closed room that gets its light through one window, by way of many walls. `soft`: fur,
a cloud of fog and a wax figure before a lens with little depth of field.
"""

from __future__ import annotations

import bpy  # first: bmesh is only there once it is

# isort: split
import bmesh
import numpy as np
from mathutils import Matrix, Vector

from .building import (
    GLASS,
    JADE,
    METAL,
    PAWN,
    Look,
    Point,
    add,
    add_camera,
    fresh_scene,
    lathe,
    materials_of,
    noded,
    sphere,
)

LOOKS: dict[str, dict[str, Look]] = {
    "window": {
        "plaster": {"Base Color": (0.78, 0.75, 0.7), "Roughness": 0.9},
        "parquet": {"Base Color": (0.3, 0.16, 0.08), "Roughness": 0.25},
        "chrome": {**METAL, "Base Color": (0.9, 0.9, 0.92), "Roughness": 0.05},
        "cloth": {"Base Color": (0.1, 0.22, 0.42), "Roughness": 0.95},
        "glass": {**GLASS, "Base Color": (0.95, 0.98, 1.0)},
    },
    "soft": {
        "fur": {"Base Color": (0.45, 0.24, 0.1)},
        "wax": {**JADE, "Base Color": (0.75, 0.55, 0.35), "Roughness": 0.3},
        "beads": {**METAL, "Base Color": (0.95, 0.8, 0.45), "Roughness": 0.08},
        "ground": {"Base Color": (0.35, 0.37, 0.4), "Roughness": 0.6},
    },
}


def _block(low: Point, high: Point) -> bmesh.types.BMesh:
    """A box between two corners."""
    mesh = bmesh.new()
    size = Vector(high) - Vector(low)
    middle = (Vector(high) + Vector(low)) / 2
    bmesh.ops.create_cube(mesh, size=1.0, matrix=Matrix.LocRotScale(middle, None, size))
    return mesh


def window(*, width: int = 320, height: int = 240) -> bpy.types.Scene:
    """Build a room, 6 m by 7 m, with one window in its right wall. Replaces whatever is loaded."""
    scene = fresh_scene(width, height)
    materials = materials_of(LOOKS["window"])
    blocks: list[tuple[str, Point, Point]] = [
        ("parquet", (-3.2, -3.7, -0.2), (3.2, 3.7, 0.0)),
        ("plaster", (-3.2, -3.7, 2.8), (3.2, 3.7, 3.0)),
        ("plaster", (-3.2, -3.7, 0.0), (-3.0, 3.7, 2.8)),
        ("plaster", (-3.0, 3.5, 0.0), (3.0, 3.7, 2.8)),
        ("plaster", (-3.0, -3.7, 0.0), (3.0, -3.5, 2.8)),
        # the right wall around its window
        ("plaster", (3.0, -3.7, 0.0), (3.2, -0.6, 2.8)),
        ("plaster", (3.0, 1.8, 0.0), (3.2, 3.7, 2.8)),
        ("plaster", (3.0, -0.6, 0.0), (3.2, 1.8, 0.7)),
        ("plaster", (3.0, -0.6, 2.4), (3.2, 1.8, 2.8)),
        # its cross
        ("plaster", (3.05, 0.56, 0.7), (3.15, 0.64, 2.4)),
        ("plaster", (3.05, -0.6, 1.52), (3.15, 1.8, 1.58)),
        # a sofa along the left wall, a table
        ("cloth", (-2.9, 0.2, 0.0), (-2.0, 2.6, 0.42)),
        ("cloth", (-2.98, 0.2, 0.42), (-2.7, 2.6, 0.95)),
        ("plaster", (-0.5, 0.7, 0.68), (1.1, 1.7, 0.74)),
        ("plaster", (-0.4, 0.8, 0.001), (-0.32, 0.88, 0.68)),
        ("plaster", (0.92, 0.8, 0.001), (1.0, 0.88, 0.68)),
        ("plaster", (-0.4, 1.52, 0.001), (-0.32, 1.6, 0.68)),
        ("plaster", (0.92, 1.52, 0.001), (1.0, 1.6, 0.68)),
    ]
    for i, (name, low, high) in enumerate(blocks):
        add(scene, f"{name} {i}", _block(low, high), materials[name], smooth=False)
    add(scene, "ball", sphere(0.24), materials["chrome"], place=(0.0, 1.15, 0.981))
    add(scene, "orb", sphere(0.2), materials["glass"], place=(0.62, 1.1, 0.941))
    add(scene, "pouf", sphere(0.42), materials["cloth"], place=(-1.2, -0.5, 0.421))
    add_camera(scene, place=(0.9, -3.2, 1.5), target=(-0.35, 1.6, 0.95), lens=24.0)
    return scene


def soft(*, width: int = 320, height: int = 240) -> bpy.types.Scene:
    """Build a furry ball, a wax pawn, metal beads and a cloud, out of focus before and behind.

    Replaces whatever is loaded.
    """
    scene = fresh_scene(width, height)
    materials = materials_of(LOOKS["soft"])
    floor = bmesh.new()
    bmesh.ops.create_grid(floor, x_segments=1, y_segments=1, size=12.0)
    add(scene, "ground", floor, materials["ground"])
    add(scene, "skin", sphere(0.8), materials["fur"], place=(-0.7, 0.0, 1.05))
    _fur(scene, materials["fur"], centre=(-0.7, 0.0, 1.05), radius=0.8, strands=9000)
    add(scene, "pawn", lathe(PAWN), materials["wax"], levels=2, place=(1.2, 0.6, 0.0))
    for i, y in enumerate((-3.0, -2.0, -1.0, 1.5, 3.0, 5.0)):
        place = (-2.4 + 0.75 * i + 0.1 * y, y, 0.3)
        add(scene, f"bead {i}", sphere(0.3), materials["beads"], place=place)
    _cloud(scene, centre=(2.9, 1.6, 1.3), radius=1.1)
    add_camera(scene, place=(0.2, -7.5, 2.2), target=(0.2, 0.0, 0.95), lens=50.0)
    focus = scene.camera.data.dof
    focus.use_dof, focus.focus_distance, focus.aperture_fstop = True, 7.4, 0.35
    return scene


def _fur(
    scene: bpy.types.Scene,
    material: bpy.types.Material,
    *,
    centre: Point,
    radius: float,
    strands: int,
) -> None:
    """Cover a ball with hairs that bend down; the hair of a seed is the same everywhere."""
    tree = material.node_tree
    hair = tree.nodes.new("ShaderNodeBsdfHairPrincipled")
    hair.parametrization = "COLOR"
    hair.inputs["Color"].default_value = (0.45, 0.24, 0.1, 1.0)
    hair.inputs["Roughness"].default_value = 0.35
    info, mix = tree.nodes.new("ShaderNodeHairInfo"), tree.nodes.new("ShaderNodeMixShader")
    tree.links.new(info.outputs["Is Strand"], mix.inputs["Fac"])
    tree.links.new(tree.nodes["Principled BSDF"].outputs[0], mix.inputs[1])
    tree.links.new(hair.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
    points = 6
    rng = np.random.default_rng(1)
    root = rng.normal(size=(strands, 3))
    root /= np.linalg.norm(root, axis=1, keepdims=True)
    length = rng.uniform(0.18, 0.32, (strands, 1, 1))
    lean = rng.normal(scale=0.25, size=(strands, 1, 3))
    t = np.linspace(0, 1, points)[None, :, None]
    way = root[:, None] + lean * t + np.array((0, 0, -0.6)) * t * t
    path = np.array(centre) + radius * root[:, None] + way * length * t
    curves = bpy.data.hair_curves.new("fur")
    curves.add_curves([points] * strands)
    curves.attributes["position"].data.foreach_set("vector", path.astype(np.float32).ravel())
    thickness = np.broadcast_to(0.006 * (1 - 0.8 * t), (strands, points, 1))
    width = curves.attributes.get("radius") or curves.attributes.new("radius", "FLOAT", "POINT")
    width.data.foreach_set("value", thickness.astype(np.float32).ravel())
    curves.materials.append(material)
    item = bpy.data.objects.new("fur", curves)
    item.pass_index = material.pass_index
    scene.collection.objects.link(item)


def _cloud(scene: bpy.types.Scene, *, centre: Point, radius: float) -> None:
    """A ball of even fog."""
    material = noded(bpy.data.materials.new("cloud"))
    tree = material.node_tree
    tree.nodes.clear()
    fog = tree.nodes.new("ShaderNodeVolumePrincipled")
    fog.inputs["Density"].default_value = 1.6
    fog.inputs["Anisotropy"].default_value = 0.3
    out = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(fog.outputs[0], out.inputs["Volume"])
    add(scene, "cloud", sphere(radius), material, place=centre)
