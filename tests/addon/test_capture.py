"""The physics of capturing: the routes agree, and the light adds up."""

from __future__ import annotations

import itertools

import bpy
import numpy as np
import pytest
from arto.arto_addon.capture import planned
from arto.arto_addon.capture.plan import kept_often
from arto.arto_addon.stage.stage import picture_region
from arto.core import exr
from arto.core.capture.names import GROUP
from arto.core.errors import SceneError
from scene_tools import (
    HEIGHT,
    WIDTH,
    captured,
    cycles,
    differences,
    small_scene,
    snapshot,
    world_volume,
)


@pytest.mark.newest
@pytest.mark.parametrize("route", ["pattern", "single"])
def test_routes_agree(noise, route):
    """Two routes differ by as much as two seeds of one route do: pixel by pixel in the square, and
    not at all in the mean (4 standard errors of the difference of seeds)."""
    one, two, other = noise("all", 1), noise("all", 2), noise(route, 3)
    seeds = (one.basis - two.basis).astype(np.float64)
    routes = (other.basis - one.basis).astype(np.float64)
    for k in range(len(one.basis)):
        for p in range(one.basis.shape[1]):
            if one.basis[k, p].max() < 1e-3:
                assert other.basis[k, p].max() < 0.05
                continue
            ratio = np.square(routes[k, p]).mean() / np.square(seeds[k, p]).mean()
            assert 0.5 < ratio < 2, (k, p, ratio)
            error = seeds[k, p].std() / np.sqrt(seeds[k, p].size / 3)
            assert abs(routes[k, p].mean()) < 4 * error, (k, p)


def test_light_adds_up(tmp_path):
    """Combined is the sum of all groups, to float precision, where nothing else gives light."""
    scene = small_scene(tmp_path)
    there = captured(scene)
    parts = exr.read(there.folder / there.files[0][0])
    combined = next(v for k, v in parts.items() if k.endswith(".Combined"))[..., :3]
    groups = sum(v.astype(np.float64) for k, v in parts.items() if GROUP.search(k))
    assert groups.max() > 0.1 * there.head.radiance
    assert np.abs(combined - groups).max() < 1e-5 * groups.max()
    data = there.read(0)
    assert (data.own == 0).all()


def test_own_lamps_are_a_layer_of_their_own(tmp_path):
    """The own layer is what Cycles shows in a black world; the patches do not shade the sun."""
    scene = small_scene(tmp_path, lamp=True)
    scene.arto.samples = 256
    own = captured(scene).read(0).own
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0
    one, two = (cycles(scene, 256, seed, tmp_path)[..., :3] for seed in (1, 2))
    noise = np.square(one - two).mean()
    assert own.mean() > 0.05
    assert np.square(own - one).mean() < 2 * noise + 1e-6
    assert abs(own.mean() / one.mean() - 1) < 0.01


def test_guides_and_description(tmp_path):
    scene = small_scene(tmp_path)
    there = captured(scene)
    data = there.read(0)
    assert set(data.guides) == {"albedo", "normal", "depth", "position"}
    assert data.guides["albedo"].shape == (HEIGHT, WIDTH, 3)
    assert data.alpha.max() == 1
    assert there.head.changed["cycles.sample_clamp_indirect"] == [10.0, 0.0]
    assert there.head.colour_space == "Linear Rec.709"
    assert there.head.blender == bpy.app.version_string


def test_tiles_make_the_same_picture(tmp_path):
    """A picture in tiles is that picture, in the right place: rows are not lost or doubled."""
    scene = small_scene(tmp_path)
    whole = captured(scene).read(0)
    # 38 passes of 24 bytes and 24 pixels a row: 16 MB hold it all, so ask for strips directly
    region = picture_region(scene)
    strips = planned.tiles_of(region, 38 * 24, 16 << 20)
    assert strips == [region]
    budget = planned.tiles_of
    try:
        planned.tiles_of = lambda r, n, m: [
            type(r)(r.x, r.y, r.width, 7),
            type(r)(r.x, r.y + 7, r.width, r.height - 7),
        ]
        tiled = captured(scene)
    finally:
        planned.tiles_of = budget
    parts = [tiled.read(i) for i in range(2)]
    albedo = np.concatenate([p.guides["albedo"] for p in parts])
    # edges of things sit in the same rows; the noise differs
    assert np.abs(albedo - whole.guides["albedo"]).mean() < 0.01
    together = np.concatenate([p.basis for p in parts], axis=2)
    assert abs(together.mean() / whole.basis.mean() - 1) < 0.03


def test_tiles_fit_the_budget(scene):
    region = type(picture_region(scene))
    tiles = planned.tiles_of(region(5, 3, 2000, 1000), 488 * 24, 1 << 30)
    assert all(t.y % 8 == 0 for t in tiles[1:]), "a proxy's pixel is of one tile"
    assert max(t.height for t in tiles) * 2000 * 488 * 24 <= 1 << 30
    tiles = planned.tiles_of(region(5, 3, 2000, 1000), 488 * 24, 256 << 20)
    assert tiles[0].y == 3 and sum(t.height for t in tiles) == 1000
    assert all(a.y + a.height == b.y for a, b in itertools.pairwise(tiles))
    assert all(t.height * 2000 * 488 * 24 <= 256 * 2**20 for t in tiles)
    with pytest.raises(SceneError, match="memory budget"):
        planned.tiles_of(region(0, 0, 100000, 10), 9008 * 24, 16 << 20)


def test_work_is_kept_every_minute(scene):
    """Whatever the picture's size: a cross, a crash or a quit costs a minute and no more."""
    region = type(picture_region(scene))
    for whole, minutes in (
        (region(0, 0, 240, 180), 22),
        (region(7, 3, 96, 333), 40),
        (region(0, 0, 1920, 1080), 45),
    ):
        tiles = kept_often([whole], whole, 60.0 * minutes, 1.0)
        assert sum(t.height for t in tiles) == whole.height and tiles[0].y == whole.y
        assert all(a.y + a.height == b.y for a, b in itertools.pairwise(tiles))
        assert all(t.y % 8 == 0 for t in tiles[1:]), "a proxy's pixel is of one tile"
        assert max(t.pixels for t in tiles) / whole.pixels * minutes <= 1.0
    # what is quick stays whole, and what is long to get ready is not cut to pieces
    assert kept_often([whole], whole, 44.0, 1.0) == [whole]
    assert 3 <= len(kept_often([whole], whole, 600.0, 30.0)) <= 4
    # a relight holds a file for each strip
    assert 40 <= len(kept_often([whole], whole, 1e6, 1.0)) <= 60


def test_render_region(tmp_path):
    """With a render region only that region is captured, and it is the right one."""
    scene = small_scene(tmp_path)
    whole = captured(scene).read(0)
    r = scene.render
    r.use_border = True
    r.border_min_x, r.border_max_x, r.border_min_y, r.border_max_y = 0.25, 0.75, 0.0, 0.5
    part = captured(scene).read(0)
    y, x = part.region.slices
    assert (part.region.width, part.region.height) == (12, 9)
    assert part.region.y == 9
    assert np.abs(part.guides["albedo"] - whole.guides["albedo"][y, x]).mean() < 0.01


def test_bad_scenes(scene):
    camera, scene.camera = scene.camera, None
    with pytest.raises(SceneError, match="no camera"):
        captured(scene)
    scene.camera = camera
    scene.render.engine = "BLENDER_WORKBENCH"
    with pytest.raises(SceneError, match="Cycles"):
        captured(scene)
    scene.render.engine = "CYCLES"
    with world_volume(scene), pytest.raises(SceneError, match="volume"):
        captured(scene)
    scene.render.resolution_percentage = 10
    with pytest.raises(SceneError, match="pixels: raise the resolution"):
        captured(scene)
    scene.render.resolution_percentage = 100
    for thing in scene.objects:
        thing.hide_render = thing.type == "MESH"
    with pytest.raises(SceneError, match="shows nothing"):
        captured(scene)


def test_never_saved_file(scene):
    scene.arto.folder = "//arto/"
    with pytest.raises(SceneError, match="never saved"):
        captured(scene)
    with pytest.raises(RuntimeError, match="never saved"):
        bpy.ops.arto.capture()


def test_near_hemicube_lights_what_is_near(tmp_path):
    """The left face of a near hemicube lights the left end of the floor more than the right one; a
    far one lights both ends alike."""
    ratios = []
    for far in (True, False):
        scene = small_scene(tmp_path / str(far))
        for name in ("Matt", "Glossy"):
            bpy.data.objects.remove(scene.objects[name])
        scene.arto.far, scene.arto.size, scene.arto.samples = far, 6.0, 256
        there = captured(scene)
        assert (there.hemicube.size == 6.0) is not far
        data = there.read(0)
        left = data.basis[there.hemicube.face_slice("left").start, 0].sum(axis=-1)
        floor = data.alpha > 0.999
        columns = np.nonzero(floor)[1]
        low, high = np.percentile(columns, (20, 80))
        column = np.arange(WIDTH)[None, :]
        ratios.append(left[floor & (column < low)].mean() / left[floor & (column > high)].mean())
    assert ratios[0] == pytest.approx(1, abs=0.15)
    assert ratios[1] > 1.5


def test_grain_shows_the_noise(tmp_path):
    """The grain of one capture against the difference of two seeds: no larger than the grain says
    (stratified samples are less noisy than independent ones, never more), and not far under it."""
    one, two = (captured(_seeded(tmp_path / str(s), s)).read(0) for s in (1, 2))
    white = [d.basis[:, 0].sum(axis=-1) for d in (one, two)]
    found = [np.square(d.grain).sum(axis=(1, 2)) for d in (one, two)]
    between = np.square(white[0] - white[1]).sum(axis=(1, 2)) / 2
    lit = np.mean(white[0], axis=(1, 2)) > 0.01
    assert lit.sum() >= 3
    ratio = between[lit] / np.mean(found, axis=0)[lit]
    assert (ratio > 0.02).all() and (ratio < 1.5).all(), ratio
    # its sign is a coin's: the sum is no larger than its own deviation allows
    total = one.grain[lit].sum(axis=(1, 2))
    assert (np.abs(total) < 4 * np.sqrt(found[0][lit])).all()


def _seeded(folder, seed):
    scene = small_scene(folder)
    scene.arto.seed = seed
    return scene


def test_grain_can_be_left_out(tmp_path):
    scene = small_scene(tmp_path)
    scene.arto.grain = False
    assert captured(scene).read(0).grain is None


def test_keys_and_drivers_do_not_overrule_the_stage(tmp_path):
    """Samples, exposure and film that are driven or keyed: the basis images are those of a scene
    in which they are not; a custom property of the scene still drives what it drives."""
    scene = small_scene(tmp_path)
    scene.arto.samples, scene.arto.patterns, scene.arto.grain = 16, "linear", False
    scene["lift"] = 0.5
    lifted = scene.objects["Matt"].driver_add("location", 2).driver
    variable = lifted.variables.new()
    variable.name, variable.type = "lift", "CONTEXT_PROP"
    variable.targets[0].context_property = "ACTIVE_SCENE"
    variable.targets[0].data_path = '["lift"]'
    lifted.expression = "1 + lift"
    plain = captured(scene).read(0)
    scene.driver_add("cycles.samples").driver.expression = "1"
    scene.driver_add("cycles.seed").driver.expression = "frame"
    scene.driver_add("render.film_transparent").driver.expression = "0"
    scene.cycles.sample_clamp_indirect = 1e-3
    scene.keyframe_insert("cycles.sample_clamp_indirect", frame=1)
    scene.keyframe_insert('["lift"]', frame=1)
    scene.frame_set(1)
    before = snapshot()
    driven = captured(scene).read(0)
    np.testing.assert_allclose(driven.basis, plain.basis, atol=1e-5)
    np.testing.assert_allclose(driven.alpha, plain.alpha, atol=1e-5)
    assert not differences(before, snapshot())
    assert len(bpy.data.actions) == 1


def test_light_groups_of_the_artist_are_never_ours(tmp_path):
    """A sun in a group named like one of ours, once it has even the name with a number: its light
    is in the own layer and not in a patch."""
    scene = small_scene(tmp_path, lamp=True)
    plain = captured(scene).read(0)
    assert plain.own.mean() > 0.05
    scene.view_layers[0].lightgroups.add(name="ARTO_0000_white")
    scene.objects["Sun"].lightgroup = "ARTO_0000_white"
    for taken in ("", "ARTO-2_0001_u1"):
        scene.objects["Floor"].lightgroup = taken
        found = captured(scene).read(0)
        np.testing.assert_allclose(found.own, plain.own, atol=1e-4)
        np.testing.assert_allclose(found.basis, plain.basis, atol=1e-5)
