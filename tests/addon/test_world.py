"""Worlds brought to environment maps: directions and energy."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender.nodes import new_world
from arto.arto_addon.relight import relight
from arto.arto_addon.world.background import background
from arto.arto_addon.world.bake import bake, rough
from arto.arto_addon.world.check import differs_by_rays
from arto.core import exr
from arto.core.errors import SceneError
from arto.core.region import Region
from scene_tools import hdri, set_colour, small_scene, smooth
from shot_tools import run_all


def test_plain_colour_with_strength(scene):
    set_colour(scene, (0.2, 0.4, 0.8), strength=3)
    image = bake(scene, 64).image
    np.testing.assert_allclose(image, np.broadcast_to([0.6, 1.2, 2.4], image.shape), rtol=1e-5)


def test_environment_texture_comes_back_texel_by_texel(scene):
    pixels = smooth()
    hdri(scene, pixels)
    image = bake(scene, 128).image
    # all but the seam and the poles, where Cycles interpolates over the rim
    np.testing.assert_allclose(image[2:-2, 2:-2], pixels[2:-2, 2:-2], atol=0.02)


def test_mapping_turns_the_world(scene):
    pixels = smooth()
    hdri(scene, pixels, rotation=math.pi / 2)
    image = bake(scene, 128).image
    # the mapping turns the direction that is looked up, so what is shown turns the other way
    turned, other = np.roll(pixels, 32, axis=1), np.roll(pixels, -32, axis=1)
    assert np.abs(image - turned)[2:-2].mean() < 0.02
    assert np.abs(image - other)[2:-2].mean() > 0.1


def test_mix_of_worlds_adds_up(scene):
    tree = scene.world.node_tree
    set_colour(scene, (1, 0, 0))
    second = tree.nodes.new("ShaderNodeBackground")
    second.inputs["Color"].default_value = (0, 2, 0, 1)
    mix = tree.nodes.new("ShaderNodeMixShader")
    mix.inputs[0].default_value = 0.25
    tree.links.new(tree.nodes["Background"].outputs[0], mix.inputs[1])
    tree.links.new(second.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
    image = bake(scene, 64).image
    np.testing.assert_allclose(image, np.broadcast_to([0.75, 0.5, 0], image.shape), atol=1e-5)


def sun(scene, elevation, azimuth=0.7321):
    """A disc of light of half a degree, of known radiance, drawn by nodes; its irradiance, which is
    known in closed form. Angles in radians."""
    size, radiance = math.radians(0.53), 1e5
    e, a = elevation, azimuth
    direction = (math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e))
    tree = scene.world.node_tree
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    dot = tree.nodes.new("ShaderNodeVectorMath")
    dot.operation = "DOT_PRODUCT"
    dot.inputs[1].default_value = direction
    tree.links.new(coordinates.outputs["Generated"], dot.inputs[0])
    inside = tree.nodes.new("ShaderNodeMath")
    inside.operation = "GREATER_THAN"
    inside.inputs[1].default_value = math.cos(size / 2)
    tree.links.new(dot.outputs["Value"], inside.inputs[0])
    background = tree.nodes["Background"]
    background.inputs["Color"].default_value = (1, 1, 1, 1)
    scale = tree.nodes.new("ShaderNodeMath")
    scale.operation = "MULTIPLY"
    scale.inputs[1].default_value = radiance
    tree.links.new(inside.outputs[0], scale.inputs[0])
    tree.links.new(scale.outputs[0], background.inputs["Strength"])
    # float32 cos(size / 2), as the node compares it
    cosine = float(np.float32(math.cos(size / 2)))
    return radiance * 2 * math.pi * (1 - cosine)


@pytest.mark.newest
@pytest.mark.parametrize("elevation", [60, 3])
def test_sun_of_half_a_degree_keeps_its_energy(scene, elevation):
    expected = sun(scene, math.radians(elevation))
    np.testing.assert_allclose(bake(scene, 1024).irradiance(), expected, rtol=0.01)


def test_sun_that_is_seen_behind_keeps_its_energy(scene):
    """Few samples in an even sky must not mean few on the rim of a sun. To 1%; and a part of the
    background is that part of all of it."""
    expected = sun(scene, 0.1, 0.02)
    scene.camera.rotation_euler = (math.pi / 2 + 0.1, 0, -math.pi / 2 + 0.02)
    scene.camera.data.angle = math.radians(12)
    scene.render.resolution_x, scene.render.resolution_y = 64, 48
    scene.render.resolution_percentage = 100
    picture = background(scene)
    pixel = (2 * math.tan(math.radians(6)) / 64) ** 2  # its solid angle in the middle
    np.testing.assert_allclose(picture.sum(axis=(0, 1)) * pixel, expected, rtol=0.01)
    region = Region(30, 10, 20, 16)
    part = background(scene, region)
    inside = np.zeros(part.shape, bool)
    inside[region.slices] = True
    assert (part[~inside] == 0).all() and part.max() > 1e4
    rim = (picture > 1) & (picture < 9.9e4)  # another seed there
    np.testing.assert_allclose(part[inside & ~rim], picture[inside & ~rim], rtol=1e-4)


def test_sky_texture_with_its_sun(scene):
    """The sun of Blender's sky, at two resolutions: the same energy to 1%."""
    tree = scene.world.node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    sky.sun_elevation, sky.sun_rotation = math.radians(40), 0.3
    tree.links.new(sky.outputs[0], tree.nodes["Background"].inputs["Color"])
    coarse, fine = (bake(scene, w).irradiance() for w in (512, 2048))
    np.testing.assert_allclose(coarse, fine, rtol=0.01)
    sky.sun_disc = False
    assert (bake(scene, 512).irradiance() < 0.8 * coarse).all()


def test_world_that_shows_the_camera_something_else(scene):
    """The light is what surfaces see; the background is what the camera sees."""
    tree = scene.world.node_tree
    set_colour(scene, (0, 1, 0))
    shown = tree.nodes.new("ShaderNodeBackground")
    shown.inputs["Color"].default_value = (1, 0, 0, 1)
    rays = tree.nodes.new("ShaderNodeLightPath")
    mix = tree.nodes.new("ShaderNodeMixShader")
    tree.links.new(rays.outputs["Is Camera Ray"], mix.inputs[0])
    tree.links.new(tree.nodes["Background"].outputs[0], mix.inputs[1])
    tree.links.new(shown.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
    np.testing.assert_allclose(bake(scene, 64).image.mean(axis=(0, 1)), (0, 1, 0), atol=1e-4)
    np.testing.assert_allclose(background(scene).mean(axis=(0, 1)), (1, 0, 0), atol=1e-4)


def test_world_hidden_from_the_camera_still_lights(scene):
    set_colour(scene, (0.5, 0.5, 0.5))
    scene.world.cycles_visibility.camera = False
    np.testing.assert_allclose(bake(scene, 64).image, 0.5, atol=1e-4)
    assert background(scene).max() == 0


@pytest.mark.parametrize("kind", ["diffuse", "glossy", "transmission", "scatter"])
def test_world_hidden_from_a_kind_of_rays_is_said_and_lights(scene, kind):
    """One map for all kinds: it has the light, and what it cannot tell apart is said."""
    set_colour(scene, (0.5, 0.5, 0.5))
    assert differs_by_rays(scene.world) == ""
    setattr(scene.world.cycles_visibility, kind, False)
    np.testing.assert_allclose(bake(scene, 64).image, 0.5, atol=1e-4)
    assert f"hidden from {kind} rays" in differs_by_rays(scene.world)


def test_world_hidden_from_all_is_dark(scene):
    for kind in ("diffuse", "glossy", "transmission", "scatter"):
        setattr(scene.world.cycles_visibility, kind, False)
    assert bake(scene, 64).image.max() == 0
    assert differs_by_rays(scene.world) == ""


@pytest.mark.parametrize("name", ["Is Glossy Ray", "Is Diffuse Ray", "Ray Depth", "Is Camera Ray"])
def test_world_mixed_by_rays_is_said(scene, name):
    tree = scene.world.node_tree
    rays = tree.nodes.new("ShaderNodeLightPath")
    tree.links.new(rays.outputs[name], tree.nodes["Background"].inputs["Strength"])
    said = differs_by_rays(scene.world)
    assert said == "" if name == "Is Camera Ray" else f"'{name}'" in said


def test_no_world_and_missing_image(scene, tmp_path):
    texture = hdri(scene, smooth(8))
    missing = bpy.data.images.new("Missing", 4, 4)
    missing.source, missing.filepath = "FILE", str(tmp_path / "gone.exr")
    texture.image = missing
    with pytest.raises(SceneError, match=r"gone\.exr"):
        bake(scene, 64)
    texture.image = None
    with pytest.raises(SceneError, match="has no image"):
        bake(scene, 64)
    scene.world = None
    with pytest.raises(SceneError, match="no world"):
        bake(scene, 64)


def test_nothing_is_left_behind(scene):
    kinds = ("scenes", "worlds", "objects", "cameras", "meshes", "materials")
    before = {k: len(getattr(bpy.data, k)) for k in kinds}
    bake(scene, 64)
    background(scene)
    assert {k: len(getattr(bpy.data, k)) for k in kinds} == before


@pytest.mark.parametrize("how", ["full", "rough"])
def test_an_hdri_that_is_cut_off_is_said(tmp_path, how):
    """Cycles shows magenta for it, which is a light like any other."""
    scene = small_scene(tmp_path)
    path = tmp_path / "half.exr"
    exr.write(path, {"": np.full((64, 128, 3), 0.5, np.float32)})
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    tree = scene.world.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(str(path))
    tree.links.new(texture.outputs[0], tree.nodes["Background"].inputs["Color"])
    scenes = len(bpy.data.scenes)
    with pytest.raises(SceneError, match=r"'half\.exr' cannot be used"):
        if how == "full":
            bake(scene, 64)
        else:
            rough(scene, 64, scene.world)
    assert len(bpy.data.scenes) == scenes


def test_a_world_below_zero_is_said(tmp_path):
    """Its light would be taken away from things, and of a shadow nothing is less than none."""
    scene = small_scene(tmp_path)
    scene.arto.samples = 1
    image = smooth()
    hdri(scene, image)
    run_all(scene)
    path, _ = work.run(relight.relight(scene))
    assert "arto.world below 0" not in exr.header(path)
    image[20:40, 10:60] = -1
    scene.world = new_world("Below")
    hdri(scene, image)
    steps: list = []
    path, _ = work.run(relight.relight(scene), steps.append)
    assert any("below 0" in step.text for step in steps)
    assert "below 0" in exr.header(path)["arto.world below 0"]
