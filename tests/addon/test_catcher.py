"""Shadow catchers: what Cycles makes of them is the truth."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.capture import capture, room
from arto.arto_addon.capture.sequence import capture_frames
from arto.arto_addon.fit import fit
from arto.arto_addon.plate import plate
from arto.arto_addon.plate.present import present_frames
from arto.arto_addon.relight.many import relight_many
from arto.arto_addon.shot import paths
from arto.core import exr
from arto.core.errors import CancelledError, FieldError, SceneError
from arto.core.field.field import Field
from scene_tools import (
    BOX,
    add_mesh,
    captured,
    composited,
    differences,
    hdri,
    in_compositor,
    instance_of,
    made_by_nodes,
    set_colour,
    smooth,
    snapshot,
)
from shot_tools import bare_of, cycles_catcher, relit_and_share, with_catcher


@pytest.mark.newest
def test_as_cycles_own_catcher(tmp_path):
    """Under a coloured sky: the light on the things, their outlines, the share of the footage in
    their shadows, each to within what two of Cycles' own renders differ by and a little."""
    scene = with_catcher(tmp_path, samples=512)
    captured(scene)
    picture, share = relit_and_share(scene)
    first, second = (cycles_catcher(scene, 512, s, tmp_path) for s in (1, 2))
    one, two = (cycles_catcher(scene, 512, s, tmp_path, share=False) for s in (1, 2))
    bare = bare_of(scene)
    assert 0.3 < bare.mean() < 0.9
    noise = np.abs(first - second)[bare].mean()
    assert np.abs(share - first)[bare].mean() < 2 * noise + 0.01
    assert abs(share[bare].mean() - first[bare].mean()) < 0.01
    assert first[bare].min() < 0.7  # there is a shadow at all
    floor = np.abs(one - two)[..., :3].mean()
    assert np.abs(picture - one)[..., :3].mean() < 2 * floor + 0.003
    np.testing.assert_allclose(picture[..., 3], one[..., 3], atol=0.1)
    assert np.abs(picture - one)[..., 3].mean() < 0.015


def test_without_things_the_footage_passes(tmp_path):
    scene = with_catcher(tmp_path, samples=16, patches=1)
    for name in ("Matt", "Glossy"):
        scene.objects[name].hide_render = True
    captured(scene)
    picture, share = relit_and_share(scene)
    np.testing.assert_allclose(share, 1, atol=1e-4)
    np.testing.assert_allclose(picture, 0, atol=1e-4)


def test_the_artists_flags_are_put_back(tmp_path, monkeypatch):
    scene = with_catcher(tmp_path, samples=4, patches=1)
    scene.objects["Glossy"].visible_glossy = False
    before = snapshot()
    captured(scene)
    assert not differences(before, snapshot())

    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(work, "blocking_render", interrupt)
    scene.arto.samples = 5
    before = snapshot()
    with pytest.raises(CancelledError):
        captured(scene)
    assert not differences(before, snapshot())


@pytest.mark.parametrize("how", ["instance", "library", "nodes"])
def test_however_a_catcher_comes_into_the_scene(tmp_path, how):
    """In an instance of an instance, in a linked file, made by geometry nodes: one share of all."""
    scene = with_catcher(tmp_path, samples=16, patches=1)
    captured(scene)
    _, expected = relit_and_share(scene)
    floor = scene.objects["Floor"]
    kept, outer = bpy.data.collections.new("Kept"), bpy.data.collections.new("Outer")
    scene.collection.objects.unlink(floor)
    kept.objects.link(floor)
    if how == "instance":
        instance_of(kept, outer)
        instance_of(outer, scene.collection)
    elif how == "library":
        file = tmp_path / "library.blend"
        bpy.data.libraries.write(str(file), {kept})
        bpy.data.batch_remove([kept, floor])
        with bpy.data.libraries.load(str(file), link=True) as (_, to):
            to.collections = ["Kept"]
        scene.collection.children.link(to.collections[0])
    else:
        made_by_nodes(floor, add_mesh(scene, "Maker", [], []))
    captured(scene)
    _, share = relit_and_share(scene)
    np.testing.assert_allclose(share, expected, atol=0.02)


def test_what_makes_a_catcher_must_not_be_a_thing(tmp_path):
    scene = with_catcher(tmp_path, samples=4, patches=1)
    scene.objects["Floor"].parent = scene.objects["Matt"]
    scene.objects["Matt"].instance_type = "VERTS"
    scene.objects["Matt"].show_instancer_for_render = True
    with pytest.raises(SceneError, match="an object of its own"):
        captured(scene)


def test_what_an_instance_makes_a_catcher_must_not_be_a_thing(tmp_path):
    """Hidden as a thing it would be hidden as a catcher, and shadows on it were too dark."""
    scene = with_catcher(tmp_path, samples=4, patches=1)
    boxes = bpy.data.collections.new("Boxes")
    boxes.objects.link(scene.objects["Matt"])
    empty = instance_of(boxes, scene.collection)
    empty.location, empty.is_shadow_catcher = (0, 2, 0), True
    with pytest.raises(SceneError, match="'Matt' is in the picture both as"):
        captured(scene)
    # by itself it may be one
    scene.collection.objects.unlink(scene.objects["Matt"])
    captured(scene)


def test_an_animated_flag_is_refused(tmp_path):
    scene = with_catcher(tmp_path, samples=4, patches=1)
    scene.objects["Floor"].keyframe_insert("is_shadow_catcher", frame=1)
    with pytest.raises(SceneError, match="animated"):
        captured(scene)


def test_stopped_between_takes_it_goes_on(tmp_path, monkeypatch):
    """What was rendered is not rendered again, whichever take was the last."""
    scene = with_catcher(tmp_path, samples=4, patches=1)
    renders = []

    def run(most):
        count = 0
        steps = capture.capture(scene, scene.view_layers[0].name)
        for step in steps:
            if isinstance(step, work.Render):
                long = "basis images" in step.text
                count += long
                if count > most:
                    steps.close()
                    return
                if long:
                    renders.append(bpy.data.scenes[step.scene].render.filepath)
                work.blocking_render(step)

    for _ in range(2):
        run(1)
        with pytest.raises(FieldError):
            Field(paths.field_folder(scene))
    run(1)
    assert len(renders) == 3 and len(set(renders)) == 3
    picture, share = relit_and_share(scene)
    assert picture.shape[:2] == share.shape[:2]


def test_kept_images_fit_to_the_same(tmp_path):
    scene = with_catcher(tmp_path, samples=8, patches=1)
    captured(scene)
    expected = relit_and_share(scene)
    scene.arto.keep = "always"
    captured(scene)
    work.run(fit.fit(scene))
    for one, two in zip(relit_and_share(scene), expected, strict=True):
        np.testing.assert_allclose(one, two, atol=1e-6)


def test_takes_of_two_captures_are_not_mixed(tmp_path):
    scene = with_catcher(tmp_path, samples=4, patches=1)
    captured(scene)
    beside = paths.field_folder(scene).parent / "ground"
    beside.rename(tmp_path / "old")
    scene.arto.samples = 5
    captured(scene)
    beside.rename(tmp_path / "new")
    (tmp_path / "old").rename(beside)
    with pytest.raises(FieldError, match="run Capture again"):
        relit_and_share(scene)


@pytest.mark.newest
def test_lamps_of_the_world_fall_on_both(tmp_path):
    """A sun in the map, rendered by itself, throws its shadow onto the ground."""
    scene = with_catcher(tmp_path, samples=128)
    image = smooth()
    image[10:13, 40:43] += 400.0
    hdri(scene, image)
    scene.arto.lamps, scene.arto.lamp_samples = True, 256
    captured(scene)
    _, share = relit_and_share(scene)
    first, second = (cycles_catcher(scene, 512, s, tmp_path) for s in (1, 2))
    bare = bare_of(scene)
    noise = np.abs(first - second)[bare].mean()
    assert np.abs(share - first)[bare].mean() < 2 * noise + 0.02


def test_opaque_film_shows_the_world_in_shadow(tmp_path):
    """As Cycles has it: the world behind, darkened by the grey of the shadow."""
    scene = with_catcher(tmp_path, samples=128)
    set_colour(scene, (1, 1, 1))
    scene.render.film_transparent = False
    captured(scene)
    picture, _ = relit_and_share(scene)
    one, two = (cycles_catcher(scene, 512, s, tmp_path, share=False) for s in (1, 2))
    assert (picture[..., 3] == 1).all()
    noise = np.abs(one - two)[..., :3].mean()
    assert np.abs(picture - one)[..., :3].mean() < 2 * noise + 0.02


def test_names_of_shapes(tmp_path):
    """A box that throws no shadow is no shadow of it: the flags that the artist set stay."""
    scene = with_catcher(tmp_path, samples=64, patches=1)
    box = add_mesh(scene, "Quiet", *BOX)
    box.location, box.scale = (0, -3, 2), (0.5, 0.5, 0.5)
    for name in ("Matt", "Glossy"):
        scene.objects[name].hide_render = True
    box.visible_diffuse = box.visible_shadow = box.visible_camera = False
    box.visible_glossy = box.visible_transmission = False
    captured(scene)
    _, share = relit_and_share(scene)
    np.testing.assert_allclose(share, 1, atol=0.05)


def test_frames_with_a_catcher(tmp_path):
    """A moving thing throws its shadow where it is, frame by frame."""
    scene = with_catcher(tmp_path, samples=16, patches=1)
    scene.objects["Glossy"].hide_render = True
    box = scene.objects["Matt"]
    for frame, x in ((1, -2.0), (2, 2.0)):
        box.location.x = x
        box.keyframe_insert("location", frame=frame)
    layer = scene.view_layers[0].name
    work.run(capture_frames(scene, layer, [1, 2]))
    done = work.run(relight_many(scene, layer, frames=[1, 2]))
    left, right = (exr.read(plate.share_file(p))[""].mean(axis=-1) for p in done)
    half = left.shape[1] // 2
    assert left[:, :half].mean() < left[:, half:].mean() - 0.02
    assert right[:, half:].mean() < right[:, :half].mean() - 0.02
    # and in the compositor: the footage of each frame has that frame's shadow
    present_frames(scene, done[0], [1, 2])
    node = in_compositor(scene, bpy.data.node_groups["ARTO Relit Frames"], "Composite")
    node.inputs["Footage"].default_value = (0.5, 0.5, 0.5, 1)
    for frame, path in zip((1, 2), done, strict=True):
        scene.frame_set(frame)
        expected = exr.read(path)[""][..., :3] + 0.5 * exr.read(plate.share_file(path))[""]
        found = composited(scene, tmp_path)
        np.testing.assert_allclose(found[..., :3], expected, atol=2e-3)


@pytest.mark.newest
def test_an_earlier_capture_stays_whole_until_the_new_one_is(tmp_path):
    """Stopped in its last take, a new capture has replaced nothing of the old one."""
    scene = with_catcher(tmp_path, samples=4, patches=1)
    captured(scene)
    expected = relit_and_share(scene)
    scene.arto.samples = 5
    count = 0
    steps = capture.capture(scene, scene.view_layers[0].name)
    for step in steps:
        if isinstance(step, work.Render):
            count += "basis images" in step.text
            if count == 3:
                break
            work.blocking_render(step)
    steps.close()
    for one, two in zip(relit_and_share(scene), expected, strict=True):
        np.testing.assert_array_equal(one, two)
    captured(scene)
    assert Field(paths.field_folder(scene)).about.samples == 5
    relit_and_share(scene)
    # and without the catcher, there is one take again
    scene.objects["Floor"].is_shadow_catcher = False
    captured(scene)
    assert not (paths.field_folder(scene).parent / "ground").exists()


def test_all_takes_must_find_room(tmp_path, monkeypatch):
    """Before the first of them is rendered: the estimate and the disk are of all three."""
    scene = with_catcher(tmp_path, samples=4, patches=1)
    steps = lambda: capture.estimate(scene, scene.view_layers[0].name)  # noqa: E731
    three = work.run(steps())
    scene.objects["Floor"].is_shadow_catcher = False
    one = work.run(steps())
    assert three.renders == 3 * one.renders and three.kept == 3 * one.kept
    scene.objects["Floor"].is_shadow_catcher = True
    free = one.disk + one.kept  # room for one, and not for three
    real = room.shutil.disk_usage
    monkeypatch.setattr(room.shutil, "disk_usage", lambda p: real(p)._replace(free=int(free)))
    rendered = []
    with pytest.raises(SceneError, match=r"needs .* of disk"):
        for step in capture.capture(scene, scene.view_layers[0].name):
            if isinstance(step, work.Render):
                rendered.append(step.text)
                work.blocking_render(step)
    assert not any("basis images" in text for text in rendered)
