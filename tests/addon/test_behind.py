"""What stands behind the plate, beside Cycles' own picture of the scene with its world."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender.nodes import Nodes, new_material
from arto.arto_addon.blender.output import float_exr, write_to
from arto.arto_addon.blender.version import FIVE
from arto.arto_addon.relight import ahead, relight
from arto.arto_addon.relight.shown import Shown
from arto.arto_addon.stage.stage import picture_region, stage
from arto.arto_addon.world.background import background
from arto.core import exr
from arto.core.errors import SceneError
from scene_tools import add_mesh, hdri, holding_out, small_scene, smooth
from shot_tools import run_all


def own_picture(scene, samples, folder, seed=1, empty=False):
    """What F12 renders of the scene as it is, but for noise -> (H, W, 4)."""
    with stage(scene, scene.view_layers[0].name) as on:
        float_exr(on.scene.render, multilayer=False)
        cycles = on.scene.cycles
        cycles.samples, cycles.seed, cycles.sample_clamp_indirect = samples, seed, 0
        cycles.use_adaptive_sampling = cycles.use_denoising = False
        for thing in on.scene.objects if empty else ():
            thing.hide_render = True
        write_to(on.scene.render, folder / "own.exr")
        request = work.Render(on.scene.name, 0, "")
        work.blocking_render(request)
        request.check()
        for thing in on.scene.objects if empty else ():
            thing.hide_render = False
    return next(iter(exr.read(folder / "own.exr").values()))


def sky(folder):
    scene = small_scene(folder)
    scene.camera.rotation_euler.x = math.radians(80)
    hdri(scene, smooth(), rotation=0.5)
    scene.arto.samples, scene.arto.patches, scene.arto.patterns = 256, 4, "linear"
    return scene


@pytest.mark.newest
@pytest.mark.parametrize("how", ["shader", "region", "plain"])
def test_plate_over_its_world(tmp_path, how):
    """With a film that is opaque: holes are black and transparent, outside a region is nothing, and
    all else is as near to Cycles as two of its seeds."""
    scene = sky(tmp_path)
    if how == "region":
        scene.render.use_border = True
        scene.render.border_min_x, scene.render.border_max_x = 0.25, 0.75
        scene.render.border_min_y, scene.render.border_max_y = 0.5, 1.0
    elif how != "plain":
        holding_out(scene, how)
    picture = run_all(scene)
    one, two = (own_picture(scene, 256, tmp_path, seed) for seed in (1, 2))
    assert picture.shape == one.shape
    if how != "plain":
        assert (one[..., 3] == 0).sum() > 10
    np.testing.assert_allclose(picture[..., 3], one[..., 3], atol=0.1)
    assert np.abs(picture[..., 3] - one[..., 3]).mean() < 0.01
    noise = np.abs(one - two)[..., :3].mean()
    assert np.abs(picture - one)[..., :3].mean() < 2 * noise + 0.01
    assert abs(picture[..., :3].mean() / one[..., :3].mean() - 1) < 0.01


def _clear(nodes: Nodes):
    return nodes.add("ShaderNodeBsdfTransparent", (0.9, 0.4, 0.1, 1)).outputs[0]


def _portal(nodes: Nodes):
    """Half of a portal that looks aside, and half of what is tinted."""
    portal = nodes.tree.nodes.new("ShaderNodeBsdfRayPortal")
    aside = nodes.add("ShaderNodeCombineXYZ", 1.0, 0.3, 0.4).outputs[0]
    nodes.tree.links.new(aside, portal.inputs["Direction"])
    return nodes.add("ShaderNodeMixShader", 0.5, portal.outputs[0], _clear(nodes)).outputs[0]


def _dark(nodes: Nodes):
    clear = nodes.add("ShaderNodeBsdfTransparent", (1, 1, 1, 1)).outputs[0]
    less = nodes.add("ShaderNodeEmission", (1, 0.5, 0, 1), -0.4).outputs[0]
    return nodes.add("ShaderNodeAddShader", clear, less).outputs[0]


def test_what_is_seen_through_panes(tmp_path):
    """Tinted, turned, and less light than none: beside Cycles' own picture, pane by pane."""
    scene = sky(tmp_path)
    for i, make in enumerate((_clear, _portal, _dark)):
        glass = new_material("pane")
        glass.node_tree.nodes.clear()
        nodes = Nodes(glass.node_tree)
        nodes.add("ShaderNodeOutputMaterial", make(nodes))
        left, right = 1.3 * i - 2, 1.3 * i - 0.7
        corners = [(left, -3, 0.2), (right, -3, 0.2), (right, -3, 6), (left, -3, 6)]
        add_mesh(scene, "pane", corners, [(0, 1, 2, 3)], glass)
    scene.arto.write_data = True
    picture = run_all(scene)
    said = ahead.warnings(Shown(scene, scene.view_layers[0].name), scene.world)
    assert ahead.PORTALS in said and ahead.TINTED not in said  # there is no shadow catcher
    through = exr.read(tmp_path / "relit_data.exr")["through"]
    one, two = (own_picture(scene, 256, tmp_path, seed) for seed in (1, 2))
    assert (picture[..., 3] == 1).all()
    np.testing.assert_allclose(through[2, 4], (0.9, 0.4, 0.1), atol=1e-3)
    for columns in (slice(0, 8), slice(8, 16), slice(16, 24)):
        mine, truth, other = (p[:, columns, :3] for p in (picture, one, two))
        assert np.abs(mine - truth).mean() < 2 * np.abs(truth - other).mean() + 0.01
        assert abs(mine.mean() / truth.mean() - 1) < 0.01
    scene.render.film_transparent = True
    with pytest.raises(SceneError, match="Ray Portals and was captured for an opaque film"):
        work.run(relight.relight(scene))


@pytest.mark.parametrize("what", ["motion", "fisheye", "aspect", "exposure", "shift"])
def test_the_world_behind_is_seen_as_the_scene_sees_it(tmp_path, what):
    """Beside Cycles' own render of the scene with everything hidden."""
    scene = sky(tmp_path)
    pixels = np.kron(np.random.default_rng(3).random((16, 32, 3)), np.ones((8, 8, 1)))
    for node in scene.world.node_tree.nodes:
        if node.bl_idname == "ShaderNodeTexEnvironment":
            image = bpy.data.images.new("Rough", 256, 128, float_buffer=True)
            image.colorspace_settings.name = "Linear Rec.709"
            rgba = np.dstack([pixels, np.ones((128, 256))]).astype(np.float32)
            image.pixels.foreach_set(rgba.ravel())
            image.pack()
            node.image = image
    plain = background(scene)
    camera = scene.camera
    if what == "motion":
        scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.0
        for frame, angle in ((0, -0.3), (2, 0.3)):
            camera.rotation_euler.z = angle
            camera.keyframe_insert("rotation_euler", index=2, frame=frame)
        scene.frame_set(1)
    elif what == "fisheye":
        camera.data.type, camera.data.panorama_type = "PANO", "FISHEYE_EQUISOLID"
        camera.data.fisheye_fov, camera.data.fisheye_lens = 2.0, 12.0
    elif what == "aspect":
        scene.render.pixel_aspect_x = 2.0
    elif what == "exposure":
        scene.cycles.film_exposure, scene.cycles.filter_width = 2.0, 4.0
    else:
        camera.data.shift_x = 0.3
    found = background(scene)
    truth = own_picture(scene, 256, tmp_path, empty=True)[..., :3]
    assert np.abs(found - plain).mean() > 0.05
    assert np.abs(found - truth).mean() < 0.02
    assert found.mean() == pytest.approx(truth.mean(), rel=0.01)


def test_transparent_glass_is_said(tmp_path):
    scene = small_scene(tmp_path)
    scene.render.film_transparent = scene.cycles.film_transparent_glass = True
    scene.arto.samples = 4
    run_all(scene)
    steps = []
    path, _ = work.run(relight.relight(scene), steps.append)
    assert any("Transparent Glass" in s.text for s in steps)
    assert "Transparent Glass" in exr.header(path)["arto.glass"]


@pytest.mark.parametrize("edges", [(0.2, 0.8, 0.1, 0.9), (0.31, 0.7, 0.37, 0.68)])
def test_a_region_between_pixels(tmp_path, edges):
    """The pixels that F12 fills, of a region drawn by hand, are those that are captured."""
    scene = sky(tmp_path)
    r = scene.render
    r.resolution_x, r.resolution_y = 47, 30
    r.use_border = True
    r.border_min_x, r.border_max_x, r.border_min_y, r.border_max_y = edges
    filled = own_picture(scene, 1, tmp_path)[..., 3] > 0
    y, x = picture_region(scene).slices
    assert filled[y, x].all() and filled.sum() == filled[y, x].size


def test_a_sun_smaller_than_a_pixel_is_behind(tmp_path):
    """A few samples miss it, and the pixel then looks even: its light is Cycles', on average."""
    scene = sky(tmp_path)
    texels = np.full((512, 1024, 3), 0.2, np.float32)
    # three texels of a map: one degree, of pixels of three; above what stands there
    texels[512 // 2 - 40 : 512 // 2 - 37, 256 : 256 + 3] = 400
    hdri(scene, texels)
    scene.camera.data.angle = math.radians(75)
    scene.camera.rotation_euler.x = math.radians(100)
    expected = np.mean([own_picture(scene, 256, tmp_path, s, empty=True) for s in (1, 2)], axis=0)
    found = background(scene, even=True)
    assert expected[..., 0].max() > 5
    assert found[..., 0].mean() == pytest.approx(expected[..., 0].mean(), rel=0.03)


def test_leaves_behind_each_other_end_where_a_render_ends_them(tmp_path):
    """The patterns are transparent too, and do not count: in the light on leaves, and in what is
    seen behind them. When they counted, what is behind was 1.5 to 2.4 times as bright."""
    scene = sky(tmp_path)
    scene.cycles.transparent_max_bounces = 2
    scene.arto.patterns, scene.arto.patches = "packed", 2
    leaf = new_material("leaf")
    shader = leaf.node_tree.nodes["Principled BSDF"].inputs
    shader["Alpha"].default_value, shader["Roughness"].default_value = 0.4, 1.0
    for i in range(5):
        y = -3 + 0.1 * i
        # behind the third there are no more in the middle of the picture
        left = -4 if i < 3 else 0.5
        corners = [(left, y, -1), (4, y, -1), (4, y, 6), (left, y, 6)]
        add_mesh(scene, "leaf", corners, [(0, 1, 2, 3)], leaf)
    picture = run_all(scene)
    one, two = (own_picture(scene, 512, tmp_path, seed)[..., :3] for seed in (1, 2))
    truth = (one + two) / 2
    for columns in (slice(0, 11), slice(14, 24)):
        for rows in (slice(0, 5), slice(8, 18)):
            mine, right = picture[rows, columns, :3].mean(), truth[rows, columns].mean()
            # in 4.5 shadow rays and other paths end at other surfaces: no one limit has both
            assert abs(mine / right - 1) < (0.02 if FIVE else 0.06), (columns, rows, mine / right)
