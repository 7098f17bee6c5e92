"""Things with their shadows in an artist's footage, wherever that comes from."""

from __future__ import annotations

import struct

import bpy
import numpy as np
import OpenImageIO
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender.colour import working_space
from arto.arto_addon.plate import plate
from arto.arto_addon.plate.footage import footage
from arto.arto_addon.plate.names import relit_file
from arto.arto_addon.relight import relight
from arto.arto_addon.world import kept
from arto.core import exr
from arto.core.errors import SceneError
from arto.core.light.light import PatchLight
from scene_tools import (
    captured,
    composited,
    in_compositor,
    small_scene,
)
from shot_tools import footage_of, relit_and_share, with_catcher


def test_footage_is_put_behind_in_its_colour_space(tmp_path):
    """An sRGB picture is brought to scene-linear; where no shadow falls, it is what was filmed."""
    scene = with_catcher(tmp_path, samples=8, patches=1)
    image = footage_of(scene, tmp_path)
    captured(scene)
    picture, share = relit_and_share(scene)
    comp = exr.read(plate.comp_file(relit_file(scene)))[""]
    encoded = np.array([64, 128, 191]) / 255
    linear = ((encoded + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(comp, picture[..., :3] + share * linear, atol=2e-3)
    image.filepath = str(tmp_path / "gone.png")
    with pytest.raises(SceneError, match="find it"):
        relit_and_share(scene)


def test_the_setting_goes_before_the_camera_and_a_moved_background_is_said(tmp_path):
    scene = with_catcher(tmp_path, samples=4, patches=1)
    footage_of(scene, tmp_path)
    captured(scene)
    scene.camera.data.background_images[0].scale = 2.0
    with pytest.raises(SceneError, match="scaled"):
        relit_and_share(scene)
    grey = bpy.data.images.new("Grey", 48, 36, float_buffer=True)
    grey.pixels.foreach_set(np.full(48 * 36 * 4, 0.5, np.float32))
    grey.pack()
    grey.colorspace_settings.name = working_space()
    scene.arto.footage = grey
    picture, share = relit_and_share(scene)
    comp = exr.read(plate.comp_file(relit_file(scene)))[""]
    np.testing.assert_allclose(comp, picture[..., :3] + 0.5 * share, atol=1e-5)


def test_the_group_puts_footage_behind(tmp_path):
    """The plate's node group, in Blender's compositor, gives what the core's arithmetic gives."""
    scene = with_catcher(tmp_path, samples=8, patches=1)
    captured(scene)
    picture, share = relit_and_share(scene)
    node = in_compositor(scene, bpy.data.node_groups["ARTO Relit"], "Composite")
    node.inputs["Footage"].default_value = (0.2, 0.4, 0.6, 1)
    found = composited(scene, tmp_path)[..., :3]
    np.testing.assert_allclose(found, picture[..., :3] + share * (0.2, 0.4, 0.6), atol=1e-4)


@pytest.mark.parametrize("kind", ["sequence", "clip"])
def test_footage_of_the_frame(tmp_path, kind):
    """A sequence or a movie clip behind the camera shows the scene's frame."""
    scene = with_catcher(tmp_path, samples=4, patches=1)
    first = str(filmed(tmp_path, 0.2, 0.6))
    camera = scene.camera.data
    camera.show_background_images = True
    behind = camera.background_images.new()
    if kind == "sequence":
        behind.image = bpy.data.images.load(first)
        behind.image.source = "SEQUENCE"
        behind.image_user.frame_duration, behind.image_user.frame_start = 2, 1
    else:
        behind.source, behind.clip = "MOVIE_CLIP", bpy.data.movieclips.load(first)
    for frame, grey in ((1, 0.2), (2, 0.6)):
        scene.frame_set(frame)
        found = footage(scene).read(scene)
        encoded = round(grey * 255) / 255
        linear = ((encoded + 0.055) / 1.055) ** 2.4
        np.testing.assert_allclose(found, linear, atol=2e-3)


def test_light_can_be_added_instead(tmp_path):
    """Over the ground itself, as ARTO shows it alone, the comp is the picture of all."""
    scene = with_catcher(tmp_path, samples=16, patches=1)
    captured(scene)
    path, _ = work.run(relight.relight(scene))
    shown = relight.Shown(scene, scene.view_layers[0].name)
    light = PatchLight(kept.environment(scene, scene.arto.environment_width), shown.field.hemicube)
    whole, ground, _ = shown.pictures([light])[0]
    grey = bpy.data.images.new("Ground", 24, 18, float_buffer=True)
    grey.colorspace_settings.name = working_space()
    rgba = np.dstack([ground[..., :3], np.ones(ground.shape[:2])]).astype(np.float32)
    grey.pixels.foreach_set(rgba[::-1].ravel())
    grey.pack()
    scene.arto.footage, scene.arto.shadows = grey, "ADD"
    relit_and_share(scene)
    comp = exr.read(plate.comp_file(path))[""]
    np.testing.assert_allclose(comp, whole[..., :3], atol=2e-3)
    assert plate.light_file(path).is_file()


def filmed(tmp_path, *greys):
    """Pictures of a grey, numbered, as 8-bit files."""
    for frame, grey in enumerate(greys, 1):
        image = bpy.data.images.new(f"Frame{frame}", 24, 18)
        image.pixels.foreach_set(np.tile(np.float32([grey, grey, grey, 1]), 24 * 18))
        image.filepath_raw = str(tmp_path / f"filmed_{frame:04d}.png")
        image.file_format = "PNG"
        image.save()
    return tmp_path / "filmed_0001.png"


def test_a_chosen_sequence_shows_the_picture_of_the_frames_number(tmp_path):
    """And where one is not there, that is said: no other is taken for it."""
    scene = with_catcher(tmp_path, samples=4, patches=1)
    scene.arto.footage = bpy.data.images.load(str(filmed(tmp_path, 0.2, 0.4, 0.6)))
    scene.arto.footage.source = "SEQUENCE"
    for frame, grey in ((1, 0.2), (3, 0.6), (2, 0.4)):
        scene.frame_set(frame)
        linear = ((round(grey * 255) / 255 + 0.055) / 1.055) ** 2.4
        np.testing.assert_allclose(footage(scene).read(scene), linear, atol=2e-3)
    scene.frame_set(4)
    with pytest.raises(SceneError, match=r"of frame 4 .* is not there"):
        footage(scene).read(scene)


def sequence(folder, kind):
    """Three pictures of a ramp, `filmed_0001` to `filmed_0003` -> the path of the first."""
    for frame in (1, 2, 3):
        path = folder / f"filmed_{frame:04d}.{kind}"
        spec = OpenImageIO.ImageSpec(24, 18, 3, "half" if kind == "exr" else "uint8")
        if kind == "exr":
            spec.attribute("compression", "piz")
        file = OpenImageIO.ImageOutput.create(str(path))
        ramp = np.linspace(0, 1 / frame, 18 * 24 * 3, dtype=np.float32).reshape(18, 24, 3)
        assert file.open(str(path), spec) and file.write_image(ramp)
        file.close()
    return folder / f"filmed_0001.{kind}"


def gone(path):
    path.unlink()


def flipped(path):
    data = bytearray(path.read_bytes())
    at = len(data) // 2
    if path.suffix == ".exr":
        # the only chunk, which its place in the table before it points to: its first bytes are
        # PIZ's tables, and what PIZ packs has no checksum
        at = next(i for i in range(len(data)) if data[i : i + 8] == struct.pack("<Q", i + 8)) + 16
    data[at : at + 40] = b"\xff" * 40
    path.write_bytes(data)


def cut(path):
    path.write_bytes(path.read_bytes()[:-30])


def smaller(path):
    spec = OpenImageIO.ImageSpec(12, 9, 3, "half" if path.suffix == ".exr" else "uint8")
    file = OpenImageIO.ImageOutput.create(str(path))
    assert file.open(str(path), spec) and file.write_image(np.ones((9, 12, 3), np.float32))
    file.close()


def behind_camera(scene, path):
    camera = scene.camera.data
    camera.show_background_images = True
    behind = camera.background_images.new()
    behind.image = bpy.data.images.load(str(path))
    behind.image.source = "SEQUENCE"
    behind.image_user.frame_duration, behind.image_user.frame_start = 3, 1


def as_setting(scene, path):
    scene.arto.footage = bpy.data.images.load(str(path))
    scene.arto.footage.source = "SEQUENCE"


def as_clip(scene, path):
    scene.camera.data.show_background_images = True
    behind = scene.camera.data.background_images.new()
    behind.source, behind.clip = "MOVIE_CLIP", bpy.data.movieclips.load(str(path))


# all that can be wrong of each kind of file, and two of it wherever footage may be
WRONG = [
    *((as_setting, what, kind) for what in (gone, cut, smaller) for kind in ("exr", "png", "jpg")),
    *((as_setting, flipped, kind) for kind in ("exr", "png")),  # a JPEG has no checksum
    *((where, what, "exr") for where in (behind_camera, as_clip) for what in (gone, smaller)),
]


@pytest.mark.parametrize(("where", "what", "kind"), WRONG)
def test_a_sequence_of_footage_is_looked_at_frame_by_frame(tmp_path, where, what, kind):
    """A picture that is missing, damaged or of another size is no picture of another frame."""
    scene = small_scene(tmp_path)
    path = sequence(tmp_path, kind)
    where(scene, path)
    for frame in (1, 2, 3):
        scene.frame_set(frame)
        assert footage(scene).check(scene) == ""
        assert footage(scene).shown(scene) == f"filmed_{frame:04d}.{kind}"
    what(tmp_path / f"filmed_0003.{kind}")
    scene.frame_set(2)
    assert footage(scene).check(scene) == ""
    scene.frame_set(3)
    for look in (footage(scene).check, footage(scene).read):
        with pytest.raises(SceneError, match="filmed_0003"):
            look(scene)


def test_footage_that_does_not_last_is_warned_of(tmp_path):
    """Blender holds the last picture."""
    scene = small_scene(tmp_path)
    behind_camera(scene, sequence(tmp_path, "png"))
    for frame, words in ((3, ""), (4, "does not last until frame 4")):
        scene.frame_set(frame)
        assert words in footage(scene).check(scene) and bool(words) == (frame == 4)
        assert footage(scene).shown(scene) == "filmed_0003.png"
    scene.camera.data.background_images[0].image_user.use_cyclic = True
    assert footage(scene).check(scene) == ""
    assert footage(scene).shown(scene) == "filmed_0001.png"


def test_one_picture_of_a_sequence_is_warned_of(tmp_path):
    """Chosen as a single image, it would be behind all frames."""
    scene = small_scene(tmp_path)
    scene.arto.footage = bpy.data.images.load(str(sequence(tmp_path, "png")))
    for frame, warns in ((1, False), (2, True), (7, False)):
        scene.frame_set(frame)
        assert ("Image Sequence" in footage(scene).check(scene)) == warns


@pytest.mark.parametrize("what", ["truncated", "nan"])
def test_footage_that_is_no_picture_is_said_before_anything_is_written(tmp_path, what):
    scene = with_catcher(tmp_path, samples=4, patches=1)
    captured(scene)
    if what == "truncated":
        path = filmed(tmp_path, 0.5)
        path.write_bytes(path.read_bytes()[:60])
        match = "damaged or cut off"
    else:
        path, match = tmp_path / "filmed.exr", "1 pixels that are infinite or not a number"
        pixels = np.ones((18, 24, 4), np.float32)
        pixels[3, 3, 0] = np.nan
        exr.write(path, {"": pixels}, finite=False)
    scene.arto.footage = bpy.data.images.load(str(path))
    scenes = len(bpy.data.scenes)
    with pytest.raises(SceneError, match=match):
        relit_and_share(scene)
    assert not relit_file(scene).exists() and len(bpy.data.scenes) == scenes


def in_file(path, pixels, data=(0, 0), display=None):
    """A float EXR (H, W, C) as another program writes it, its pixels from `data` (x, y) on."""
    height, width, channels = pixels.shape
    spec = OpenImageIO.ImageSpec(width, height, channels, "float")
    spec.x, spec.y = data
    spec.full_width, spec.full_height = display or (width, height)
    file = OpenImageIO.ImageOutput.create(str(path))
    assert file.open(str(path), spec) and file.write_image(np.ascontiguousarray(pixels))
    file.close()
    return path


def chosen(scene, path, space=None):
    scene.arto.footage = bpy.data.images.load(str(path))
    if space:
        scene.arto.footage.colorspace_settings.name = space
    return footage(scene)


RAMPS = np.random.default_rng(1).uniform(0.1, 2, (18, 24, 3)).astype(np.float32)


@pytest.mark.parametrize("size", [(1, 1), (9, 12), (17, 23)])
def test_small_footage_is_whole_up_to_its_rim(tmp_path, size):
    """Blender lets it fade out there: an even grey was an eighth of itself in the corners."""
    scene = with_catcher(tmp_path)
    found = chosen(scene, in_file(tmp_path / "grey.exr", np.full((*size, 3), 0.5, np.float32)))
    np.testing.assert_allclose(found.read(scene), 0.5, rtol=1e-5)


@pytest.mark.parametrize("factor", [2, 3, 4])
@pytest.mark.parametrize("kind", ["file", "sequence"])
def test_large_footage_is_averaged(tmp_path, factor, kind):
    scene = with_catcher(tmp_path)
    fine = np.random.default_rng(0).uniform(0, 2, (18 * factor, 24 * factor, 3))
    found = chosen(scene, in_file(tmp_path / "fine_0001.exr", fine.astype(np.float32)))
    if kind == "sequence":
        scene.arto.footage.source = "SEQUENCE"
        found = footage(scene)
    means = fine.reshape(18, factor, 24, factor, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(found.read(scene), means, rtol=1e-4)


@pytest.mark.parametrize("space", ["Linear Rec.709", "AgX Log"])
@pytest.mark.parametrize("kind", ["crop", "overscan", "beside"])
def test_footage_stands_where_its_data_window_is(tmp_path, space, kind):
    """A file that is cropped, or has more than its frame: Blender shows its pixels as the frame."""
    scene = with_catcher(tmp_path)
    whole = chosen(scene, in_file(tmp_path / "whole.exr", RAMPS), space).read(scene)
    assert (np.abs(whole - RAMPS).max() < 1e-5) == (space == "Linear Rec.709")
    if kind == "crop":
        there = np.s_[5:14, 6:18]
        path = in_file(tmp_path / "part.exr", RAMPS[there], (6, 5), (24, 18))
    elif kind == "overscan":
        there, more = np.s_[:, :], np.pad(RAMPS, ((2, 2), (3, 3), (0, 0)), constant_values=9)
        path = in_file(tmp_path / "part.exr", more, (-3, -2), (24, 18))
    else:
        there = np.s_[10:, 20:]
        more = np.pad(RAMPS[there], ((0, 4), (0, 5), (0, 0)))
        path = in_file(tmp_path / "part.exr", more, (20, 10), (24, 18))
    found = chosen(scene, path, space).read(scene)
    expected = np.zeros_like(whole)
    expected[there] = whole[there]
    np.testing.assert_allclose(found, expected, atol=1e-5)


@pytest.mark.parametrize("kind", ["sequence", "clip"])
def test_the_data_window_of_the_frame(tmp_path, kind):
    """Each picture of a sequence has its own."""
    scene = with_catcher(tmp_path)
    for frame, x in ((1, 2), (2, 9)):
        in_file(tmp_path / f"part.{frame:04d}.exr", RAMPS[4:9, x : x + 6], (x, 4), (24, 18))
    if kind == "sequence":
        chosen(scene, tmp_path / "part.0001.exr")
        scene.arto.footage.source = "SEQUENCE"
    else:
        camera = scene.camera.data
        camera.show_background_images = True
        behind = camera.background_images.new()
        behind.source = "MOVIE_CLIP"
        behind.clip = bpy.data.movieclips.load(str(tmp_path / "part.0001.exr"))
        behind.clip.frame_start = 11
    for frame, x in ((1, 2), (2, 9)):
        scene.frame_set(frame + 10 * (kind == "clip"))
        expected = np.zeros_like(RAMPS)
        expected[4:9, x : x + 6] = RAMPS[4:9, x : x + 6]
        np.testing.assert_allclose(footage(scene).read(scene), expected, atol=1e-5)


def test_footage_of_the_delivered_size_is_behind_what_is_delivered(tmp_path):
    """With an overscan it was stretched over that, too."""
    scene = with_catcher(tmp_path)
    scene.arto.overscan = 3
    found = chosen(scene, in_file(tmp_path / "delivered.exr", RAMPS[:12, :18])).read(scene)
    np.testing.assert_allclose(found, np.pad(RAMPS[:12, :18], ((3, 3), (3, 3), (0, 0))), atol=1e-5)
    # one that has the overscan itself, as pixels or beyond its frame, has it here
    found = chosen(scene, in_file(tmp_path / "all.exr", RAMPS)).read(scene)
    np.testing.assert_allclose(found, RAMPS, atol=1e-5)
    path = in_file(tmp_path / "beyond.exr", RAMPS, (-3, -3), (18, 12))
    np.testing.assert_allclose(chosen(scene, path).read(scene), RAMPS, atol=1e-5)


def test_of_a_file_of_layers_the_beauty_is_the_footage(tmp_path):
    """Blender has no output Image of it: that was a KeyError."""
    scene = with_catcher(tmp_path)
    path = tmp_path / "layers.exr"
    whole = np.dstack([RAMPS, np.ones((18, 24, 1), np.float32)])
    exr.write_layered(path, whole, {"LG_key": RAMPS / 2}, {}, working_space())
    np.testing.assert_allclose(chosen(scene, path).read(scene), RAMPS, atol=1e-3)


def test_footage_is_opaque(tmp_path):
    """Whatever its alpha is, nothing is behind it."""
    scene = with_catcher(tmp_path)
    alpha = np.zeros((18, 24, 1), np.float32)
    path = in_file(tmp_path / "clear.exr", np.dstack([RAMPS, alpha]))
    np.testing.assert_allclose(chosen(scene, path).read(scene), RAMPS, atol=1e-5)
    # black is a picture, and no missing one
    path = in_file(tmp_path / "black.exr", np.zeros((18, 24, 3), np.float32))
    assert not chosen(scene, path).read(scene).any()
