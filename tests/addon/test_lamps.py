"""Suns and lamps of the world, rendered by themselves and put beside the field's light."""

from __future__ import annotations

import re

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender.nodes import new_world
from arto.arto_addon.fit import fit
from arto.arto_addon.plate.names import relit_file
from arto.arto_addon.relight import relight
from arto.arto_addon.relight.relight import narrow
from arto.arto_addon.shot import paths
from arto.arto_addon.stage import small
from arto.arto_addon.world import lamp_render as lamps
from arto.arto_addon.world.bake import bake
from arto.core import exr
from arto.core.errors import SceneError
from arto.core.field.field import Field
from arto.core.light.environment import Environment
from arto.core.light.lamps import split
from arto.core.light.light import PatchLight
from scene_tools import captured, cycles, differences, small_scene, snapshot


def sunny(scene, sun: float = 400.0, degrees: float = 4.0) -> None:
    """A soft sky and a sun of a few degrees, left of the camera and high, as an image."""
    height, width = 128, 256
    azimuth = (0.5 - (np.arange(width) + 0.5) / width) * 2 * np.pi
    up = ((np.arange(height) + 0.5) / height - 0.5)[:, None] * np.pi
    where_azimuth, where_up = np.radians(-140), np.radians(45)
    cosine = np.sin(up) * np.sin(where_up) + np.cos(up) * np.cos(where_up) * np.cos(
        azimuth - where_azimuth
    )
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :3] = (0.5 + 0.3 * np.sin(up))[..., None] * (0.6, 0.8, 1.0)
    rgba[cosine > np.cos(np.radians(degrees)), :3] = (sun, 0.9 * sun, 0.7 * sun)
    image = bpy.data.images.new("sunny", width, height, float_buffer=True)
    image.colorspace_settings.name = "Linear Rec.709"
    image.pixels.foreach_set(rgba.ravel())
    image.update()
    image.pack()
    tree = scene.world.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    tree.links.new(texture.outputs["Color"], tree.nodes["Background"].inputs["Color"])


@pytest.fixture(scope="module")
def shot(tmp_path_factory):
    """A scene with a sun in its world and a sun of its own, captured and fitted."""
    folder = tmp_path_factory.mktemp("lamps")
    scene = small_scene(folder, lamp=True)
    scene.render.film_transparent = True
    scene.arto.patches, scene.arto.samples = 2, 256
    scene.arto.patterns, scene.arto.grain = "linear", False
    sunny(scene)
    captured(scene)
    work.run(fit.fit(scene))
    scene.arto.lamps, scene.arto.lamp_samples = True, 256
    return scene


def relit(scene, **settings) -> tuple[np.ndarray, str]:
    were = {name: getattr(scene.arto, name) for name in settings}
    try:
        for name, value in settings.items():
            setattr(scene.arto, name, value)
        path, _ = work.run(relight.relight(scene))
        return exr.read(path)[""], exr.header(path)["arto.lamps"]
    finally:
        for name, value in were.items():
            setattr(scene.arto, name, value)


@pytest.mark.newest
def test_with_its_lamps_the_plate_is_what_cycles_renders(shot, tmp_path):
    """Against Cycles, beside the noise of two of its renders: four large patches a face blur a sun
    of eight degrees, a render of its own does not."""
    one, two = (cycles(shot, 512, seed, tmp_path)[..., :3] for seed in (1, 2))
    alpha = cycles(shot, 16, 0, tmp_path)[..., 3] > 0.999
    noise = np.abs(one - two)[alpha].mean()
    truth = (one + two) / 2
    picture, said = relit(shot)
    blurred, nothing = relit(shot, lamps=False)
    error = np.abs(picture[..., :3] - truth)[alpha].mean()
    assert error < 3 * noise
    assert error < np.abs(blurred[..., :3] - truth)[alpha].mean() / 2
    assert picture[..., :3][alpha].mean() == pytest.approx(truth[alpha].mean(), rel=0.02)
    assert "of the world's light" in said and nothing == "no"
    # no light stands where nothing is: a composite would add it to what is behind
    assert not picture[picture[..., 3] == 0].any()


@pytest.mark.newest
def test_lamps_and_rest_are_the_whole_light(shot):
    """Light is linear: the two renders add up to that of the whole map, and the scene's own lamp is
    in none of them."""
    field = Field(paths.field_folder(shot))
    whole = bake(shot, 256)
    parts = split(whole)
    assert 0.1 < parts.share < 0.9

    def light(environment: Environment) -> np.ndarray:
        return work.run(lamps.lamp_light(shot, field, environment, 512))

    total, ours = light(whole), light(parts.lamps) + light(parts.rest)
    assert ours.mean() == pytest.approx(total.mean(), rel=0.01)
    seen = field.layer("alpha") > 0.999
    own = field.layer("own")
    assert own[seen].mean() > 0.1
    rendered = cycles_without_own(shot, own)
    assert total[seen].mean() == pytest.approx(rendered[seen].mean(), rel=0.02)


def cycles_without_own(scene, own: np.ndarray) -> np.ndarray:
    from pathlib import Path

    return cycles(scene, 512, 5, Path(bpy.app.tempdir))[..., :3] - own


def test_the_scene_stays_as_it_is(shot):
    relit(shot)  # the first plate gets a place in the compositor
    before = snapshot()
    relit(shot)
    changed = [d for d in differences(before, snapshot()) if "ARTO" not in d]
    assert not changed
    assert not [i for i in bpy.data.images if i.name.startswith("ARTO Lamps")]
    assert not [w for w in bpy.data.worlds if w.name.startswith("ARTO Lamps")]


def test_a_world_without_lamps_needs_no_render(shot):
    kept = shot.world
    shot.world = new_world("Even")
    steps = []
    try:
        work.run(relight.relight(shot), steps.append)
    finally:
        shot.world = kept
    assert not [s for s in steps if isinstance(s, work.Render)]


def test_cancelling_the_lamps_leaves_nothing_behind(shot):
    worlds = len(bpy.data.worlds), len(bpy.data.images), len(bpy.data.scenes)
    steps = relight.relight(shot)
    for step in steps:
        if isinstance(step, work.Render):
            break
    steps.close()
    assert (len(bpy.data.worlds), len(bpy.data.images), len(bpy.data.scenes)) == worlds


def test_another_engine_meanwhile_changes_nothing(shot):
    """The artist looks at the scene with another engine: the lamps are Cycles' all the same."""
    expected, _ = relit(shot)
    shot.render.engine = "BLENDER_WORKBENCH"
    try:
        found, _ = relit(shot)
    finally:
        shot.render.engine = "CYCLES"
    np.testing.assert_array_equal(found, expected)


def test_pixels_that_are_no_number_are_said(shot, monkeypatch):
    """A broken material: a message, nothing written, nothing left behind."""
    before = relit(shot)[0]
    read = exr.Layers.read

    def broken(layers, name, *more):
        pixels = np.array(read(layers, name, *more))
        if name.endswith("ARTO_lamps"):
            pixels[3, 4] = np.nan
        return pixels

    scenes = len(bpy.data.scenes)
    monkeypatch.setattr(small.exr.Layers, "read", broken)
    with pytest.raises(SceneError, match="1 pixels that are infinite or not a number"):
        work.run(relight.relight(shot))
    monkeypatch.undo()
    assert len(bpy.data.scenes) == scenes
    np.testing.assert_array_equal(exr.read(relit_file(shot))[""], before)


def test_the_lamps_are_clamped_as_the_artist_clamps(shot):
    """Their render is an ordinary one: with its light clamped to a tenth no path brings more (its
    channels together three times that), and the scene's own lamp, in a group named as ours is,
    stays out of it."""
    field = Field(paths.field_folder(shot))
    found = split(bake(shot, 256)).lamps
    free = work.run(lamps.lamp_light(shot, field, found, 64))
    assert free.max() > 1.5
    own = shot.cycles.sample_clamp_indirect
    shot.cycles.sample_clamp_direct = shot.cycles.sample_clamp_indirect = 0.1
    shot.objects["Sun"].lightgroup = "ARTO_lamps"
    try:
        clamped = work.run(lamps.lamp_light(shot, field, found, 64))
    finally:
        shot.cycles.sample_clamp_direct, shot.cycles.sample_clamp_indirect = 0.0, own
        shot.objects["Sun"].lightgroup = ""
    assert 0.01 < clamped.max() < 0.6


def test_a_finer_capture_has_cleaner_lamps(shot):
    """Lamps with all the light get a quarter of the capture's 256 samples, and a part of that where
    they have a part of the light. A number that the artist gives counts as it is."""
    said = relit(shot, lamp_samples=0)[1]
    share, samples = (float(n) for n in re.findall(r"[0-9]+(?=%| samples)", said))
    assert samples == pytest.approx(256 / 4 * share / 100, abs=1)
    shot.arto.lamp_samples = 0
    found = [lamps.lamp_samples(shot, 1.0, n) for n in (None, 16, 2048)]
    shot.arto.lamp_samples = 256
    assert found == [32, 32, 512]
    assert lamps.lamp_samples(shot, 0.5, 2048) == 128


def test_light_from_few_directions_is_said(shot):
    """One of 24 patches has 2 of the 24 parts of the samples that light from half of the sphere
    has: 21 of 256. Light from everywhere, or most of it from lamps, is not worth a word."""
    field = Field(paths.field_folder(shot))
    hemicube = field.hemicube
    ones = np.ones(len(hemicube), np.intp)
    bins = np.repeat(hemicube.solid_angles[:, None], 4, axis=1)
    assert narrow(field, PatchLight.of_bins(hemicube, ones, bins), 0.0) == ""
    bins[1:, :3] = 0
    one = PatchLight.of_bins(hemicube, ones, bins)
    assert "256 samples about 21 show it" in narrow(field, one, 0.0)
    assert narrow(field, one, 0.8) == ""


def test_a_near_hemicube_keeps_its_lamps(tmp_path):
    """Its patches stand somewhere; a lamp at infinity would not stand there."""
    scene = small_scene(tmp_path)
    scene.arto.far, scene.arto.size, scene.arto.samples = False, 30.0, 4
    scene.arto.lamps = True
    sunny(scene)
    captured(scene)
    work.run(fit.fit(scene))
    assert relit(scene)[1].startswith("no: lamps at infinity")
