"""What Blender draws over a render, and its camera: as F12 has them, or refused."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from arto.arto_addon.blender.front import to_front
from arto.arto_addon.blender.markers import camera_of
from arto.arto_addon.capture import planes
from arto.arto_addon.capture.check import check_scene
from arto.arto_addon.relight import relight
from arto.arto_addon.shot.shot import shot_of
from arto.arto_addon.stage.bounds import rendered
from arto.arto_addon.stage.stage import stage
from arto.arto_addon.work import run
from arto.core.capture.agreement import agreement
from arto.core.errors import SceneError
from scene_tools import instance_of


def _drawing(scene, kind="STROKE"):
    bpy.ops.object.grease_pencil_add(type=kind)
    return bpy.context.object


def test_a_drawing_is_refused(scene):
    _drawing(scene, "EMPTY")
    check_scene(scene)  # no line is drawn
    thing = _drawing(scene)
    with pytest.raises(SceneError, match="'Stroke' is a drawing of Grease Pencil"):
        check_scene(scene)
    with pytest.raises(SceneError, match="'Stroke' is a drawing of Grease Pencil"):
        run(relight.relight(scene))
    scene.view_layers[0].use_grease_pencil = False
    check_scene(scene)
    scene.view_layers[0].use_grease_pencil = True
    thing.hide_render = True
    check_scene(scene)


def test_a_drawing_that_is_only_an_instance_is_refused(scene):
    thing = _drawing(scene)
    part = bpy.data.collections.new("Part")
    part.objects.link(thing)
    scene.collection.objects.unlink(thing)
    instance_of(part, scene.collection)
    layer = scene.view_layers[0]
    check_scene(scene)
    with stage(scene, layer.name) as on, pytest.raises(SceneError, match="drawing of Grease"):
        rendered(on)
    layer.use_grease_pencil = False
    with stage(scene, layer.name) as on:
        rendered(on)


def test_freestyle_is_refused_where_it_draws(scene):
    scene.render.use_freestyle = True
    with pytest.raises(SceneError, match="Freestyle draws lines"):
        check_scene(scene)
    style = scene.view_layers[0].freestyle_settings
    style.as_render_pass = True
    check_scene(scene)
    style.as_render_pass = False
    for lines in style.linesets:
        lines.show_render = False
    check_scene(scene)
    style.mode = "SCRIPT"
    with pytest.raises(SceneError, match="Freestyle draws lines"):
        check_scene(scene)


def test_stereo_is_refused(scene):
    scene.render.use_multiview = True
    with pytest.raises(SceneError, match="stereo"):
        check_scene(scene)


def test_a_marker_chooses_the_camera(scene):
    """As in F12, which looks at the markers when it begins, whatever camera was chosen since."""
    own, other = scene.camera, scene.camera.copy()
    other.name = "Other"
    other.location.x += 2
    scene.collection.objects.link(other)
    scene.timeline_markers.new("cut", frame=10).camera = other
    scene.view_layers[0].update()
    # before its first marker a scene is seen by that marker's camera
    for frame in (1, 12):
        scene.frame_set(frame)
        scene.camera = own
        assert camera_of(scene) == other
        shot = shot_of(scene)
        assert shot.camera == "Other" and shot.camera_matrix[3] == other.matrix_world[0][3]
        with stage(scene, scene.view_layers[0].name) as on:
            assert on.scene.camera == other
    scene.arto.align = "camera"
    other.rotation_euler.z = 1.0
    scene.view_layers[0].update()
    turned = planes.wanted(scene, (0, 0, 0), 1.0).orientation
    assert abs(turned[0][1]) > 0.5
    other.hide_render = True
    assert camera_of(scene) == own


def test_what_is_dark_is_dark_by_the_films_exposure():
    rng = np.random.default_rng(0)
    light = np.full((12, 12, 3), 0.4) + rng.normal(0, 0.01, (3, 12, 12, 3))
    assert not agreement(light[0], light[1:]).dark
    dim = light / 20_000
    assert agreement(dim[0], dim[1:]).dark
    assert not agreement(dim[0], dim[1:], white=1 / 20_000).dark


def test_a_scene_in_no_window_is_brought_to_its_frame(scene, tmp_path):
    """A keyed camera is where its frame has it, in a file that was saved in another scene."""
    camera = scene.camera
    for frame, x in ((1, 0.0), (11, 10.0)):
        camera.location.x = x
        camera.keyframe_insert("location", frame=frame)
    scene.frame_set(6)
    name = scene.name
    bpy.context.window.scene = bpy.data.scenes.new("Other")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "two.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "two.blend"))
    scene = bpy.data.scenes[name]
    to_front(scene)
    assert shot_of(scene).camera_matrix[3] == pytest.approx(5.0)
