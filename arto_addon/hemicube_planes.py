"""The hemicube as emissive planes in a Blender scene."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable
from typing import Any

import bpy
import numpy as np

from ..core.capture_set import group_name
from ..core.hemicube import FACE_NAMES, Hemicube
from ..core.patterns import PatternSet

COLLECTION = "ARTO Hemicube"
FAR = 1000.0
# Patterns stand behind each other, each this much farther out: so near that a patch point keeps its
# direction, so far that a ray cannot miss the gap (float32 at 1,000 radii).
GAP = 1e-4


def wanted(scene: bpy.types.Scene, centre: Iterable[float], radius: float) -> Hemicube:
    """The hemicube that the settings ask for around a scene of that centre and radius."""
    s = scene.arto
    angle = s.rotation
    if s.align == "camera" and scene.camera:
        # the camera looks along its -Z; only its heading counts
        look = -scene.camera.matrix_world.col[2].to_3d()
        angle += math.atan2(-look.x, look.y)
    c, sn = math.cos(angle), math.sin(angle)
    return Hemicube(
        faces=tuple(f for f in FACE_NAMES if f in s.faces),
        patches=s.patches,
        half_sides=s.half_sides,
        orientation=((c, -sn, 0.0), (sn, c, 0.0), (0.0, 0.0, 1.0)),
        centre=tuple(float(x) for x in centre),
        size=FAR * radius if s.far else s.size,
    )


def pattern_material(pattern: str, coefficients: Iterable[float], opaque: bool) -> Any:
    """Emission of a polynomial of the patch coordinates (its UV map), plus what lies behind."""
    material = bpy.data.materials.new(f"ARTO {pattern}")
    # paths find the patches; no shadow ray is ever cast at them, so Cycles' limit of 255 light
    # groups for sampled lights does not apply
    material.cycles.emission_sampling = "NONE"
    tree = material.node_tree
    tree.nodes.clear()
    node: Callable[[str], Any] = tree.nodes.new
    link = tree.links.new

    def math_node(operation: str, *inputs: Any) -> Any:
        out = node("ShaderNodeMath")
        out.operation = operation
        for socket, value in zip(out.inputs, inputs, strict=False):
            if isinstance(value, float):
                socket.default_value = value
            else:
                link(value, socket)
        return out.outputs[0]

    split = node("ShaderNodeSeparateXYZ")
    link(node("ShaderNodeUVMap").outputs[0], split.inputs[0])
    u, v = split.outputs[0], split.outputs[1]
    terms = (
        None,
        u,
        math_node("MULTIPLY", u, u),
        v,
        math_node("MULTIPLY", v, v),
        math_node("MULTIPLY", u, v),
    )
    total: Any = None
    for coefficient, term in zip(coefficients, terms, strict=True):
        if not coefficient:
            continue
        constant = float(coefficient)
        if term is None:
            value = math_node("ADD", constant, 0.0)
        else:
            value = math_node("MULTIPLY", term, constant)
        total = value if total is None else math_node("ADD", total, value)
    emission = node("ShaderNodeEmission")
    link(total, emission.inputs["Strength"])
    shader = emission.outputs[0]
    if not opaque:
        add = node("ShaderNodeAddShader")
        link(shader, add.inputs[0])
        link(node("ShaderNodeBsdfTransparent").outputs[0], add.inputs[1])
        shader = add.outputs[0]
    link(shader, node("ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def _plane(name: str, corners: np.ndarray, material: Any, made: Callable[[Any], Any]) -> Any:
    mesh = made(bpy.data.meshes.new(name))
    mesh.from_pydata(corners.tolist(), [], [(0, 1, 2, 3)])
    uv = mesh.uv_layers.new(name="UVMap")
    uv.data.foreach_set("uv", [0, 0, 1, 0, 1, 1, 0, 1])
    mesh.materials.append(material)
    plane = made(bpy.data.objects.new(name, mesh))
    plane.visible_camera = False
    # the scene's own sun must reach it through the patches
    plane.visible_shadow = False
    plane.display_type = "WIRE"
    plane.hide_select = True
    return plane


def build(
    collection: bpy.types.Collection,
    hemicube: Hemicube,
    patterns: PatternSet,
    made: Callable[[Any], Any],
    images: Iterable[tuple[int, int]] | None = None,
) -> None:
    """Fill `collection` with a plane for each (patch, pattern) of `images` (default: all).

    Each plane carries the light group `capture_set.group_name`. `made` is told of every new
    data-block.
    """
    if images is None:
        images = [(k, p) for k in range(len(hemicube)) for p in range(len(patterns))]
    else:
        images = list(images)
    used = sorted({p for _, p in images})
    materials = {
        p: made(
            pattern_material(patterns.patterns[p], patterns.coefficients[p], opaque=p == used[-1])
        )
        for p in used
    }
    centre = np.array(hemicube.centre)
    for k, p in images:
        name = group_name(k, patterns.patterns[p])
        distance = hemicube.size * (1 + GAP * used.index(p))
        plane = _plane(name, centre + distance * hemicube.corners(k), materials[p], made)
        plane.lightgroup = name
        collection.objects.link(plane)


def build_for_artist(scene: bpy.types.Scene, hemicube: Hemicube, radius: float) -> Any:
    """The hemicube in the artist's scene: to look at. It is not rendered there (it would hide the
    world); capturing builds its own from the same geometry."""
    remove_for_artist(scene)
    collection = bpy.data.collections.new(COLLECTION)
    collection.hide_render = True
    scene.collection.children.link(collection)
    white = PatternSet("white", ("white",), ((1.0, 0.0, 0.0, 0.0, 0.0, 0.0),))
    build(collection, hemicube, white, lambda block: block)
    collection["arto_hemicube"] = json.dumps(hemicube.to_json())
    collection["arto_radius"] = radius
    return collection


def of_artist(scene: bpy.types.Scene) -> Any | None:
    """The collection that `build_for_artist` made in this scene, or None."""
    return next((c for c in scene.collection.children if "arto_hemicube" in c), None)


def built(scene: bpy.types.Scene) -> tuple[Hemicube, float] | None:
    """The geometry of the artist's hemicube and the scene's radius when it was built, or None."""
    collection = of_artist(scene)
    if collection is None:
        return None
    return Hemicube.from_json(json.loads(collection["arto_hemicube"])), collection["arto_radius"]


def remove_for_artist(scene: bpy.types.Scene) -> bool:
    """Remove the artist's hemicube, with all that belongs to it; whether there was one."""
    collection = of_artist(scene)
    if collection is None:
        return False
    planes = list(collection.objects)
    meshes = [p.data for p in planes]
    materials = {m for mesh in meshes for m in mesh.materials if m}
    bpy.data.batch_remove([*planes, *meshes, *materials, collection])
    return True
