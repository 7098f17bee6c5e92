"""Positions as data: those of Cycles' own pass, for every camera, and on what is in the scene."""

from __future__ import annotations

import bpy
import numpy as np
import OpenImageIO
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender.output import float_exr
from arto.arto_addon.plate import plate
from arto.arto_addon.relight import relight
from arto.arto_addon.shot import paths
from arto.arto_addon.stage.stage import stage
from arto.core import exr
from arto.core.field.field import Field, proxy_folder
from arto.core.field.tile_file import TileFile, written
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector
from scene_tools import captured, small_scene


@pytest.fixture
def shot(tmp_path):
    scene = small_scene(tmp_path)
    scene.render.film_transparent = True
    scene.arto.samples, scene.arto.keep, scene.arto.write_data = 4, "never", True
    return scene


def looks_by(scene, camera):
    data = scene.camera.data
    if camera == "shifted":
        data.shift_x, data.shift_y = 0.3, -0.1
    elif camera == "orthographic":
        data.type, data.ortho_scale = "ORTHO", 10
    elif camera == "panoramic":
        data.type, data.panorama_type = "PANO", "EQUIRECTANGULAR"
        scene.camera.location = (0, -4, 1.5)
    elif camera == "open":
        data.dof.use_dof, data.dof.focus_distance = True, 5.0
        data.dof.aperture_fstop = 0.05


def data_of(scene):
    """Depth (H, W) and position (H, W, 3) of the data file, as another reader has them."""
    path, _ = work.run(relight.relight(scene))
    found = {}
    for part in range(4):
        image = OpenImageIO.ImageBuf(str(plate.data_file(path)), part, 0)
        name = image.spec()["oiio:subimagename"]
        found[name] = image.get_pixels("float", OpenImageIO.get_roi_full(image.spec()))
        assert image.spec().format == "float"
    assert image.spec().getattribute("arto.missing") is None
    return found["depth"][..., 0], found["position"]


def by_cycles(scene, tmp_path):
    """The same of Cycles' own render, of the same seed and samples."""
    with stage(scene, scene.view_layers[0].name) as on:
        float_exr(on.scene.render)
        on.scene.view_layers[0].use_pass_position = on.scene.view_layers[0].use_pass_z = True
        cycles = on.scene.cycles
        cycles.samples, cycles.seed = scene.arto.samples, scene.arto.seed
        cycles.use_adaptive_sampling = cycles.use_denoising = False
        on.scene.render.filepath = str(tmp_path / "cycles.exr")
        request = work.Render(on.scene.name, 0, "")
        work.blocking_render(request)
        request.check()
    found = exr.read(tmp_path / "cycles.exr")
    depth, position = (
        next(p for n, p in found.items() if n.endswith(name)) for name in ("Depth", "Position")
    )
    return depth[..., 0], position


@pytest.mark.parametrize("camera", ["perspective", "shifted", "orthographic", "panoramic", "open"])
def test_as_cycles_own_pass(shot, tmp_path, camera):
    looks_by(shot, camera)
    captured(shot)
    depth, position = data_of(shot)
    expected_depth, expected = by_cycles(shot, tmp_path)
    np.testing.assert_allclose(position, expected, atol=1e-5)
    np.testing.assert_allclose(depth, expected_depth, rtol=1e-6)
    hit = depth < 1e9
    assert 0.1 < hit.mean() < 0.9
    np.testing.assert_array_equal(depth[~hit], np.float32(1e10))
    assert not position[~hit].any()
    # no pixel is a mean: each place is on the floor, or on a box, whose sides are 2
    x, y, z = position[hit].T
    on = np.abs(z) < 1e-4
    for name in ("Matt", "Glossy"):
        middle = shot.objects[name].location
        away = [np.abs(v - m) for v, m in zip((x, y, z), middle, strict=True)]
        on |= np.abs(np.max(away, axis=0) - 1) < 1e-4
    assert on.all()
    # depth is that of the place: along the axis, or along the ray
    to_camera = np.array(shot.camera.matrix_world.inverted())
    local = position[hit] @ to_camera[:3, :3].T + to_camera[:3, 3]
    far = np.linalg.norm(local, axis=-1) if camera == "panoramic" else -local[:, 2]
    np.testing.assert_allclose(depth[hit], far, rtol=1e-5)


@pytest.mark.newest
@pytest.mark.parametrize("camera", ["perspective", "shifted", "orthographic"])
def test_the_camera_sees_each_place_in_its_pixel(shot, camera):
    """But for what the pixel filter reaches beyond."""
    looks_by(shot, camera)
    captured(shot)
    depth, position = data_of(shot)
    rows, columns = np.nonzero(depth < 1e9)
    for row, column in zip(rows, columns, strict=True):
        seen = world_to_camera_view(shot, shot.camera, Vector(position[row, column]))
        assert abs(seen.x * 24 - 0.5 - column) < 1 and abs((1 - seen.y) * 18 - 0.5 - row) < 1


def test_a_field_of_before_has_none_and_says_so(shot):
    captured(shot)
    field = Field(paths.field_folder(shot))
    assert not Field(proxy_folder(field.folder, 2)).has_layer("position")
    for tile in field.tiles:
        there = TileFile(tile.path)
        kept = {name: there.load(name).copy() for name in there.sizes if name != "position"}
        with written(tile.path) as out:
            for name, array in kept.items():
                out.add(name, array)
    said = []
    path, _ = work.run(relight.relight(shot), lambda step: said.append(step.text))
    assert any("the data file has no position" in text for text in said)
    file = plate.data_file(path)
    assert exr.header(file)["arto.missing"] == "position"
    assert set(exr.read(file)) == {"albedo", "normal", "depth"}


def test_outside_of_a_render_region_nothing_is_met(shot):
    shot.render.use_border = True
    shot.render.border_min_x, shot.render.border_max_x = 0.25, 0.75
    shot.render.border_min_y, shot.render.border_max_y = 0.0, 1.0
    captured(shot)
    depth, position = data_of(shot)
    outside = np.r_[0:6, 18:24]
    assert (depth[:, outside] == 1e10).all() and not position[:, outside].any()
    assert (depth[:, 6:18] < 1e9).any()


def test_where_nothing_is_met_there_is_nothing_to_crop_around(shot):
    shot.arto.data_window = "CROP"
    shot.objects["Floor"].hide_render = True
    captured(shot)
    path, _ = work.run(relight.relight(shot))
    spec = OpenImageIO.ImageBuf(str(plate.data_file(path))).spec()
    alpha = exr.read(path)[""][..., 3]
    rows, columns = np.nonzero(alpha)
    assert (spec.x, spec.y) == (columns.min(), rows.min())
    assert (spec.width, spec.height) == (np.ptp(columns) + 1, np.ptp(rows) + 1)
    assert spec.width < 24 and spec.height < 18


def test_takes_beside_the_first_keep_none(shot):
    """They hand on nothing but their light."""
    shot.objects["Floor"].is_shadow_catcher = True
    bpy.context.view_layer.update()
    captured(shot)
    folder = paths.field_folder(shot)
    assert Field(folder).has_layer("position")
    for name in ("ground", "things"):
        assert not Field(folder.parent / name / "field").has_layer("position")
