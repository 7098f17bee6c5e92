"""Small lamps in a world keep their light, whatever the map's width and wherever they stand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from arto.arto_addon.blender.nodes import Nodes
from arto.arto_addon.world.bake import bake, rough
from arto.arto_addon.world.brightest import brightest
from arto.arto_addon.world.detail import FINEST, detail
from arto.core.light.environment import Environment, directions
from scene_tools import hdri, set_colour, smooth

RADIANCE = 1e5


PLACES = [(12.34, 56.78), (60.1, -100.2), (0.03, 180.0), (90.0, 0.0), (-89.9, 20.0)]


def towards(elevation: float, azimuth: float) -> tuple[float, float, float]:
    e, a = math.radians(elevation), math.radians(azimuth)
    return (math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e))


def discs(scene, degrees: float) -> float:
    """A disc of light of so many degrees across at each of `PLACES`, drawn by nodes; the irradiance
    of one in closed form.

    Inside is where the chord to its middle is short: no cosine of a small angle is rounded.
    """
    chord = 2 * math.sin(math.radians(degrees) / 4)
    tree = scene.world.node_tree
    direction = tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"]
    nodes = Nodes(tree)
    total = 0.0
    for place in PLACES:
        away = nodes.add("ShaderNodeVectorMath", direction, towards(*place), operation="DISTANCE")
        inside = nodes.math("LESS_THAN", away.outputs["Value"], chord)
        total = nodes.math("MULTIPLY_ADD", inside, RADIANCE, total)
    background = tree.nodes["Background"]
    background.inputs["Color"].default_value = (1, 1, 1, 1)
    tree.links.new(total, background.inputs["Strength"])
    return RADIANCE * math.pi * chord**2  # the area of a cap is that of a disc of its chord


# the finest lamp in a fine map, the widest one in a coarse map
@pytest.mark.newest
@pytest.mark.parametrize(("degrees", "width"), [(0.1, 2048), (10, 256)])
def test_discs_keep_their_light(scene, width, degrees):
    """Each to 1%: in the map's middle, high up, across its seam, on a pole and beside one."""
    expected = discs(scene, degrees)
    baked = bake(scene, width)
    height = width // 2
    u, v = (np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height
    azimuth = (0.5 - u) * 2 * np.pi
    where = directions(np.stack([np.cos(azimuth), np.sin(azimuth)], -1), (0.5 - v) * np.pi)
    for place in PLACES:
        near = np.linalg.norm(where - towards(*place), axis=-1) < math.radians(
            degrees + 720 / width
        )
        mine = Environment(np.where(near[..., None], baked.image, 0).astype(np.float32))
        found = mine.irradiance()
        np.testing.assert_allclose(found, expected, rtol=0.01, err_msg=str(place))


def test_a_disc_of_a_texture_keeps_its_light(scene):
    """One texel of an image, and a disc of five, at a seam and high up. What a texture shows is
    interpolated between texels: a texel's light is that of a tent."""
    pixels = np.zeros((512, 1024, 3))
    pixels[100, 0] = pixels[256, 700] = pixels[400:405, 300:305] = RADIANCE
    hdri(scene, pixels)
    # each texel has a tent of the area of a texel, weighted by the cosine of its latitude
    rows = np.arange(512)
    side = np.pi / 512
    cosine = np.cos(np.pi / 2 - (rows + 0.5) * side) * (2 * np.sin(side / 2) / side) ** 2
    expected = (pixels * cosine[:, None, None]).sum(axis=(0, 1)) * side**2
    for width in (256, 1024):
        np.testing.assert_allclose(bake(scene, width).irradiance(), expected, rtol=0.01)


def test_a_rough_map_has_the_light_of_suns(scene):
    """What Live shows while a slider moves: by two samples a texel alone, a sun of half a degree
    had from 0.2 to 1.4 of its light."""
    pixels = np.full((512, 1024, 3), 0.1)
    pixels[100, 400:402] = RADIANCE
    texture = hdri(scene, pixels)
    found = rough(scene, 512, scene.world).irradiance()
    # what a texture shows is interpolated: at these latitudes that keeps the light to 1%
    expected = Environment(pixels.astype(np.float32)).irradiance()
    np.testing.assert_allclose(found, expected, rtol=0.01)
    tree = scene.world.node_tree
    tree.nodes.remove(texture)
    sky = tree.nodes.new("ShaderNodeTexSky")
    sky.sun_elevation, sky.sun_size = 0.6, math.radians(0.545)
    tree.links.new(sky.outputs[0], tree.nodes["Background"].inputs["Color"])
    expected = bake(scene, 256).irradiance()
    np.testing.assert_allclose(rough(scene, 512, scene.world).irradiance(), expected, rtol=0.01)
    assert sky.sun_size == pytest.approx(math.radians(0.545))


def test_detail_is_read_from_the_nodes(scene):
    set_colour(scene, (1, 1, 1))
    assert detail(scene.world) == 1
    texture = hdri(scene, smooth(256))
    assert detail(scene.world) == 512
    tree = scene.world.node_tree
    mapping = texture.inputs[0].links[0].from_node
    mapping.inputs["Scale"].default_value = (1, 1, -2)
    assert detail(scene.world) == 1024
    mapping.inputs["Scale"].default_value = (1, 1, 1)
    # a value of the texture's pixels is as fine as they are, one of a direction may be anything
    power = tree.nodes.new("ShaderNodeMath")
    power.operation = "POWER"
    tree.links.new(texture.outputs[0], power.inputs[0])
    tree.links.new(power.outputs[0], tree.nodes["Background"].inputs["Strength"])
    assert detail(scene.world) == 512
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Generated"], power.inputs[0])
    assert detail(scene.world) == FINEST
    tree.nodes.remove(power)
    sky = tree.nodes.new("ShaderNodeTexSky")
    sky.sun_size = math.radians(0.5)
    tree.links.new(sky.outputs[0], tree.nodes["Background"].inputs["Color"])
    assert 1440 <= detail(scene.world) <= 1441
    voronoi = tree.nodes.new("ShaderNodeTexVoronoi")
    assert detail(scene.world) < 1500  # leads nowhere
    tree.links.new(voronoi.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    assert detail(scene.world) == FINEST


def test_clouds_have_no_room_for_a_sun(scene):
    """The bound of a world's brightness holds, and there is none where nodes may draw a sun."""
    tree = scene.world.node_tree
    light = tree.nodes["Background"]
    noise, ramp = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeValToRGB")
    ramp.color_ramp.elements[1].color = (3, 2, 1, 1)
    tree.links.new(noise.outputs[0], ramp.inputs[0])
    tree.links.new(ramp.outputs[0], light.inputs["Color"])
    light.inputs["Strength"].default_value = 0.5
    assert brightest(scene.world) == 1.5
    seen = bake(scene, 64).image
    assert 0.1 < seen.max() <= 1.5 + 1e-5
    scale = tree.nodes.new("ShaderNodeMath")
    scale.operation, scale.inputs[1].default_value = "MULTIPLY_ADD", 4.0
    tree.links.new(noise.outputs[0], scale.inputs[0])
    tree.links.new(scale.outputs[0], light.inputs["Strength"])
    assert brightest(scene.world) == 3 * 4.5
    scale.operation = "DIVIDE"
    scale.inputs[1].default_value = 1e-5
    assert brightest(scene.world) == pytest.approx(3e5)
    scale.operation = "TANGENT"
    assert brightest(scene.world) == math.inf
