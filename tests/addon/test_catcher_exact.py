"""Catchers of shadows where the right values are known: in uniform white, and on empty ground."""

from __future__ import annotations

import bmesh
import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender.colour import working_space
from arto.arto_addon.fit import fit
from arto.arto_addon.plate import plate
from arto.arto_addon.plate.names import relit_file
from arto.arto_addon.relight import relight
from arto.arto_addon.shot import paths
from arto.arto_addon.stage.takes import TAKES
from arto.core import exr
from arto.core.capture.capture_set import CaptureSet
from arto.core.catcher import catch
from arto.core.field.field import Field
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from scene_tools import add_mesh, captured, cycles, hdri, material, set_colour, small_scene, smooth
from shot_tools import footage_of


def on_white_ground(tmp_path, things=True):
    """A ball on a diffuse ground that catches its shadow, in uniform white."""
    scene = small_scene(tmp_path)
    for name in ("Matt", "Glossy"):
        bpy.data.objects.remove(scene.objects[name])
    if things:
        ball = add_mesh(scene, "Ball", [], [], material("Ball", Base_Color=(0.7, 0.25, 0.1, 1)))
        form = bmesh.new()
        bmesh.ops.create_icosphere(form, subdivisions=3, radius=1.2)
        form.to_mesh(ball.data)
        form.free()
        ball.location = (0, 0, 1.2)
    scene.objects["Floor"].is_shadow_catcher = True
    scene.render.film_transparent = True
    set_colour(scene, (1, 1, 1))
    return scene


def relit(scene):
    """The plate (H, W, 4), and how much is seen of what is behind it (H, W, 3)."""
    path, _ = work.run(relight.relight(scene))
    return exr.read(path)[""], exr.read(plate.share_file(path))[""]


def takes_by_cycles(scene, samples, seed, tmp_path):
    """All of it, the ground and the things, as Cycles itself renders them, (H, W, 4) each."""
    floor, ball = scene.objects["Floor"], scene.objects["Ball"]
    floor.is_shadow_catcher = False
    found = [cycles(scene, samples, seed, tmp_path)]
    ball.hide_render = True
    found.append(cycles(scene, samples, seed, tmp_path))
    # by itself it is seen with the ground's light on it, and the ground is not
    ball.hide_render, floor.visible_camera = False, False
    found.append(cycles(scene, samples, seed, tmp_path))
    floor.visible_camera = floor.is_shadow_catcher = True
    return found


@pytest.mark.newest
def test_in_white_the_ratio_is_that_of_cycles_own_renders(tmp_path):
    """Of the same takes at the same samples, to within what two seeds of these differ by."""
    scene = on_white_ground(tmp_path)
    scene.arto.samples, scene.arto.patches, scene.arto.keep = 256, 4, "never"
    captured(scene)
    _, share = relit(scene)
    ratios = []
    for seed in (1, 2, 3):
        whole, ground, apart = takes_by_cycles(scene, 256, seed, tmp_path)
        ratios.append(catch(whole[..., :3], ground[..., :3], apart, ground[..., 3]).share)
    folder = paths.field_folder(scene).parent
    bare = Field(folder / "things" / "field").layer("alpha") == 0
    there = bare & (Field(folder / "ground" / "field").layer("alpha") == 1)
    assert 0.3 < there.mean() < 0.9
    noise = np.abs(ratios[0] - ratios[1])[there]
    assert ratios[0][there].min() < 0.7  # a shadow there is
    off = np.abs(share - ratios[2])[there]
    assert off.mean() < 1.2 * noise.mean() and off.max() < 1.5 * noise.max()
    # and beside their mean it has no lean: noise falls with the root of so many numbers
    lean = (share - np.mean(ratios, axis=0))[there].mean()
    assert abs(lean) < 4 * noise.mean() / np.sqrt(there.sum())
    # where there is neither ground nor thing, nothing happens
    nothing = bare & (Field(folder / "ground" / "field").layer("alpha") == 0)
    assert nothing.any() and (share[nothing] == 1).all()


@pytest.mark.newest
@pytest.mark.parametrize("support", ["auto", "linear"])
def test_the_fields_part_is_the_uniform_transport(tmp_path, support):
    """What a fit leaves out of one entry is in another: all patches at once give what was
    captured, take by take, and so does the ratio of two. A pixel's peak is a half float in the
    file, which rounds to a part in 2^11, to either side."""
    scene = on_white_ground(tmp_path)
    scene.arto.samples, scene.arto.patches, scene.arto.keep = 32, 4, "always"
    scene.arto.support = support
    captured(scene)
    work.run(fit.fit(scene))
    shown = relight.Shown(scene, scene.view_layers[0].name)
    white = Environment(np.ones((64, 128, 3), np.float32))
    pictures = shown.pictures([PatchLight(white, shown.field.hemicube)])[0]
    folder = paths.capture_folder(scene).parent
    sums = []
    for place, picture in zip((folder, *(folder / n for n in TAKES)), pictures, strict=True):
        there = CaptureSet(place / "capture")
        tile = there.read(0)
        found = [tile.coefficient(k, there.patterns) for k in range(len(there.hemicube))]
        uniform = np.sum(found, axis=0, dtype=np.float64)
        half = 2.0**-11
        np.testing.assert_allclose(picture[..., :3], uniform, rtol=1.01 * half, atol=1e-6)
        assert picture[..., :3].mean(dtype=np.float64) == pytest.approx(uniform.mean(), rel=1e-4)
        sums.append(np.dstack([uniform, picture[..., 3]]))
    alpha = pictures[1][..., 3]
    of_field = catch(pictures[0][..., :3], pictures[1][..., :3], pictures[2], alpha)
    of_capture = catch(sums[0][..., :3], sums[1][..., :3], sums[2], alpha)
    bare = pictures[2][..., 3] == 0
    np.testing.assert_allclose(of_field.share[bare], of_capture.share[bare], rtol=2 * half)
    assert of_field.share[bare].mean() == pytest.approx(of_capture.share[bare].mean(), rel=1e-4)


@pytest.mark.newest
@pytest.mark.parametrize("world", ["white", "sun"])
def test_on_an_empty_ground_footage_passes_denoised_too(tmp_path, world):
    """The ratio is 1 everywhere and the comp is the footage, whatever light there is."""
    scene = on_white_ground(tmp_path, things=False)
    image = smooth()
    if world == "sun":
        image[10:13, 40:43] += 400.0
    if world != "white":
        hdri(scene, image)
    scene.arto.samples, scene.arto.patches, scene.arto.keep = 8, 2, "never"
    scene.arto.denoise = scene.arto.lamps = True
    filmed = np.random.default_rng(0).uniform(0, 2, (18, 24, 3)).astype(np.float32)
    scene.arto.footage = float_footage(filmed)
    captured(scene)
    picture, share = relit(scene)
    path = relit_file(scene)
    assert exr.header(path)["arto.denoised"] == "Open Image Denoise"
    np.testing.assert_allclose(share, 1, atol=1e-4)
    np.testing.assert_allclose(picture, 0, atol=1e-4)
    comp = exr.read(plate.comp_file(path))[""]
    np.testing.assert_allclose(comp, filmed, atol=1e-4)


def float_footage(pixels):
    image = bpy.data.images.new("Filmed", pixels.shape[1], pixels.shape[0], float_buffer=True)
    image.colorspace_settings.name = working_space()
    rgba = np.dstack([pixels, np.ones(pixels.shape[:2])]).astype(np.float32)
    image.pixels.foreach_set(rgba[::-1].ravel())
    image.pack()
    return image


def test_beyond_the_ground_footage_passes_beside_things(tmp_path):
    """Denoised, with a ball in the picture: where neither ground nor thing is, to 1e-4."""
    scene = on_white_ground(tmp_path)
    hdri(scene, smooth())
    scene.arto.samples, scene.arto.patches, scene.arto.keep = 16, 2, "never"
    scene.arto.denoise = True
    filmed = np.random.default_rng(0).uniform(0, 2, (18, 24, 3)).astype(np.float32)
    scene.arto.footage = float_footage(filmed)
    captured(scene)
    relit(scene)
    comp = exr.read(plate.comp_file(relit_file(scene)))[""]
    folder = paths.field_folder(scene).parent
    empty = np.all(
        [Field(folder / n / "field").layer("alpha") == 0 for n in ("ground", "things")], axis=0
    )
    assert 0.05 < empty.mean() < 0.5
    np.testing.assert_allclose(comp[empty], filmed[empty], atol=1e-4)


def test_footage_of_a_file_passes_as_blender_reads_it(tmp_path):
    """From an 8-bit picture behind the camera, through the relight, to the comp."""
    scene = on_white_ground(tmp_path, things=False)
    scene.arto.samples, scene.arto.patches, scene.arto.keep = 4, 1, "never"
    scene.arto.denoise = True
    footage_of(scene, tmp_path)
    captured(scene)
    relit(scene)
    comp = exr.read(plate.comp_file(relit_file(scene)))[""]
    encoded = np.array([64, 128, 191]) / 255
    linear = ((encoded + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(comp, np.broadcast_to(linear, comp.shape), atol=1e-4)
