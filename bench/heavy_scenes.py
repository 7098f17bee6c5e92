"""Scenes that Cycles prepares for long: many triangles, instances, textures, hair, objects, fog.

Each is built from nothing, and the same on every machine. `share` makes a scene smaller by that
factor, for a quick look and for tests.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import bpy
import numpy as np
from numpy.typing import NDArray

from .building import Look, add_camera, fresh_scene, materials_of, noded

# Triangles of one large thing, and sides of its grid: two triangles each.
TRIANGLES = 500_000
_LOOKS: dict[str, Look] = {
    "stone": {"Base Color": (0.5, 0.42, 0.35), "Roughness": 0.6},
    "metal": {"Base Color": (0.8, 0.7, 0.5), "Metallic": 1.0, "Roughness": 0.25},
    "floor": {"Base Color": (0.4, 0.4, 0.42), "Roughness": 0.8},
}
# Of an image, in texels along each side: 268 MB of bytes.
TEXELS = 8192


def _mesh(name: str, points: NDArray, quads: NDArray) -> bpy.types.Mesh:
    """A smooth mesh of points (V, 3) and quads (F, 4)."""
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(points))
    mesh.vertices.foreach_set("co", points.astype(np.float32).ravel())
    mesh.loops.add(quads.size)
    mesh.loops.foreach_set("vertex_index", quads.astype(np.int32).ravel())
    mesh.polygons.add(len(quads))
    mesh.polygons.foreach_set("loop_start", np.arange(0, quads.size, 4, dtype=np.int32))
    mesh.update()
    mesh.shade_smooth()
    return mesh


def boulder(name: str, seed: int, triangles: int) -> bpy.types.Mesh:
    """A bumpy ball of about so many triangles."""
    rng = np.random.default_rng(seed)
    n = max(8, round(math.sqrt(triangles / 2)))
    around = np.linspace(0, 2 * np.pi, n, endpoint=False)
    down = np.linspace(0.02, np.pi - 0.02, n + 1)
    u, v = np.meshgrid(around, down)
    radius = np.ones_like(u)
    for k in (1, 2, 4, 8, 16):
        a, b = 6 * rng.random(2)
        radius += 0.08 / k * np.sin(3 * k * u + a) * np.sin(4 * k * v + b)
    points = np.stack([np.sin(v) * np.cos(u), np.sin(v) * np.sin(u), np.cos(v)], -1)
    i, j = np.meshgrid(np.arange(n), np.arange(n))
    right = (i + 1) % n
    quads = np.stack([j * n + i, (j + 1) * n + i, (j + 1) * n + right, j * n + right], -1)
    return _mesh(name, (points * radius[..., None]).reshape(-1, 3), quads.reshape(-1, 4))


def _ground(width: int, height: int) -> tuple[bpy.types.Scene, dict[str, bpy.types.Material]]:
    """A floor with a camera before it, in a world of one colour."""
    scene = fresh_scene(width, height)
    materials = materials_of(_LOOKS)
    points = np.array([(-20, -20, 0), (20, -20, 0), (20, 20, 0), (-20, 20, 0)])
    floor = _mesh("floor", points, np.arange(4)[None])
    floor.materials.append(materials["floor"])
    _put(scene, floor, (0.0, 0.0, 0.0))
    add_camera(scene, place=(0.0, -13.0, 5.5), target=(0.0, 1.0, 0.6), lens=40.0)
    scene.world = noded(bpy.data.worlds.new("world"))
    return scene, materials


def _put(
    scene: bpy.types.Scene, data: bpy.types.ID, place: tuple[float, float, float], size: float = 1.0
) -> bpy.types.Object:
    thing = bpy.data.objects.new(data.name, data)
    thing.location, thing.scale = place, (size, size, size)
    scene.collection.objects.link(thing)
    return thing


def _place(i: int, count: int) -> tuple[tuple[float, float, float], float]:
    """Where the i-th of so many things stands on the floor, and its size."""
    columns = max(4, round(math.sqrt(count * 4 / 3)))
    step = 9.2 / columns
    x, y = (i % columns - (columns - 1) / 2) * step, (i // columns) * step
    return (x, y, 0.43 * step), 0.4 * step


def _boulders(
    scene: bpy.types.Scene,
    materials: dict[str, bpy.types.Material],
    count: int,
    triangles: int,
    unique: bool = True,
) -> None:
    looks = [materials["stone"], materials["metal"]]
    first = boulder("boulder", 0, triangles)
    first.materials.append(looks[0])
    for i in range(count):
        mesh = first
        if unique and i:
            mesh = boulder(f"boulder_{i}", i, triangles)
            mesh.materials.append(looks[i % 2])
        _put(scene, mesh, *_place(i, count))


def triangles(
    millions: float, unique: bool, width: int, height: int, share: float
) -> bpy.types.Scene:
    """So many million triangles in boulders of half a million, each its own mesh or all of one."""
    scene, materials = _ground(width, height)
    count = max(1, round(millions * 1e6 / TRIANGLES))
    _boulders(scene, materials, count, round(TRIANGLES * share), unique)
    return scene


def textures(width: int, height: int, share: float) -> bpy.types.Scene:
    """Eight boulders, each with an image of its own: 2 GB of textures."""
    scene, materials = _ground(width, height)
    texels = max(64, round(TEXELS * math.sqrt(share)))
    for i in range(8):
        image = bpy.data.images.new(f"grid_{i}", texels, texels)
        image.generated_type = "COLOR_GRID" if i % 2 else "UV_GRID"
        material = materials["stone"].copy()
        nodes = material.node_tree.nodes
        texture = nodes.new("ShaderNodeTexImage")
        texture.image = image
        # boulders have no UV map
        place = nodes.new("ShaderNodeTexCoord").outputs["Generated"]
        material.node_tree.links.new(place, texture.inputs["Vector"])
        material.node_tree.links.new(
            texture.outputs["Color"], nodes["Principled BSDF"].inputs["Base Color"]
        )
        mesh = boulder(f"boulder_{i}", i, round(20_000 * share))
        mesh.materials.append(material)
        _put(scene, mesh, *_place(i, 8))
    return scene


def hair(width: int, height: int, share: float) -> bpy.types.Scene:
    """Four furry boulders, 200,000 hairs of eight points each in all."""
    scene, materials = _ground(width, height)
    rng = np.random.default_rng(0)
    count, points = max(10, round(50_000 * share)), 8
    for i in range(4):
        out = rng.normal(size=(count, 3))
        out /= np.linalg.norm(out, axis=1, keepdims=True)
        along = np.linspace(0.0, 0.35, points)[None, :, None]
        bent = out[:, None] * (1 + along) - np.array((0.0, 0.0, 1.5)) * along**2
        curves = bpy.data.hair_curves.new(f"fur_{i}")
        curves.add_curves([points] * count)
        curves.points.foreach_set("position", bent.astype(np.float32).ravel())
        curves.points.foreach_set("radius", np.full(count * points, 0.002, np.float32))
        curves.materials.append(materials["stone"])
        place, size = _place(i, 4)
        _put(scene, curves, place, size)
        skin = boulder(f"skin_{i}", i, 4000)
        skin.materials.append(materials["stone"])
        _put(scene, skin, place, 0.95 * size)
    return scene


def objects(width: int, height: int, share: float) -> bpy.types.Scene:
    """Two thousand things of a thousand triangles, each its own mesh."""
    scene, materials = _ground(width, height)
    _boulders(scene, materials, max(4, round(2000 * share)), 1000)
    return scene


def volume(width: int, height: int, share: float) -> bpy.types.Scene:
    """Boulders in fog that is not the same everywhere."""
    scene, materials = _ground(width, height)
    _boulders(scene, materials, 4, round(20_000 * share))
    fog = noded(bpy.data.materials.new("fog"))
    nodes = fog.node_tree.nodes
    nodes.clear()
    noise = nodes.new("ShaderNodeTexNoise")
    noise.inputs["Detail"].default_value = 0.0
    dense = nodes.new("ShaderNodeMath")
    dense.operation, dense.inputs[1].default_value = "MULTIPLY", 0.2
    fog.node_tree.links.new(noise.outputs[0], dense.inputs[0])
    scatter = nodes.new("ShaderNodeVolumePrincipled")
    fog.node_tree.links.new(dense.outputs[0], scatter.inputs["Density"])
    output = nodes.new("ShaderNodeOutputMaterial")
    fog.node_tree.links.new(scatter.outputs[0], output.inputs["Volume"])
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    sides = np.array(
        [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    )
    box = _mesh("fog", corners * np.array((3.0, 2.5, 0.8)) + np.array((0.0, 1.0, 0.85)), sides)
    box.materials.append(fog)
    _put(scene, box, (0.0, 0.0, 0.0))
    return scene


Build = Callable[[int, int, float], bpy.types.Scene]
SCENES: dict[str, Build] = {
    "0.5 M triangles": lambda w, h, share: triangles(0.5, True, w, h, share),
    "6 M triangles": lambda w, h, share: triangles(6, True, w, h, share),
    "24 M triangles": lambda w, h, share: triangles(24, True, w, h, share),
    "24 M triangles, instanced": lambda w, h, share: triangles(24, False, w, h, share),
    "2 GB of textures": textures,
    "200,000 hairs": hair,
    "2,000 objects": objects,
    "a volume": volume,
}
