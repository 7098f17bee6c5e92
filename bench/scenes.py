"""Scenes for checks and benchmarks, built from nothing, and the worlds that light them.

A scene that a script builds needs no file in the repository, is the same on every machine, and says
in text what it contains. There are two: the four spheres with which Peers and
Dutre verify the method (2002, section 7), where each sphere isolates one kind of light transport,
and a product shot, where the materials that artists use meet in one frame.

World up is +Z and the cameras look along +Y: left is -X, right +X, back +Y, front -Y.

Every material has an index in `MATERIALS`; its objects carry it as `pass_index`, so an object index
pass tells errors apart by material. Needs Blender 5, whose new materials and worlds have nodes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import bpy  # first: bmesh is only there once it is

# isort: split
import bmesh
import numpy as np
from mathutils import Euler, Matrix, Vector

Point = tuple[float, float, float]
Profile = Sequence[tuple[float, float]]  # (radius, height), turned about Z
Look = dict[str, float | Point]  # values of inputs of the Principled BSDF

_MATT: Look = {"Roughness": 1.0, "Specular IOR Level": 0.0}
_METAL: Look = {"Metallic": 1.0}
_BRUSHED: Look = {"Metallic": 1.0, "Roughness": 0.3, "Anisotropic": 0.8}
_COATED: Look = {"Metallic": 0.7, "Roughness": 0.35, "Coat Weight": 1.0, "Coat Roughness": 0.02}
_GLASS: Look = {"Transmission Weight": 1.0, "Roughness": 0.0, "IOR": 1.5}
_JADE: Look = {
    "Subsurface Weight": 1.0,
    "Subsurface Scale": 0.25,
    "Subsurface Radius": (0.5, 1.0, 0.6),
}

_LOOKS: dict[str, dict[str, Look]] = {
    "four_spheres": {
        "diffuse": {**_MATT, "Base Color": (0.62, 0.13, 0.07)},
        "glossy": {**_METAL, "Base Color": (0.94, 0.66, 0.3), "Roughness": 0.25},
        "mirror": {**_METAL, "Base Color": (0.95, 0.95, 0.95), "Roughness": 0.0},
        "glass": {**_GLASS, "Base Color": (1.0, 1.0, 1.0)},
        "floor": {**_MATT, "Base Color": (0.55, 0.55, 0.55)},
    },
    "product": {
        "car_paint": {**_COATED, "Base Color": (0.36, 0.006, 0.012)},
        "brushed_metal": {**_BRUSHED, "Base Color": (0.6, 0.55, 0.5)},
        "glass": {**_GLASS, "Base Color": (0.85, 0.96, 0.92)},
        "texture": {"Roughness": 0.35},
        "subsurface": {**_JADE, "Base Color": (0.13, 0.4, 0.25), "Roughness": 0.25},
        "backdrop": {"Base Color": (0.42, 0.42, 0.45), "Roughness": 0.7},
    },
}

MATERIALS: dict[str, dict[str, int]] = {
    scene: {name: index for index, name in enumerate(looks, start=1)}
    for scene, looks in _LOOKS.items()
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
_PAWN: Profile = (
    *((0.0, 0.0), (0.75, 0.0), (0.8, 0.04), (0.8, 0.2), (0.62, 0.34), (0.56, 0.46), (0.34, 0.75)),
    *((0.25, 1.3), (0.28, 1.4), (0.48, 1.44), (0.48, 1.54), (0.26, 1.6), (0.42, 1.78)),
    *((0.46, 2.02), (0.3, 2.3), (0.0, 2.4)),
)


def four_spheres(*, width: int = 320, height: int = 240) -> bpy.types.Scene:
    """Build the verification scene: four spheres of different materials on a diffuse disc.

    The disc ends inside the frame, so that the environment is also seen directly, past its rim.
    Source: Peers and Dutre 2002, section 7. Replaces whatever is loaded.
    """
    scene = _fresh_scene(width, height)
    materials = _materials("four_spheres")
    places = {
        "diffuse": (-2.1, -0.35, 1.0),
        "mirror": (-0.35, 2.1, 1.0),
        "glass": (0.35, -2.1, 1.0),
        "glossy": (2.1, 0.35, 1.0),
    }
    for name, place in places.items():
        _add(scene, name, _sphere(1.0), materials[name], place=place)
    disc = bmesh.new()
    bmesh.ops.create_circle(disc, cap_ends=True, segments=128, radius=4.0)
    _add(scene, "floor", disc, materials["floor"])
    _add_camera(scene, place=(0.0, -9.8, 5.8), target=(0.0, -0.25, 0.3), lens=46.5)
    return scene


def product_shot(*, width: int = 320, height: int = 240, lamps: bool = False) -> bpy.types.Scene:
    """Build a product shot: five objects of five materials on a cyclorama.

    The backdrop hides the environment from the camera, as in a photo studio: every pixel is light
    that went by way of a surface. `lamps` adds one area lamp, for scenes whose own light has to be
    kept apart from the environment's. Replaces whatever is loaded.
    """
    scene = _fresh_scene(width, height)
    materials = _materials("product")
    _brush(materials["brushed_metal"])
    _paint_checker(materials["texture"])
    _add(scene, "backdrop", _cyclorama(), materials["backdrop"], levels=1)
    plinth, monkey = _lathe(_PLINTH), bmesh.new()
    _add(scene, "plinth", plinth, materials["brushed_metal"], levels=2, place=(0.0, 0.3, 0.0))
    bmesh.ops.create_monkey(monkey)
    turn = Euler((math.radians(-30.0), 0.0, math.radians(18.0)))
    at_rest = (0.0, 0.3, 1.448)  # chin and nape touch the plinth
    _add(scene, "monkey", monkey, materials["car_paint"], levels=2, place=at_rest, turn=turn)
    # Glass that shares a plane with the floor would render as noise: hence the millimetre.
    bottle, pawn = _lathe(_BOTTLE), _lathe(_PAWN)
    _add(scene, "bottle", bottle, materials["glass"], levels=2, place=(-2.25, 0.2, 0.001))
    _add(scene, "pawn", pawn, materials["subsurface"], levels=2, place=(2.1, 0.1, 0.0))
    _add(scene, "ball", _sphere(0.55), materials["texture"], place=(-0.95, -1.5, 0.55))
    if lamps:
        softbox = bpy.data.lights.new("softbox", "AREA")
        softbox.energy, softbox.size = 600.0, 2.0
        _add_aimed(scene, softbox, place=(-4.0, -4.0, 5.0), target=(0.0, 0.0, 1.0))
    _add_camera(scene, place=(0.0, -10.5, 3.0), target=(0.0, 0.0, 1.22), lens=60.0)
    return scene


SCENES: dict[str, Callable[..., bpy.types.Scene]] = {
    "four_spheres": four_spheres,
    "product": product_shot,
}


def hdri_names() -> list[str]:
    """Names of the environments that come with Blender (CC0, 1024x512), sorted."""
    return sorted(path.stem for path in _hdri_folder().glob("*.exr"))


def set_world_hdri(
    scene: bpy.types.Scene, name: str, *, rotation_degrees: float = 0.0, strength: float = 1.0
) -> bpy.types.World:
    """Light the scene with one of Blender's own environments, and return the world.

    `rotation_degrees` turns the light about +Z, counter-clockwise seen from above: at 90, what
    stood to the right (+X) stands at the back (+Y). (A Mapping node turns the direction that is
    looked up, hence its rotation is the negative.) Raises ValueError for a name that
    `hdri_names` lacks.
    """
    if name not in hdri_names():
        raise ValueError(f"No environment {name!r} comes with Blender; use one of {hdri_names()}.")
    image = bpy.data.images.load(str(_hdri_folder() / f"{name}.exr"), check_existing=True)
    return _set_world(scene, image, rotation_degrees, strength)


def set_world_right(scene: bpy.types.Scene, *, strength: float = 1.0) -> bpy.types.World:
    """Light the scene through the right-hand face of a cube only, and return the world.

    Source: Peers and Dutre 2002, section 7 (a light map on one side of the hemicube). The radiance
    is `right_light_map()`; the image is packed, so that a saved .blend keeps it.
    """
    pixels = right_light_map()
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(
        "right", width, height, alpha=False, float_buffer=True, is_data=False
    )
    image.colorspace_settings.name = "Linear Rec.709"
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :3] = pixels
    image.pixels.foreach_set(rgba.ravel())
    image.update()
    image.pack()
    return _set_world(scene, image, 0.0, strength)


def right_light_map(height: int = 512) -> np.ndarray:
    """Equirectangular radiance (height, 2 * height, 3), float32, linear Rec.709, rows bottom-up.

    Soft sky light and two windows within x > |y|, x > |z|; black elsewhere. The outermost ring of
    pixels of the face is black too, so that interpolation brings no light out of the face: light
    beyond it would count as an error of the method. Convention of Cycles:
    u = 0.5 - atan2(y, x) / 2 pi, v = 0.5 + atan2(z, hypot(x, y)) / pi.
    """
    azimuth = (0.5 - (np.arange(2 * height) + 0.5) / (2 * height)) * 2 * np.pi
    elevation = ((np.arange(height) + 0.5) / height - 0.5)[:, None] * np.pi
    x = np.cos(elevation) * np.cos(azimuth)
    y = np.cos(elevation) * np.sin(azimuth)
    z = np.broadcast_to(np.sin(elevation), x.shape)
    inside = (x > np.abs(y)) & (x > np.abs(z))
    # No face pixel is near the edge of the image, so what roll wraps around is black.
    shifts = [(rows, columns) for rows in (-1, 0, 1) for columns in (-1, 0, 1)]
    inside = np.all([np.roll(inside, shift, (0, 1)) for shift in shifts], axis=0)
    across, up = (np.where(inside, c / np.where(inside, x, 1.0), 0.0) for c in (y, z))
    soft = np.exp(-1.5 * (across**2 + (up - 0.3) ** 2)) * (0.75 + 0.25 * np.sin(5.0 * up))
    light = 2.2 * soft[..., None] * np.array((0.85, 0.95, 1.1))
    windows = (
        ((-0.75, -0.15), (0.2, 0.85), (16.0, 14.0, 11.0)),
        ((0.3, 0.65), (-0.05, 0.5), (7.0, 9.0, 12.0)),
    )
    for (front, back), (low, high), radiance in windows:
        pane = (across > front) & (across < back) & (up > low) & (up < high)
        light[pane] = radiance
    return np.where(inside[..., None], light, 0.0).astype(np.float32)


def _fresh_scene(width: int, height: int) -> bpy.types.Scene:
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


def _hdri_folder() -> Path:
    """The folder of the environments that come with Blender."""
    return Path(bpy.utils.system_resource("DATAFILES")) / "studiolights" / "world"


def _set_world(
    scene: bpy.types.Scene, image: bpy.types.Image, rotation_degrees: float, strength: float
) -> bpy.types.World:
    """Give the scene a new world that shows an equirectangular image."""
    world = bpy.data.worlds.new(image.name)
    nodes, links = world.node_tree.nodes, world.node_tree.links
    background = nodes["Background"]
    background.inputs["Strength"].default_value = strength
    coordinates = nodes.new("ShaderNodeTexCoord")
    mapping = nodes.new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value[2] = -math.radians(rotation_degrees)
    texture = nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    links.new(texture.outputs["Color"], background.inputs["Color"])
    scene.world = world
    return world


def _materials(scene_name: str) -> dict[str, bpy.types.Material]:
    """The materials of a scene by name, each with its `pass_index`."""
    materials = {}
    for name, look in _LOOKS[scene_name].items():
        material = materials[name] = bpy.data.materials.new(name)
        material.pass_index = MATERIALS[scene_name][name]
        inputs = material.node_tree.nodes["Principled BSDF"].inputs
        for key, value in look.items():
            if isinstance(value, tuple) and inputs[key].type == "RGBA":
                inputs[key].default_value = (*value, 1.0)
            else:
                inputs[key].default_value = value
    return materials


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


def _sphere(radius: float) -> bmesh.types.BMesh:
    """A sphere fine enough that its outline looks round and its reflections smooth."""
    mesh = bmesh.new()
    bmesh.ops.create_uvsphere(mesh, u_segments=96, v_segments=48, radius=radius)
    return mesh


def _lathe(profile: Profile, segments: int = 24) -> bmesh.types.BMesh:
    """A solid of revolution about Z; the profile starts and ends on the axis."""
    mesh = bmesh.new()
    vertices = [mesh.verts.new((radius, 0.0, height)) for radius, height in profile]
    edges = [mesh.edges.new(pair) for pair in pairwise(vertices)]
    turn = {"cent": (0.0, 0.0, 0.0), "axis": (0.0, 0.0, 1.0), "angle": 2.0 * math.pi}
    bmesh.ops.spin(mesh, geom=vertices + edges, steps=segments, use_merge=True, **turn)
    bmesh.ops.remove_doubles(mesh, verts=mesh.verts[:], dist=1e-5)
    bmesh.ops.recalc_face_normals(mesh, faces=mesh.faces[:])
    return mesh


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


def _add(
    scene: bpy.types.Scene,
    name: str,
    mesh: bmesh.types.BMesh,
    material: bpy.types.Material,
    *,
    place: Point = (0.0, 0.0, 0.0),
    turn: Euler | None = None,
    levels: int = 0,
) -> None:
    """Put the mesh into the scene as an object, with `levels` of subdivision; frees the mesh."""
    data = bpy.data.meshes.new(name)
    mesh.to_mesh(data)
    mesh.free()
    data.materials.append(material)
    data.shade_smooth()
    item = bpy.data.objects.new(name, data)
    item.matrix_world = Matrix.LocRotScale(Vector(place), turn, None)
    item.pass_index = material.pass_index
    if levels:
        subdivision = item.modifiers.new("Subdivision", "SUBSURF")
        subdivision.levels = subdivision.render_levels = levels
    scene.collection.objects.link(item)


def _add_aimed(
    scene: bpy.types.Scene, data: bpy.types.ID, *, place: Point, target: Point
) -> bpy.types.Object:
    """Add a camera or a lamp that looks at the target, upright."""
    item = bpy.data.objects.new(data.name, data)
    toward = Vector(target) - Vector(place)
    item.matrix_world = Matrix.LocRotScale(Vector(place), toward.to_track_quat("-Z", "Y"), None)
    scene.collection.objects.link(item)
    return item


def _add_camera(scene: bpy.types.Scene, *, place: Point, target: Point, lens: float) -> None:
    """Give the scene its camera; `lens` is the focal length in millimetres on 36 mm of film."""
    data = bpy.data.cameras.new("camera")
    data.lens = lens
    scene.camera = _add_aimed(scene, data, place=place, target=target)
