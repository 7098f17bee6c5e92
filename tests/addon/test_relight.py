"""Relighting in Blender: against Cycles, and what it leaves in the file."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender import denoise
from arto.arto_addon.blender.compositing import add_output, compositor, new_compositor
from arto.arto_addon.fit import fit
from arto.arto_addon.plate import plate
from arto.arto_addon.relight import relight
from arto.arto_addon.shot import paths
from arto.arto_addon.world.bake import bake
from arto.core import exr
from arto.core.errors import ArtoError, CaptureSetError, FieldError, SceneError
from arto.core.field.field import Field
from arto.core.light.light import PatchLight
from arto.core.metrics import mean_relative_error
from arto.core.relight import relight as relight_field
from scene_tools import (
    add_mesh,
    captured,
    cycles,
    differences,
    hdri,
    material,
    set_colour,
    small_scene,
    smooth,
    snapshot,
    world_volume,
)
from shot_tools import relit, run_all


def transparent(scene):
    scene.render.film_transparent = True
    return scene


def test_white_world_is_met_within_noise(tmp_path):
    scene = transparent(small_scene(tmp_path))
    scene.arto.samples = 1024
    set_colour(scene, (1, 1, 1))
    picture = run_all(scene)
    one, two = (cycles(scene, 1024, seed, tmp_path) for seed in (1, 2))
    seen = one[..., 3] > 0.999
    floor = mean_relative_error(one[..., :3], two[..., :3], seen)
    assert mean_relative_error(picture[..., :3], one[..., :3], seen) < 1.5 * floor
    assert abs(picture[seen].mean() / one[seen].mean() - 1) < 0.005
    np.testing.assert_allclose(picture[..., 3], one[..., 3], atol=0.05)


@pytest.mark.newest
def test_smooth_world_is_met(tmp_path):
    """Directions are right: a world with a colour for each direction, on a scene with mirrors."""
    scene = transparent(small_scene(tmp_path))
    scene.arto.samples, scene.arto.patches = 512, 4
    hdri(scene, smooth(), rotation=0.5)
    picture = run_all(scene)
    one, two = (cycles(scene, 1024, seed, tmp_path) for seed in (1, 2))
    seen = one[..., 3] > 0.999
    floor = mean_relative_error(one[..., :3], two[..., :3], seen)
    error = mean_relative_error(picture[..., :3], one[..., :3], seen)
    assert error < floor + 0.03, (error, floor)


@pytest.mark.newest
def test_turning_world_and_hemicube_together_changes_nothing(tmp_path):
    """The same directions carry the same light whichever patch they fall on: with the hemicube
    turned, the picture under the same world is the same within noise."""
    pictures = []
    for turn, seed in ((0.0, 1), (0.0, 2), (math.radians(30), 3)):
        scene = transparent(small_scene(tmp_path))
        scene.arto.samples, scene.arto.patches = 512, 3
        scene.arto.rotation, scene.arto.seed = turn, seed
        hdri(scene, smooth())
        pictures.append(run_all(scene)[..., :3])
    one, two, turned = pictures
    floor = mean_relative_error(one, two)
    assert mean_relative_error(turned, one) < floor + 0.02
    assert abs(turned.mean() / one.mean() - 1) < 0.01


def test_own_lamps_are_added_and_can_be_switched_off(tmp_path):
    scene = transparent(small_scene(tmp_path, lamp=True))
    set_colour(scene, (0.3, 0.3, 0.3))
    both = run_all(scene)
    scene.arto.own_lamps = 0
    world_only = relit(scene)
    lamp = both[..., :3] - world_only[..., :3]
    scene.arto.own_lamps = 2
    twice = relit(scene)[..., :3] - world_only[..., :3]
    assert lamp.mean() > 0.05
    np.testing.assert_allclose(twice, 2 * lamp, atol=1e-5 + 1e-3 * lamp.max())


def test_world_stands_behind_where_the_film_is_not_transparent(tmp_path):
    scene = small_scene(tmp_path)
    scene.camera.rotation_euler.x = math.radians(90)
    scene.camera.location.z = 1
    set_colour(scene, (0.1, 0.5, 0.9))
    picture = run_all(scene)
    assert (picture[..., 3] == 1).all()
    np.testing.assert_allclose(picture[0, :, :3].mean(axis=0), (0.1, 0.5, 0.9), rtol=0.02)


def test_image_file_and_compositor(tmp_path):
    scene = small_scene(tmp_path)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    scene.arto.output = ""
    scene.arto.folder = "//arto/"
    assert bpy.ops.arto.capture() == {"FINISHED"}
    assert bpy.ops.arto.fit() == {"FINISHED"}
    assert bpy.ops.arto.relight() == {"FINISHED"}
    path = tmp_path / "shot_relit.exr"
    picture = exr.read(path)[""]
    assert exr.header(path)["colorInteropID"] == "lin_rec709_scene"
    image = bpy.data.images["ARTO Relit"]
    assert image.is_float and image.alpha_mode == "PREMUL"
    assert image.colorspace_settings.name == "Linear Rec.709"
    pixels = np.array(image.pixels[:]).reshape(*picture.shape)[::-1]
    np.testing.assert_allclose(pixels, picture, atol=1e-6)
    tree = compositor(scene)
    nodes = [n for n in tree.nodes if n.bl_idname == "CompositorNodeGroup"]
    assert [n.node_tree.name for n in nodes] == ["ARTO Relit"]
    # again: the same image, the same node
    count = len(tree.nodes)
    set_colour(scene, (0.9, 0.1, 0.1))
    bpy.ops.arto.relight()
    assert compositor(scene) == tree and len(tree.nodes) == count
    assert len([i for i in bpy.data.images if i.name.startswith("ARTO")]) == 1
    again = np.array(bpy.data.images["ARTO Relit"].pixels[:]).reshape(*picture.shape)[::-1]
    np.testing.assert_allclose(again, exr.read(path)[""], atol=1e-6)
    assert not np.allclose(again, picture)


def test_compositor_of_the_artist_is_left_as_it_is(tmp_path):
    scene = small_scene(tmp_path)
    tree = new_compositor(scene, "Mine")
    render = tree.nodes.new("CompositorNodeRLayers")
    blur = tree.nodes.new("CompositorNodeBlur")
    out = add_output(tree)
    viewer = tree.nodes.new("CompositorNodeViewer")
    tree.links.new(render.outputs["Image"], blur.inputs["Image"])
    tree.links.new(blur.outputs[0], out.inputs[0])
    tree.links.new(blur.outputs[0], viewer.inputs["Image"])

    def links():
        return {(i.from_node.name, i.to_node.name, i.to_socket.name) for i in tree.links}

    before, nodes = links(), {n.name for n in tree.nodes}
    run_all(scene)
    assert links() == before
    assert len(tree.nodes) == len(nodes) + 1


def test_render_after_relighting_is_still_the_render(tmp_path):
    """A scene without a compositor gets one; what it renders is what it rendered before."""
    scene = transparent(small_scene(tmp_path))
    before = cycles(scene, 16, 1, tmp_path)
    run_all(scene)
    scene.cycles.samples, scene.cycles.seed = 16, 1
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.sample_clamp_indirect = 0
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = str(tmp_path / "after.exr")
    bpy.ops.render.render(write_still=True)
    after = next(iter(exr.read(tmp_path / "after.exr").values()))
    np.testing.assert_allclose(after[..., :3], before[..., :3], atol=1e-5)


def test_relight_changes_nothing_but_image_and_compositor(tmp_path):
    scene = small_scene(tmp_path)
    captured(scene)
    work.run(fit.fit(scene))
    relit(scene)
    before = snapshot()
    relit(scene)
    assert not differences(before, snapshot())


def test_order_of_work_and_other_shots(tmp_path):
    scene = small_scene(tmp_path)
    with pytest.raises(CaptureSetError, match="run Capture first"):
        work.run(fit.fit(scene))
    with pytest.raises(FieldError, match="run Fit first"):
        work.run(relight.relight(scene))
    captured(scene)
    work.run(fit.fit(scene))
    scene.camera.location.x += 0.5
    bpy.context.view_layer.update()
    with pytest.raises(CaptureSetError, match="another camera"):
        relit(scene)
    scene.camera.location.x -= 0.5
    bpy.context.view_layer.update()
    lens = scene.camera.data
    for name, value in (("lens", lens.lens + 5), ("shift_x", 0.1), ("type", "ORTHO")):
        before = getattr(lens, name)
        setattr(lens, name, value)
        with pytest.raises(CaptureSetError, match="another lens"):
            relit(scene)
        setattr(lens, name, before)
    with world_volume(scene), pytest.raises(SceneError, match="volume"):
        relit(scene)
    scene.render.resolution_x += 2
    with pytest.raises(CaptureSetError, match="another width"):
        work.run(fit.fit(scene))
    scene.render.resolution_x -= 2
    scene.frame_set(7)
    with pytest.raises(CaptureSetError, match="another frame"):
        relit(scene)
    scene.frame_set(1)
    # by another name it is the same scene, and finds what is its own
    scene.name = "Other"
    relit(scene)


def test_bad_output_and_bad_world_lose_nothing(tmp_path):
    scene = small_scene(tmp_path)
    run_all(scene)
    kept = (tmp_path / "relit.exr").read_bytes()
    scene.world, world = None, scene.world
    with pytest.raises(SceneError, match="no world"):
        relit(scene)
    scene.world = world
    blocked = tmp_path / "file"
    blocked.write_text("")
    scene.arto.output = str(blocked / "relit.exr")
    with pytest.raises(ArtoError, match="choose another"):
        relit(scene)
    assert (tmp_path / "relit.exr").read_bytes() == kept
    damaged = paths.field_folder(scene) / "tile_0000.arto"
    damaged.write_bytes(damaged.read_bytes()[:100])
    scene.arto.output = str(tmp_path / "relit.exr")
    with pytest.raises(FieldError, match="fit again"):
        relit(scene)
    assert plate.IMAGE in bpy.data.images


def test_denoising_brings_the_plate_nearer_to_the_truth(tmp_path):
    scene = transparent(small_scene(tmp_path))
    scene.arto.samples, scene.arto.patches = 8, 2
    hdri(scene, smooth())
    noisy = run_all(scene)
    scene.arto.denoise = True
    clean = relit(scene)
    truth = cycles(scene, 2048, 1, tmp_path)
    seen = truth[..., 3] > 0.999
    errors = [mean_relative_error(p[..., :3], truth[..., :3], seen) for p in (noisy, clean)]
    assert errors[1] < 0.8 * errors[0]
    assert abs(clean[seen].mean() / noisy[seen].mean() - 1) < 0.02
    np.testing.assert_array_equal(clean[..., 3], noisy[..., 3])
    header = exr.header(tmp_path / "relit.exr")
    assert header["arto.denoised"] == "Open Image Denoise"


def test_without_a_denoiser_the_plate_says_so(tmp_path, monkeypatch):
    """A build without Open Image Denoise hands pictures through: never silently."""
    scene = transparent(small_scene(tmp_path))
    noisy = run_all(scene)
    monkeypatch.setattr(denoise, "_available", [])
    monkeypatch.setattr(denoise, "denoise", lambda guides, *pictures: sum(pictures))
    scene.arto.denoise = True
    steps = []
    path, _ = work.run(relight.relight(scene), steps.append)
    np.testing.assert_array_equal(exr.read(path)[""], noisy)
    assert "without Open Image Denoise" in steps[-1].text
    assert "without Open Image Denoise" in exr.header(path)["arto.denoised"]


@pytest.mark.newest
def test_narrow_reflection_beats_sixteen_times_as_many_whole_patches(tmp_path):
    """A flat mirror: each pixel sees far less than a patch. 96 patches with a box show the world
    that 1,536 whole patches blur."""
    scene = transparent(small_scene(tmp_path))
    for thing in list(scene.objects):
        if thing.type == "MESH":
            bpy.data.objects.remove(thing)
    mirror = material("Mirror", Metallic=1.0, Roughness=0.0, Base_Color=(1, 1, 1, 1))
    corners = [(-9, 0, -9), (9, 0, -9), (9, 0, 9), (-9, 0, 9)]
    add_mesh(scene, "Mirror", corners, [(0, 1, 2, 3)], mirror)
    scene.camera.location, scene.camera.rotation_euler = (0, -6, 0), (math.pi / 2, 0, 0.3)
    rng = np.random.default_rng(0)
    # cells of 2.8 degrees: a pixel spans 2, a patch of 16x16 six
    hdri(scene, rng.lognormal(0, 0.7, (64, 128, 3)).repeat(4, 0).repeat(4, 1))
    errors = {}
    truth = cycles(scene, 512, 1, tmp_path)[..., :3]
    for name, patches, patterns in (("auto", 4, "moments"), ("whole", 16, "white")):
        scene.arto.patches, scene.arto.patterns = patches, patterns
        scene.arto.support, scene.arto.grain = name, name == "auto"
        errors[name] = mean_relative_error(run_all(scene)[..., :3], truth)
    assert errors["auto"] < 0.5 * errors["whole"], errors
    assert errors["auto"] < 0.1, errors


def test_plate_has_no_negative_light(tmp_path):
    """A sun in a corner of a patch, seen from its other side: the linear projection undershoots."""
    scene = transparent(small_scene(tmp_path))
    scene.arto.samples, scene.arto.support = 16, "linear"
    sky = np.full((64, 128, 3), 0.01)
    sky[14, 20] = 1e4
    hdri(scene, sky)
    picture = run_all(scene)
    field = Field(paths.field_folder(scene))
    assert relight_field(field, PatchLight(bake(scene, 1024), field.hemicube)).min() < -0.01
    assert picture.min() == 0
    assert picture.max() > 1


def test_a_support_for_each_channel_from_the_settings(tmp_path):
    scene = small_scene(tmp_path)
    scene.arto.support, scene.arto.separate = "box", True
    run_all(scene)
    assert set(Field(paths.field_folder(scene)).shares()) == {"box_rgb", "nothing"}
