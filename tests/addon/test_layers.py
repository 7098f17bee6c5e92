"""Layers of a plate: they sum to it, in its file and in Blender's compositor."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender.compositing import add_output, compositor, new_compositor
from arto.arto_addon.blender.nodes import new_world
from arto.arto_addon.plate import plate
from arto.arto_addon.plate.names import relit_file
from arto.arto_addon.relight import relight
from arto.arto_addon.relight.back import mix_to_scene
from arto.arto_addon.shot import paths
from arto.core import exr
from arto.core.errors import SceneError
from arto.core.field.field import Field
from scene_tools import (
    assert_as_cycles,
    captured,
    composited,
    hdri,
    in_compositor,
    small_scene,
    smooth,
)
from shot_tools import group_at, relit_layers


def test_faces_and_the_scenes_own_lamps_sum_to_the_plate(lit):
    picture, found = relit_layers(lit)
    assert set(found) == {
        f"LG_{f}" for f in ("top", "bottom", "left", "right", "back", "front")
    } | {"LG_own"}
    np.testing.assert_allclose(sum(found.values()), picture[..., :3], rtol=1e-5, atol=1e-6)
    assert all((layer >= 0).all() for layer in found.values())
    # a box lit from the left is brighter on its left: the layers are what they say
    assert found["LG_own"].any() and found["LG_top"].mean() > found["LG_bottom"].mean()


def test_a_layer_is_the_picture_in_that_part_of_the_light(lit):
    """The layer of a group is what the plate is under a world of nothing but that group."""
    lit.arto.layers = "GROUPS"
    group_at(lit, "key", 2.0, 0.6, 0.8)
    lit.arto.own_lamps = 0.0
    _, found = relit_layers(lit)
    image = smooth()
    height, width = image.shape[:2]
    u, v = (np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height
    azimuth, latitude = (0.5 - u) * 2 * np.pi, (0.5 - v) * np.pi
    across = np.cos(latitude)[:, None]
    towards = np.dstack([across * np.cos(azimuth), across * np.sin(azimuth),
                         np.broadcast_to(np.sin(latitude)[:, None], (height, width))])  # fmt: skip
    middle = (math.cos(0.6) * math.cos(2.0), math.cos(0.6) * math.sin(2.0), math.sin(0.6))
    angle = np.arccos(np.clip(towards @ np.array(middle), -1, 1))
    mask = np.clip((0.8 - angle) / 0.08 + 0.5, 0, 1)
    hdri(lit, image * mask[..., None])
    lit.arto.layers = "OFF"
    path, _ = work.run(relight.relight(lit))
    alone = exr.read(path)[""][..., :3]
    # the map of the world and its mask are of other resolutions
    assert np.abs(found["LG_key"] - alone).mean() < 0.03 * alone.mean()


def test_a_group_that_is_painted_on_the_hdri(lit):
    """Its layer is the plate in what is painted alone, turned as the HDRI is."""
    image = smooth()
    mask = np.zeros(image.shape[:2])
    mask[8:24, 30:60] = 1
    lit.arto.layers, lit.arto.own_lamps = "GROUPS", 0.0
    white = bpy.data.images.new("Window", image.shape[1], image.shape[0], float_buffer=True)
    white.colorspace_settings.name = "Non-Color"
    rgba = np.dstack([mask, mask, mask, np.ones_like(mask)]).astype(np.float32)
    white.pixels.foreach_set(rgba[::-1].ravel())
    white.pack()
    lit.arto.groups.add().name = "window"
    lit.arto.groups[0].mask = white
    lit.world = new_world("Sky")
    hdri(lit, image, rotation=0.9)
    picture, found = relit_layers(lit)
    np.testing.assert_allclose(sum(found.values()), picture[..., :3], rtol=1e-5, atol=1e-6)
    lit.world = new_world("Painted")
    hdri(lit, image * mask[..., None], rotation=0.9)
    lit.arto.layers = "OFF"
    path, _ = work.run(relight.relight(lit))
    alone = exr.read(path)[""][..., :3]
    assert alone.mean() > 0.01
    assert np.abs(found["LG_window"] - alone).mean() < 0.03 * alone.mean()
    # a world of no HDRI cannot be painted on
    lit.world = new_world("Plain")
    lit.arto.layers = "GROUPS"
    with pytest.raises(SceneError, match="painted"):
        relit_layers(lit)


def test_groups_need_names_of_their_own(lit):
    lit.arto.layers = "GROUPS"
    group_at(lit, "key.1", 0, 0.5, 0.3)
    group_at(lit, "key_1", 1, 0.5, 0.3)
    with pytest.raises(SceneError, match="rename"):
        relit_layers(lit)
    lit.arto.groups[1].name = "rest"
    with pytest.raises(SceneError, match="rename"):
        relit_layers(lit)
    lit.arto.groups[1].name = "12"
    _, found = relit_layers(lit)
    assert "LG_layer_12" in found and not any(n.removeprefix("LG_").isdigit() for n in found)


def test_denoised_layers_sum_to_the_denoised_plate(lit):
    lit.arto.denoise = True
    picture, found = relit_layers(lit)
    np.testing.assert_allclose(sum(found.values()), picture[..., :3], rtol=1e-5, atol=1e-6)


def test_a_sun_is_in_the_group_that_has_it(lit):
    """Its light, rendered by itself, is in that layer alone, and the sum is the plate."""
    image = smooth()
    image[10:13, 40:43] += 400.0
    hdri(lit, image)
    lit.arto.lamps, lit.arto.lamp_samples, lit.arto.own_lamps = True, 64, 0.0
    lit.arto.layers = "GROUPS"
    u, v = 41.5 / image.shape[1], 11.5 / image.shape[0]
    group_at(lit, "sun", (0.5 - u) * 2 * math.pi, (0.5 - v) * math.pi, 0.3)
    picture, found = relit_layers(lit)
    np.testing.assert_allclose(sum(found.values()), picture[..., :3], rtol=1e-5, atol=1e-6)
    assert found["LG_sun"].mean() > 0.5 * picture[..., :3].mean()


def test_the_world_behind_is_a_layer(lit):
    lit.render.film_transparent = False
    picture, found = relit_layers(lit)
    np.testing.assert_allclose(sum(found.values()), picture[..., :3], rtol=1e-5, atol=1e-6)
    clear = found["LG_behind"].sum(axis=-1) > 0
    assert 0.05 < clear.mean() < 0.95


def test_the_mixer_in_the_compositor(lit, tmp_path):
    """With every gain at one it gives the plate; a gain dims its layer alone, a tint colours it."""
    picture, found = relit_layers(lit)
    group = bpy.data.node_groups["ARTO Relit Mix"]
    node = in_compositor(lit, group, "Image")
    np.testing.assert_allclose(composited(lit, tmp_path), picture, rtol=1e-4, atol=1e-5)
    node.inputs["LG_top"].default_value = 0.25
    node.inputs["LG_own Tint"].default_value = (1, 0, 0, 1)
    node.inputs["Exposure"].default_value = 1.0
    mixed = sum(found.values()) - 0.75 * found["LG_top"] - found["LG_own"] * (0, 1, 1)
    np.testing.assert_allclose(composited(lit, tmp_path)[..., :3], 2 * mixed, rtol=1e-4, atol=1e-5)
    # kept: another relight puts new pixels into the same nodes and sockets
    nodes = len(group.nodes)
    relit_layers(lit)
    assert len(group.nodes) == nodes and node.inputs["LG_top"].default_value == 0.25
    # a layer that was not there is added; one that is gone is black
    lit.arto.layers = "GROUPS"
    group_at(lit, "key", 2.0, 0.6, 0.8)
    picture, _ = relit_layers(lit)
    assert "LG_key" in node.inputs and "LG_top" in node.inputs
    for name in ("LG_own Tint",):
        node.inputs[name].default_value = (1, 1, 1, 1)
    node.inputs["Exposure"].default_value = 0.0
    np.testing.assert_allclose(composited(lit, tmp_path), picture, rtol=1e-4, atol=1e-5)


@pytest.mark.newest
@pytest.mark.parametrize("patches", [1, 3])
def test_own_lamps_by_their_light_group(tmp_path, patches):
    """Each group's layer is what the lamp by itself gives, also beside more than 255 groups of
    ours; a lamp of no group stays in the layer of the others."""
    scene = small_scene(tmp_path)
    scene.render.film_transparent = True
    scene.arto.samples, scene.arto.patches, scene.arto.keep = 64, patches, "never"
    lamps = {}
    for name, angle in (("Key Light", 0.8), ("fill", -0.8), ("", 0.1)):
        lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "SUN"))
        lamp.data.energy, lamp.rotation_euler = 2.0 + angle, (0.3, angle, 0)
        scene.collection.objects.link(lamp)
        lamp.lightgroup = name
        lamps[name] = lamp
        if name:
            scene.view_layers[0].lightgroups.add(name=name)
    captured(scene)
    scene.arto.layers, scene.arto.layers_half = "FACES", False
    picture, found = relit_layers(scene)
    assert {"LG_own_Key_Light", "LG_own_fill", "LG_own"} <= set(found)
    np.testing.assert_allclose(sum(found.values()), picture[..., :3], rtol=1e-5, atol=1e-6)
    for name, lamp in lamps.items():
        for other in lamps.values():
            other.hide_render = other != lamp
        captured(scene)
        alone = Field(paths.field_folder(scene)).layer("own")
        mine = found["LG_own" + (f"_{name.replace(' ', '_')}" if name else "")]
        assert abs(mine.mean() / alone.mean() - 1) < 0.02
        assert np.abs(mine - alone).mean() < 0.1 * alone.mean()


def test_layers_of_a_shot_with_catchers_sum_to_its_things(tmp_path):
    scene = small_scene(tmp_path)
    scene.objects["Floor"].is_shadow_catcher = True
    scene.render.film_transparent = True
    scene.arto.samples, scene.arto.patches, scene.arto.keep = 16, 1, "never"
    scene.arto.layers, scene.arto.layers_half = "FACES", False
    hdri(scene, smooth())
    captured(scene)
    picture, found = relit_layers(scene)
    np.testing.assert_allclose(sum(found.values()), picture[..., :3], rtol=1e-5, atol=1e-6)
    assert plate.share_file(relit_file(scene)).is_file()


def test_a_mix_goes_back_to_the_scene(tmp_path):
    """The world and the lamps that it gives render to the mix: as Cycles has it, within noise."""
    scene = small_scene(tmp_path)
    scene.render.film_transparent = True
    scene.arto.samples, scene.arto.patches, scene.arto.keep = 512, 4, "never"
    scene.arto.layers, scene.arto.layers_half = "GROUPS", False
    group_at(scene, "key", 2.0, 0.6, 0.8)
    lamps = []
    for name, angle in (("Rim", 0.8), ("", -0.8)):
        lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "SUN"))
        lamp.data.energy, lamp.rotation_euler = 1.0, (0.3, angle, 0)
        scene.collection.objects.link(lamp)
        lamp.lightgroup = name
        lamps.append(lamp)
    # one lamp's data of two groups
    lamps[1].data = lamps[0].data
    scene.view_layers[0].lightgroups.add(name="Rim")
    hdri(scene, smooth(), rotation=0.4)
    captured(scene)
    _, found = relit_layers(scene)
    node = next(n for n in compositor(scene).nodes if "LG_key" in n.inputs)
    gains = {"key": (3.0, (1, 0.5, 0.25)), "rest": (0.2, (1, 1, 1)), "own_Rim": (2.0, (0, 1, 0))}
    mixed = sum(found.values())
    for name, (gain, tint) in gains.items():
        node.inputs[f"LG_{name}"].default_value = gain
        node.inputs[f"LG_{name} Tint"].default_value = (*tint, 1)
        mixed = mixed + found[f"LG_{name}"] * (gain * np.array(tint) - 1)
    node.inputs["Exposure"].default_value = -1.0
    path = mix_to_scene(scene)
    assert path.is_file() and scene.world.name == "ARTO Mix"
    assert_as_cycles(np.dstack([mixed / 2, relit_alpha(scene)]), scene, 512, tmp_path)
    # given once, it is not given again on top of itself
    energies = [lamp.data.energy for lamp in lamps]
    with pytest.raises(SceneError, match="relight first"):
        mix_to_scene(scene)
    assert [lamp.data.energy for lamp in lamps] == energies
    node.inputs["LG_key"].default_value = 1.0
    tree = compositor(scene)
    link = tree.nodes.new("ShaderNodeValue")
    tree.links.new(link.outputs[0], node.inputs["LG_key"])
    with pytest.raises(SceneError, match="linked"):
        mix_to_scene(scene)


def relit_alpha(scene):
    return exr.read(relit_file(scene))[""][..., 3:]


def test_instead_of_the_render_and_back(lit):
    """What hung on the render hangs on the plate, or on the mixer where there are layers; back, it
    hangs where it did, but for what the artist has linked otherwise since."""
    tree = new_compositor(lit, "Mine")
    render, out = tree.nodes.new("CompositorNodeRLayers"), add_output(tree)
    blur, glare = tree.nodes.new("CompositorNodeBlur"), tree.nodes.new("CompositorNodeGlare")
    render.scene = lit
    tree.links.new(render.outputs["Image"], blur.inputs["Image"])
    tree.links.new(render.outputs["Image"], glare.inputs["Image"])
    tree.links.new(blur.outputs["Image"], out.inputs[0])

    def comes_from(node):
        return node.inputs["Image"].links[0].from_node

    relit_layers(lit)
    assert comes_from(blur) == render and comes_from(glare) == render
    lit.arto.use_in_compositor = "RENDER"
    assert comes_from(blur).node_tree.name == "ARTO Relit Mix" == comes_from(glare).node_tree.name
    relit_layers(lit)
    assert comes_from(blur).node_tree.name == "ARTO Relit Mix"
    lit.arto.layers = "OFF"
    work.run(relight.relight(lit))
    assert comes_from(blur).node_tree.name == "ARTO Relit"
    # the artist takes one of them away
    tree.links.remove(glare.inputs["Image"].links[0])
    lit.arto.use_in_compositor = "VIEWER"
    assert comes_from(blur) == render and not glare.inputs["Image"].links
    assert comes_from(out.inputs[0].links[0].from_node) == render


def test_a_group_is_not_called_as_a_socket_of_the_mixer(lit):
    """Without a prefix: the mixer would have taken its own socket for the layer's."""
    lit.arto.layers, lit.arto.layer_prefix = "GROUPS", ""
    group_at(lit, "Exposure", 0, 0.5, 0.3)
    with pytest.raises(SceneError, match="rename"):
        relit_layers(lit)
    lit.arto.layer_prefix = "LG_"
    _, found = relit_layers(lit)
    assert "LG_Exposure" in found
