"""The scene's own sun lamps, where only rays that leave the scene bring their light."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from arto.arto_addon.blender.nodes import new_material
from scene_tools import BOX, add_mesh, captured, cycles, set_colour, small_scene

SAMPLES = 256


def looked_at(folder, degrees: float, shader: dict, through: bool):
    """A sun of so many degrees, seen in (or through) a slab that fills a picture twice as wide."""
    scene = small_scene(folder)
    for thing in list(scene.objects):
        if thing.type == "MESH":
            bpy.data.objects.remove(thing)
    material = new_material("Slab")
    for name, value in shader.items():
        material.node_tree.nodes["Principled BSDF"].inputs[name].default_value = value
    slab = add_mesh(scene, "Slab", *BOX, material)
    slab.scale = (4, 4, 0.1)
    scene.camera.location = (0, -10, 10)
    scene.camera.rotation_euler = (math.radians(45), 0, 0)
    scene.camera.data.angle = math.radians(2 * degrees)
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.data.energy, sun.data.angle = 1.0, math.radians(degrees)
    # where the camera looks to, or where it sees in the mirror: light comes along its -Z
    sun.rotation_euler = (math.radians(-135 if through else -45), 0, 0)
    scene.collection.objects.link(sun)
    set_colour(scene, (0, 0, 0))
    scene.arto.samples, scene.arto.patterns = SAMPLES, "linear"
    return scene


MIRROR = {"Metallic": 1.0, "Roughness": 0.0}
GLASS = {"Transmission Weight": 1.0, "Roughness": 0.0, "IOR": 1.45}


@pytest.mark.parametrize("degrees", [0.5, 2, 10])
@pytest.mark.parametrize(
    ("shader", "through"),
    [
        (MIRROR, False),
        ({**MIRROR, "Roughness": 0.05}, False),
        ({**MIRROR, "Roughness": 0.1}, False),
        ({**MIRROR, "Roughness": 0.3}, False),
        ({**MIRROR, "Roughness": 0.6}, False),
        (GLASS, True),
    ],
    ids=["mirror", "0.05", "0.1", "0.3", "0.6", "glass"],
)
def test_own_sun_is_what_cycles_shows_in_a_black_world(tmp_path, degrees, shader, through):
    """As bright as Cycles to a hundredth, and pixel by pixel as near as two of its seeds."""
    scene = looked_at(tmp_path, degrees, shader, through)
    own = captured(scene).read(0).own.astype(np.float64)
    one, two = (cycles(scene, SAMPLES, seed, tmp_path)[..., :3] for seed in (1, 2))
    truth = (one.astype(np.float64) + two) / 2
    assert truth.mean() > 1e-3
    assert own.mean() == pytest.approx(truth.mean(), rel=0.01)
    noise = np.square(one - two).mean()
    assert np.square(own - truth).mean() < 2 * noise + 1e-6 * truth.max() ** 2
