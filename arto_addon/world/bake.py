"""The scene's world, whatever its nodes, brought to an environment map.

Cycles itself evaluates it, through a panoramic camera. A world may show the camera something else
than it lights the scene with (Light Path nodes, ray visibility); then the camera sits inside a box
that refracts with an index of 1: what comes through is the world as the scene's surfaces see it.
"""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.environment import Environment
from ...core.region import Region
from ..blender.nodes import trees
from ..stage.stage import set_region
from .check import check_world
from .studio import render as render_studio
from .studio import studio_scene

SAMPLES = 4
# A texel that carries more than this share of all the light is a sun or a lamp: its edge is
# rendered again, with this many samples.
HOT = 1e-3
HOT_SAMPLES = 256
BLOCK = 64


def _pass_through(made: list[Any], studio: Any) -> None:
    """The box around the camera: what it lets through is no longer a camera ray."""
    material = bpy.data.materials.new("ARTO Pass Through")
    tree = material.node_tree
    tree.nodes.clear()
    glass = tree.nodes.new("ShaderNodeBsdfRefraction")
    glass.inputs["Roughness"].default_value = 0.0
    glass.inputs["IOR"].default_value = 1.0
    glass.inputs["Color"].default_value = (1, 1, 1, 1)
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(glass.outputs[0], output.inputs["Surface"])
    mesh = bpy.data.meshes.new("ARTO Pass Through")
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh.from_pydata(corners, [], faces)
    mesh.materials.append(material)
    box = bpy.data.objects.new("ARTO Pass Through", mesh)
    studio.collection.objects.link(box)
    made += [box, mesh, material]


def sees_the_camera(world: Any) -> bool:
    """Whether a world may look different to the camera than to the scene."""
    rays = world.cycles_visibility
    hidden = not all(
        getattr(rays, p.identifier)
        for p in rays.bl_rna.properties
        if p.type == "BOOLEAN" and not p.is_readonly
    )
    return hidden or any(
        node.bl_idname == "ShaderNodeLightPath"
        for tree in trees(world.node_tree, set())
        for node in tree.nodes
    )


def _hot_blocks(image: NDArray[np.float32]) -> list[Region]:
    """Rectangles around the texels that carry much of the light."""
    energy = image.max(axis=-1) * Environment(image).row_solid_angles[:, None]
    hot = np.pad(energy > HOT * energy.sum(), 1)
    hot = sum(
        hot[1 + dy : hot.shape[0] - 1 + dy, 1 + dx : hot.shape[1] - 1 + dx]
        for dy in (-1, 0, 1)
        for dx in (-1, 0, 1)
    ).astype(bool)
    found = []
    for y in range(0, hot.shape[0], BLOCK):
        for x in range(0, hot.shape[1], BLOCK):
            rows, columns = np.nonzero(hot[y : y + BLOCK, x : x + BLOCK])
            if len(rows):
                found.append(Region.around(rows + y, columns + x))
    return found


def bake(scene: bpy.types.Scene, width: int) -> Environment:
    """The world's light as an equirectangular map, width x width/2, in the working space.

    Every texel is the mean over itself. Raises SceneError for a world that is not there or lacks
    an image.
    """
    check_world(scene)
    with studio_scene(scene, "ARTO World") as (studio, made):
        lens = bpy.data.cameras.new("ARTO Panorama")
        camera = bpy.data.objects.new("ARTO Panorama", lens)
        made += [camera, lens]
        studio.collection.objects.link(camera)
        studio.camera = camera
        lens.type = "PANO"
        lens.panorama_type = "EQUIRECTANGULAR"
        # the middle of the picture looks along +X, as the middle of a world texture does
        camera.rotation_euler = (math.pi / 2, 0, -math.pi / 2)
        lens.clip_start = 1e-3
        if sees_the_camera(scene.world):
            _pass_through(made, studio)
        render = studio.render
        render.resolution_x, render.resolution_y = width, width // 2
        studio.cycles.pixel_filter_type = "BOX"
        studio.cycles.samples = SAMPLES
        image = np.ascontiguousarray(render_studio(studio)[..., :3])
        studio.cycles.samples = HOT_SAMPLES
        for block in _hot_blocks(image):
            set_region(studio, block)
            image[block.slices] = render_studio(studio)[..., :3]
    return Environment(image)
