"""A view layer's overrides: of the world, and of the material."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender.nodes import new_world
from arto.arto_addon.relight import relight
from arto.arto_addon.world.background import background
from arto.arto_addon.world.bake import bake
from arto.core import exr
from scene_tools import assert_as_cycles, material, set_colour, small_scene
from shot_tools import run_all


def world_of_colour(colour):
    world = new_world("Other")
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (*colour, 1)
    return world


@pytest.mark.newest
@pytest.mark.parametrize("kind", ["world", "glow"])
def test_plate_of_a_view_layer_with_an_override(tmp_path, kind):
    """The plate is what Cycles renders of that layer: with its world, or with its one material
    (of clay that glows) on the scene's objects alone."""
    scene = small_scene(tmp_path, lamp=True)
    scene.render.film_transparent = True
    scene.arto.samples, scene.arto.patterns = 512, "linear"
    set_colour(scene, (0.3, 0.6, 0.9))
    layer = scene.view_layers[0]
    if kind == "world":
        layer.world_override = world_of_colour((0.9, 0.2, 0.1))
        scene.world = None
    else:
        layer.material_override = material("Clay", Base_Color=(0.6, 0.6, 0.6, 1), Roughness=0.9)
        shader = layer.material_override.node_tree.nodes["Principled BSDF"]
        shader.inputs["Emission Color"].default_value = (0.1, 0.3, 0.2, 1)
        shader.inputs["Emission Strength"].default_value = 0.5
    materials = len(bpy.data.materials)
    picture = run_all(scene)
    assert_as_cycles(picture, scene, 512, tmp_path)
    assert len(bpy.data.materials) == materials
    assert layer.material_override is None or layer.material_override.name == "Clay"


def test_all_of_relighting_reads_the_layers_world(tmp_path):
    """Light, background and the header's name, of one layer and of the other."""
    scene = small_scene(tmp_path)
    set_colour(scene, (0, 1, 0))
    other = scene.view_layers.new("Other")
    other.world_override = world_of_colour((1, 0, 0))
    name = scene.view_layers[0].name
    for layer, colour in ((name, (0, 1, 0)), ("Other", (1, 0, 0))):
        np.testing.assert_allclose(bake(scene, 64, layer).image.mean((0, 1)), colour, atol=1e-4)
        np.testing.assert_allclose(background(scene, None, layer).mean((0, 1)), colour, atol=1e-4)
    run_all(scene)
    path, _ = work.run(relight.relight(scene))
    assert exr.header(path)["arto.world"] == "World"
    assert "arto.world by rays" not in exr.header(path)
    scene.world.cycles_visibility.glossy = False
    path, _ = work.run(relight.relight(scene))
    assert "glossy" in exr.header(path)["arto.world by rays"]
    scene.view_layers[0].world_override = world_of_colour((1, 0, 0))
    path, _ = work.run(relight.relight(scene))
    assert exr.header(path)["arto.world"] == "Other.001"
