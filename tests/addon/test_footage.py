"""Things with their shadows in an artist's footage, wherever that comes from."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender.colour import working_space
from arto.arto_addon.relight import plate, relight
from arto.arto_addon.relight.footage import footage
from arto.arto_addon.shot import paths
from arto.arto_addon.world import kept
from arto.core import exr
from arto.core.errors import SceneError
from arto.core.light import PatchLight
from scene_tools import (
    captured,
    composited,
    in_compositor,
)
from shot_tools import footage_of, relit_and_share, with_catcher


def test_footage_is_put_behind_in_its_colour_space(tmp_path):
    """An sRGB picture is brought to scene-linear; where no shadow falls, it is what was filmed."""
    scene = with_catcher(tmp_path, samples=8, patches=1)
    image = footage_of(scene, tmp_path)
    captured(scene)
    picture, share = relit_and_share(scene)
    comp = exr.read(plate.comp_file(paths.relit_file(scene)))[""]
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
    comp = exr.read(plate.comp_file(paths.relit_file(scene)))[""]
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
    with pytest.raises(SceneError, match="at frame 4"):
        footage(scene).read(scene)


@pytest.mark.parametrize("what", ["truncated", "nan"])
def test_footage_that_is_no_picture_is_said_before_anything_is_written(tmp_path, what):
    scene = with_catcher(tmp_path, samples=4, patches=1)
    captured(scene)
    if what == "truncated":
        path = filmed(tmp_path, 0.5)
        path.write_bytes(path.read_bytes()[:60])
        match = "shows nothing"
    else:
        path, match = tmp_path / "filmed.exr", "1 pixels that are infinite or not a number"
        pixels = np.ones((18, 24, 4), np.float32)
        pixels[3, 3, 0] = np.nan
        exr.write(path, {"": pixels})
    scene.arto.footage = bpy.data.images.load(str(path))
    scenes = len(bpy.data.scenes)
    with pytest.raises(SceneError, match=match):
        relit_and_share(scene)
    assert not paths.relit_file(scene).exists() and len(bpy.data.scenes) == scenes
