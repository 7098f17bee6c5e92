"""What scenes are built of: an empty scene to compare renders in, materials, shapes, placing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import bpy  # first: bmesh is only there once it is

# isort: split
import bmesh
from mathutils import Euler, Matrix, Vector

Point = tuple[float, float, float]
Profile = Sequence[tuple[float, float]]  # (radius, height), turned about Z
Look = dict[str, float | Point]  # values of inputs of the Principled BSDF

MATT: Look = {"Roughness": 1.0, "Specular IOR Level": 0.0}
METAL: Look = {"Metallic": 1.0}
GLASS: Look = {"Transmission Weight": 1.0, "Roughness": 0.0, "IOR": 1.5}
JADE: Look = {
    "Subsurface Weight": 1.0,
    "Subsurface Scale": 0.25,
    "Subsurface Radius": (0.5, 1.0, 0.6),
}
# Two points close together keep an edge sharp under subdivision.
PAWN: Profile = (
    *((0.0, 0.0), (0.75, 0.0), (0.8, 0.04), (0.8, 0.2), (0.62, 0.34), (0.56, 0.46), (0.34, 0.75)),
    *((0.25, 1.3), (0.28, 1.4), (0.48, 1.44), (0.48, 1.54), (0.26, 1.6), (0.42, 1.78)),
    *((0.46, 2.02), (0.3, 2.3), (0.0, 2.4)),
)


def fresh_scene(width: int, height: int) -> bpy.types.Scene:
    """An empty scene for Cycles on the CPU, set so that two renders of it can be compared.

    Adaptive sampling is off, so that a number of samples means an amount of work, and the clamp of
    indirect light is off, because a clamped picture is not linear in its light.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y = width, height
    render.resolution_percentage = 100
    render.film_transparent = False
    cycles.device = "CPU"
    cycles.samples = 128
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    cycles.sample_clamp_indirect = 0.0
    return scene


def noded(block: Any) -> Any:
    """A new material or world with its nodes, for which Blender 4.5 has to be asked."""
    if block.node_tree is None:
        block.use_nodes = True
    return block


def materials_of(looks: dict[str, Look]) -> dict[str, bpy.types.Material]:
    """New materials by name, each with its `pass_index`, numbered from 1."""
    materials = {}
    for index, (name, look) in enumerate(looks.items(), start=1):
        material = materials[name] = noded(bpy.data.materials.new(name))
        material.pass_index = index
        inputs = material.node_tree.nodes["Principled BSDF"].inputs
        for key, value in look.items():
            if isinstance(value, tuple) and inputs[key].type == "RGBA":
                inputs[key].default_value = (*value, 1.0)
            else:
                inputs[key].default_value = value
    return materials


def sphere(radius: float) -> bmesh.types.BMesh:
    """A sphere fine enough that its outline looks round and its reflections smooth."""
    mesh = bmesh.new()
    bmesh.ops.create_uvsphere(mesh, u_segments=96, v_segments=48, radius=radius)
    return mesh


def lathe(profile: Profile, segments: int = 24) -> bmesh.types.BMesh:
    """A solid of revolution about Z; the profile starts and ends on the axis."""
    mesh = bmesh.new()
    vertices = [mesh.verts.new((radius, 0.0, height)) for radius, height in profile]
    edges = [mesh.edges.new(pair) for pair in pairwise(vertices)]
    turn = {"cent": (0.0, 0.0, 0.0), "axis": (0.0, 0.0, 1.0), "angle": 2.0 * math.pi}
    bmesh.ops.spin(mesh, geom=vertices + edges, steps=segments, use_merge=True, **turn)
    bmesh.ops.remove_doubles(mesh, verts=mesh.verts[:], dist=1e-5)
    bmesh.ops.recalc_face_normals(mesh, faces=mesh.faces[:])
    return mesh


def add(
    scene: bpy.types.Scene,
    name: str,
    mesh: bmesh.types.BMesh,
    material: bpy.types.Material,
    *,
    place: Point = (0.0, 0.0, 0.0),
    turn: Euler | None = None,
    levels: int = 0,
    smooth: bool = True,
) -> None:
    """Put the mesh into the scene as an object, with `levels` of subdivision; frees the mesh."""
    data = bpy.data.meshes.new(name)
    mesh.to_mesh(data)
    mesh.free()
    data.materials.append(material)
    if smooth:
        data.shade_smooth()
    item = bpy.data.objects.new(name, data)
    item.matrix_world = Matrix.LocRotScale(Vector(place), turn, None)
    item.pass_index = material.pass_index
    if levels:
        subdivision = item.modifiers.new("Subdivision", "SUBSURF")
        subdivision.levels = subdivision.render_levels = levels
    scene.collection.objects.link(item)


def add_aimed(
    scene: bpy.types.Scene, data: bpy.types.ID, *, place: Point, target: Point
) -> bpy.types.Object:
    """Add a camera or a lamp that looks at the target, upright."""
    item = bpy.data.objects.new(data.name, data)
    toward = Vector(target) - Vector(place)
    item.matrix_world = Matrix.LocRotScale(Vector(place), toward.to_track_quat("-Z", "Y"), None)
    scene.collection.objects.link(item)
    return item


def add_camera(scene: bpy.types.Scene, *, place: Point, target: Point, lens: float) -> None:
    """Give the scene its camera; `lens` is the focal length in millimetres on 36 mm of film."""
    data = bpy.data.cameras.new("camera")
    data.lens = lens
    scene.camera = add_aimed(scene, data, place=place, target=target)
