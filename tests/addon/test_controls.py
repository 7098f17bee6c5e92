"""A world's dials: what Cycles makes of it turns, brightens and is tinted as the slider says."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from arto.arto_addon.world import dials, kept
from arto.arto_addon.world.bake import bake
from arto.core.errors import SceneError
from scene_tools import small_scene

WIDTH = 64


@pytest.fixture
def scene(tmp_path):
    return small_scene(tmp_path)


def _spot(azimuth: float) -> bpy.types.Image:
    """An HDRI that is dim but for one place on the horizon."""
    image = bpy.data.images.new("Spot", WIDTH, WIDTH // 2, float_buffer=True)
    pixels = np.full((WIDTH // 2, WIDTH, 4), 0.2, np.float32)
    column = int((0.5 - azimuth / (2 * math.pi)) * WIDTH) % WIDTH
    pixels[12:20, column - 2 : column + 2] = (3, 2, 1, 1)
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    image.pack()
    return image


def _texture(world, linked: bool = True):
    tree = world.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = _spot(math.pi / 2)
    if linked:
        tree.links.new(texture.outputs[0], tree.nodes["Background"].inputs["Color"])
    return texture


def _baked(scene) -> np.ndarray:
    return bake(scene, WIDTH).image


def test_turn_of_a_world_without_a_mapping_node(scene) -> None:
    """A quarter turn moves the picture by a quarter of its width, and no node is there twice."""
    world = scene.world
    _texture(world)
    before = _baked(scene)
    world.arto.rotation = math.pi / 2
    assert world.arto.rotation == pytest.approx(math.pi / 2)
    assert [n.name for n in world.node_tree.nodes].count(dials.TURN) == 1
    turned = _baked(scene)
    # a mapping node turns the direction that is looked up: what stood at +Y stands at +X
    expected = np.roll(before, WIDTH // 4, axis=1)
    np.testing.assert_allclose(turned, expected, atol=0.03 * before.max())
    world.arto.rotation = 0.3
    world.arto.rotation = 0.0
    assert len([n for n in world.node_tree.nodes if n.bl_idname == "ShaderNodeMapping"]) == 1
    np.testing.assert_allclose(_baked(scene), before, atol=0.01 * before.max())


def test_a_sky_turns_by_its_sun(scene) -> None:
    """As an HDRI does, to the same side; and what is seen is the light that is captured by it."""
    tree = scene.world.node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    kinds = [item.identifier for item in sky.bl_rna.properties["sky_type"].enum_items]
    sky.sky_type = next(kind for kind in kinds if kind not in dials._BY_VECTOR)
    sky.sun_disc, sky.sun_rotation = False, 0.4
    assert dials.why_not_turned(scene.world)  # it leads nowhere
    tree.links.new(sky.outputs[0], tree.nodes["Background"].inputs["Color"])
    assert not dials.why_not_turned(scene.world)
    assert scene.world.arto.rotation == pytest.approx(0.4)
    before, count = _baked(scene), len(tree.nodes)
    scene.world.arto.rotation = 0.4 + math.pi / 2
    assert sky.sun_rotation == pytest.approx(0.4 + math.pi / 2) and len(tree.nodes) == count
    expected = np.roll(before, WIDTH // 4, axis=1)
    np.testing.assert_allclose(_baked(scene), expected, atol=0.03 * before.max())
    with dials.turned(scene, scene.view_layers[0].name, scene.world, 0.5) as turned:
        assert dials.turn(turned) == pytest.approx(0.9 + math.pi / 2)
    texture = _texture(scene.world, linked=False)
    assert "mixes a sky" in dials.why_not_turned(scene.world)
    tree.nodes.remove(texture)
    group = bpy.data.node_groups.new("Sky", "ShaderNodeTree")
    group.nodes.new("ShaderNodeTexSky")
    tree.nodes.remove(sky)
    tree.nodes.new("ShaderNodeGroup").node_tree = group
    assert "by its Sun Rotation" in dials.why_not_turned(scene.world)


def test_an_own_mapping_node_is_used(scene) -> None:
    world = scene.world
    texture = _texture(world)
    tree = world.node_tree
    mapping, place = tree.nodes.new("ShaderNodeMapping"), tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(place.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], texture.inputs["Vector"])
    mapping.inputs["Rotation"].default_value[2] = 0.4
    count = len(tree.nodes)
    assert world.arto.rotation == pytest.approx(0.4)
    world.arto.rotation = 1.0
    assert mapping.inputs["Rotation"].default_value[2] == pytest.approx(1.0)
    assert len(tree.nodes) == count


def test_strength_of_many_backgrounds(scene) -> None:
    """A factor on all of them: the light doubles, whatever each of them is."""
    world = scene.world
    _texture(world)
    tree = world.node_tree
    other, mix = tree.nodes.new("ShaderNodeBackground"), tree.nodes.new("ShaderNodeMixShader")
    other.inputs["Color"].default_value = (0.1, 0.4, 0.2, 1)
    other.inputs["Strength"].default_value = 0.7
    tree.links.new(tree.nodes["Background"].outputs[0], mix.inputs[1])
    tree.links.new(other.outputs[0], mix.inputs[2])
    out = tree.get_output_node("CYCLES")
    tree.links.new(mix.outputs[0], out.inputs["Surface"])
    before = _baked(scene)
    world.arto.strength = 2.0
    assert world.arto.strength == pytest.approx(2.0)
    np.testing.assert_allclose(_baked(scene), 2 * before, rtol=1e-3, atol=1e-4)
    world.arto.strength = 1.0
    np.testing.assert_allclose(_baked(scene), before, rtol=1e-3, atol=1e-4)


def test_strength_that_is_worked_out(scene) -> None:
    world = scene.world
    tree = world.node_tree
    value = tree.nodes.new("ShaderNodeValue")
    value.outputs[0].default_value = 0.5
    tree.links.new(value.outputs[0], tree.nodes["Background"].inputs["Strength"])
    before = _baked(scene)
    world.arto.strength = 3.0
    np.testing.assert_allclose(_baked(scene), 3 * before, rtol=1e-3)
    assert value.outputs[0].default_value == 0.5


def test_tint_multiplies(scene) -> None:
    world = scene.world
    _texture(world)
    before = _baked(scene)
    world.arto.tint = (1.0, 0.5, 0.25)
    np.testing.assert_allclose(_baked(scene), before * (1.0, 0.5, 0.25), rtol=1e-3, atol=1e-4)
    assert tuple(world.arto.tint) == pytest.approx((1.0, 0.5, 0.25))


def test_looking_puts_nothing_in(scene) -> None:
    """A panel reads the dials of any world, and changes none."""
    world = scene.world
    _texture(world)
    names = [n.name for n in world.node_tree.nodes]
    assert (world.arto.rotation, world.arto.strength) == (0.0, 1.0)
    assert tuple(world.arto.tint) == (1.0, 1.0, 1.0)
    dials.why_not_turned(world)
    assert [n.name for n in world.node_tree.nodes] == names


def test_why_a_slider_is_grey(scene) -> None:
    world = scene.world
    assert "no HDRI" in dials.why_not_turned(world)
    texture = _texture(world)
    assert dials.why_not_turned(world) == ""
    wave = world.node_tree.nodes.new("ShaderNodeTexWave")
    world.node_tree.links.new(wave.outputs[0], texture.inputs["Vector"])
    assert "nodes of its own" in dials.why_not_turned(world)


def test_dials_are_told_apart_from_what_is_shown(scene) -> None:
    """Turn and strength leave the key of a world as it is; anything else changes it."""
    world = scene.world
    texture = _texture(world)
    world.arto.rotation = 0.1
    key, _, _ = kept.shows(scene, world)
    world.arto.rotation, world.arto.strength = 1.3, 2.5
    found = kept.shows(scene, world)
    assert found[0] == key and found[1:] == pytest.approx((2.5, 1.3))
    world.arto.tint = (1, 0.5, 0.5)
    tinted = kept.shows(scene, world)[0]
    assert tinted != key
    texture.image = _spot(0.0)
    assert kept.shows(scene, world)[0] not in {key, tinted}


def test_a_background_that_is_seen_is_the_one_that_is_dimmed(scene) -> None:
    """One that leads nowhere makes no difference, and no node is put in."""
    world = scene.world
    _texture(world)
    spare = world.node_tree.nodes.new("ShaderNodeBackground")
    before, count = _baked(scene), len(world.node_tree.nodes)
    world.arto.strength = 2.0
    assert len(world.node_tree.nodes) == count
    assert spare.inputs["Strength"].default_value == 1.0
    np.testing.assert_allclose(_baked(scene), 2 * before, rtol=1e-3, atol=1e-4)
    assert kept.shows(scene, world)[1] == pytest.approx(2.0)


def test_a_mapping_node_before_a_group_turns_what_is_in_it(scene) -> None:
    """The slider and a turntable turn the world by the same node."""
    world = scene.world
    tree = world.node_tree
    inner = bpy.data.node_groups.new("Dome", "ShaderNodeTree")
    inner.interface.new_socket("Vector", in_out="INPUT", socket_type="NodeSocketVector")
    inner.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    first, last = inner.nodes.new("NodeGroupInput"), inner.nodes.new("NodeGroupOutput")
    texture = inner.nodes.new("ShaderNodeTexEnvironment")
    texture.image = _spot(math.pi / 2)
    inner.links.new(first.outputs[0], texture.inputs["Vector"])
    inner.links.new(texture.outputs[0], last.inputs[0])
    group = tree.nodes.new("ShaderNodeGroup")
    group.node_tree = inner
    tree.links.new(group.outputs[0], tree.nodes["Background"].inputs["Color"])
    assert "node group" in dials.why_not_turned(world)
    with (
        pytest.raises(SceneError, match="node group"),
        dials.turned(scene, scene.view_layers[0].name, world, 1.0),
    ):
        pass
    mapping, place = tree.nodes.new("ShaderNodeMapping"), tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(place.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], group.inputs[0])
    before = _baked(scene)
    expected = np.roll(before, WIDTH // 4, axis=1)
    with dials.turned(scene, scene.view_layers[0].name, world, math.pi / 2) as copy:
        found = bake(scene, WIDTH, None, copy).image
    np.testing.assert_allclose(found, expected, atol=0.03 * before.max())
    world.arto.rotation = math.pi / 2
    np.testing.assert_allclose(_baked(scene), expected, atol=0.03 * before.max())


def test_pictures_with_mapping_nodes_of_their_own_keep_them(scene) -> None:
    world = scene.world
    tree = world.node_tree
    for angle in (0.2, 0.5):
        texture, mapping = _texture(world), tree.nodes.new("ShaderNodeMapping")
        mapping.inputs["Rotation"].default_value[2] = angle
        tree.links.new(mapping.outputs[0], texture.inputs["Vector"])
    count = len(tree.nodes)
    assert "one by one" in dials.why_not_turned(world)
    world.arto.rotation = 1.0
    assert len(tree.nodes) == count
