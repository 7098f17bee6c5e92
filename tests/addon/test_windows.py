"""Overscan and cropped files: every program sees each pixel where it belongs, Blender's own too."""

from __future__ import annotations

import bpy
import numpy as np
import OpenImageIO
import pytest
from arto.arto_addon import work
from arto.arto_addon.plate import plate
from arto.arto_addon.plate.names import relit_file
from arto.arto_addon.relight import relight
from arto.arto_addon.relight.many import relight_frames
from arto.core import exr
from arto.core.errors import ExrError
from scene_tools import captured, composited, in_compositor
from shot_tools import footage_of, with_catcher


@pytest.fixture
def shot(tmp_path):
    """A shot that has every file there is, its things on one side of the picture."""
    scene = with_catcher(tmp_path, samples=4, patches=1)
    scene.objects["Glossy"].hide_render = True
    scene.objects["Matt"].location = (-1.8, 2, 1)
    scene.objects["Floor"].scale = (0.75, 0.9, 1)
    scene.arto.layers, scene.arto.layers_half = "FACES", False
    scene.arto.write_data, scene.arto.shadows = True, "ADD"
    footage_of(scene, tmp_path)
    captured(scene)
    return scene


def files(scene):
    """What a relight has written for other programs, each as ARTO reads it."""
    path, _ = work.run(relight.relight(scene))
    made = (plate.share_file, plate.comp_file, plate.light_file, plate.layers_file, plate.data_file)
    return {file: exr.read(file) for file in (path, *(name(path) for name in made))}


def windows(path, part=0):
    """The data window and the display window that another reader finds."""
    spec = OpenImageIO.ImageBuf(str(path), part, 0).spec()
    return (spec.x, spec.y, spec.width, spec.height), (
        spec.full_x, spec.full_y, spec.full_width, spec.full_height,
    )  # fmt: skip


def test_every_file_has_the_windows_and_the_same_pixels(shot):
    before = files(shot)
    assert all(windows(path) == ((0, 0, 24, 18),) * 2 for path in before)
    shot.arto.overscan = 3
    for crop in (False, True):
        shot.arto.data_window = "CROP" if crop else "FULL"
        found = files(shot)
        assert found.keys() == before.keys()
        for path, layers in found.items():
            data, display = windows(path)
            assert display == (0, 0, 18, 12)
            for name, pixels in layers.items():
                was = before[path][name]
                # the depth of nothing is nothing, and is cropped
                was = np.where(was == 1e10, 0, was) if crop and name == "depth" else was
                np.testing.assert_array_equal(np.where(pixels == 1e10, was, pixels), was)
            # around what is there, of all layers of a file
            there = np.any([((p != 0) & (p < 1e10)).any(axis=-1) for p in layers.values()], axis=0)
            (rows, columns) = (there.any(axis=i).nonzero()[0] for i in (1, 0))
            if crop:
                size = int(np.ptp(columns)) + 1, int(np.ptp(rows)) + 1
                assert data == (columns[0] - 3, rows[0] - 3, *size)
            else:
                assert data == (-3, -3, 24, 18)
    path = relit_file(shot)
    assert windows(path)[0][2:] < (24, 18)  # there was something to crop
    # what is behind is seen beyond the ground: footage times it must not be black
    assert windows(plate.share_file(path))[0] == (-3, -3, 24, 18)
    assert windows(plate.full_file(path)) == ((-3, -3, 24, 18), (0, 0, 18, 12))


@pytest.mark.parametrize("overscan", [0, 3])
@pytest.mark.parametrize("window", ["FULL", "CROP"])
def test_blenders_compositor_does_not_shift(shot, tmp_path, window, overscan):
    """Plate, mixer and composite show in it what is in the files, where it is in them."""
    shot.arto.data_window, shot.arto.overscan = window, overscan
    path, _ = work.run(relight.relight(shot))
    picture, share = exr.read(path)[""], exr.read(plate.share_file(path))[""]
    image = bpy.data.images["ARTO Relit"]
    assert tuple(image.size) == (24, 18)
    pixels = np.empty(24 * 18 * 4, np.float32)
    image.pixels.foreach_get(pixels)
    np.testing.assert_array_equal(pixels.reshape(18, 24, 4)[::-1], picture)
    node = in_compositor(shot, bpy.data.node_groups["ARTO Relit"], "Image")
    np.testing.assert_allclose(composited(shot, tmp_path), picture, atol=1e-4)
    node = in_compositor(shot, bpy.data.node_groups["ARTO Relit"], "Composite")
    node.inputs["Footage"].default_value = (0.2, 0.4, 0.6, 1)
    found = composited(shot, tmp_path)[..., :3]
    np.testing.assert_allclose(found, picture[..., :3] + share * (0.2, 0.4, 0.6), atol=1e-4)
    in_compositor(shot, bpy.data.node_groups["ARTO Relit Mix"], "Image")
    np.testing.assert_allclose(composited(shot, tmp_path), picture, atol=1e-4)


def test_cropped_frames_are_a_sequence_of_whole_ones(shot, tmp_path):
    """Blender finds the pictures of a sequence by their numbers, also in the copies' names."""
    shot.arto.data_window, shot.arto.layers = "CROP", "OFF"
    background = shot.world.node_tree.nodes["Background"].inputs["Strength"]
    for frame, strength in ((1, 1.0), (2, 3.0)):
        background.default_value = strength
        background.keyframe_insert("default_value", frame=frame)
    done = work.run(relight_frames(shot, shot.view_layers[0].name, [1, 2]))
    group = bpy.data.node_groups["ARTO Relit Frames"]
    in_compositor(shot, group, "Image")
    means = []
    for frame, path in zip((1, 2), done, strict=True):
        shot.frame_set(frame)
        picture = exr.read(path)[""]
        np.testing.assert_allclose(composited(shot, tmp_path), picture, atol=1e-4)
        means.append(picture[..., :3].mean())
    assert means[1] == pytest.approx(3 * means[0], rel=1e-3)


def test_an_overscan_that_leaves_nothing_is_said_before_the_work(shot):
    shot.arto.overscan = 9
    path = relit_file(shot)
    with pytest.raises(ExrError, match="overscan of 9 pixels at each edge leaves nothing"):
        work.run(relight.relight(shot))
    assert not path.exists()
    shot.arto.overscan = -4
    assert shot.arto.overscan == 0  # the setting takes none


def test_frames_are_numbered_where_the_output_has_hashes(shot, tmp_path):
    """Under a look of a number, too: Blender's sequence finds the frames by the last number."""
    shot.arto.layers, shot.arto.look = "OFF", "key 2"
    shot.arto.output = str(tmp_path / "plates" / "sh010.###.exr")
    background = shot.world.node_tree.nodes["Background"].inputs["Strength"]
    for frame, strength in ((1, 1.0), (2, 3.0)):
        background.default_value = strength
        background.keyframe_insert("default_value", frame=frame)
    done = work.run(relight_frames(shot, shot.view_layers[0].name, [1, 2]))
    assert [path.name for path in done] == ["sh010_key 2.001.exr", "sh010_key 2.002.exr"]
    (group,) = (g for g in bpy.data.node_groups if g.name.endswith("Frames"))
    in_compositor(shot, group, "Image")
    for frame, path in zip((1, 2), done, strict=True):
        shot.frame_set(frame)
        np.testing.assert_allclose(composited(shot, tmp_path), exr.read(path)[""], atol=1e-4)
