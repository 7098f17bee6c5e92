"""What an artist is told and does around a shot: states, looks, composite, verify, compare."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from arto.arto_addon import shoot, work
from arto.arto_addon.blender.compositing import compositor
from arto.arto_addon.capture import planes
from arto.arto_addon.fit import fit
from arto.arto_addon.plate import compare
from arto.arto_addon.plate.composite import composite_file, save_composite
from arto.arto_addon.plate.names import relit_file
from arto.arto_addon.plate.present import present, use
from arto.arto_addon.relight import inside, looks
from arto.arto_addon.relight.relight import compute
from arto.arto_addon.relight.verify import verify_file, verify_plate
from arto.arto_addon.shot import paths, status
from arto.arto_addon.stage.settings import samples_of
from arto.arto_addon.ui import overlay, result_panel, state
from arto.arto_addon.ui.places import _lines
from arto.core import exr
from arto.core.errors import ExrError, SceneError
from scene_tools import captured, cycles, set_colour, small_scene

LAYER = "ViewLayer"


@pytest.fixture(scope="module")
def ready(tmp_path_factory):
    """A shot that was captured and relit by the one button; tests leave it as it was."""
    scene = small_scene(tmp_path_factory.mktemp("artist"), lamp=True)
    scene.arto.keep, scene.arto.support, scene.arto.samples = "never", "auto", 64
    scene.arto.grain, scene.arto.patterns = False, "linear"
    set_colour(scene, (0.5, 0.4, 0.3))
    work.run(shoot.shoot(scene))
    return scene


def _plate(scene, look: str | None = None) -> np.ndarray:
    return next(iter(exr.read(relit_file(scene, look)).values()))


def test_states_of_a_ready_shot(ready) -> None:
    """Each line is true, short, and the button says what it would do."""
    found = state.told(ready)
    assert (found.kind, found.button) == ("ready", "Capture Again")
    (line,) = found.lines
    assert line.startswith("Ready, captured") and line.endswith(", 64 samples")
    assert result_panel.plate_line(ready)[1]
    material = bpy.data.materials["Matt"].node_tree.nodes["Principled BSDF"]
    before = material.inputs["Roughness"].default_value
    material.inputs["Roughness"].default_value = 0.2
    found = state.told(ready)
    assert found.kind == "changed" and "Material 'Matt' changed since" in found.lines[0]
    material.inputs["Roughness"].default_value = before
    ready.frame_set(5)
    found = state.told(ready)
    assert found.kind == "elsewhere"
    assert found.lines == ("Captured at frame 1, this is frame 5",)
    bpy.ops.arto.set_back()
    assert ready.frame_current == 1 and state.told(ready).kind == "ready"
    other = bpy.data.objects.new("Other", ready.camera.data)
    ready.collection.objects.link(other)
    camera, ready.camera = ready.camera, other
    assert state.told(ready).lines == ("Captured through Camera, the camera is Other",)
    bpy.ops.arto.set_back()
    assert ready.camera == camera
    bpy.data.objects.remove(other)
    ready.render.resolution_x *= 2
    assert state.told(ready).kind == "elsewhere"
    assert "24 x 18, the picture is 48 x 18" in state.told(ready).lines[0]
    bpy.ops.arto.set_back()
    assert state.told(ready).kind == "ready"


def test_the_light_that_changed_is_told(ready) -> None:
    ready.world.arto.strength = 2.0
    text, good = result_panel.plate_line(ready)
    assert not good and "light or settings changed since" in text
    ready.world.arto.strength = 1.0
    assert result_panel.plate_line(ready)[1]


def _share(text: str) -> int:
    """Of what Verify says: in how much of the picture it differs, in per cent."""
    return 0 if text.startswith("Agrees") else int(text.split(" in ")[1].split("%")[0])


def test_verify_agrees_with_its_own_truth_and_finds_what_is_off(ready) -> None:
    (path,) = (work.run(verify_plate(ready)),)
    assert path == verify_file(relit_file(ready))
    good = exr.header(path)["arto.verify"]
    assert _share(good) == 0
    ready.world.arto.strength = 2.0
    try:
        work.run(verify_plate(ready))
        # a world of twice the light: but for the lamp's, everything is off
        assert _share(exr.header(path)["arto.verify"]) >= 95
    finally:
        ready.world.arto.strength = 1.0


def test_no_verdict_on_a_plate_that_is_no_number(ready) -> None:
    """NaN is neither like a render nor unlike it: it must not agree. ARTO writes no such plate,
    but another program may."""
    path = relit_file(ready)
    good = path.read_bytes()
    try:
        picture = _plate(ready)
        picture[3, 4, 1] = np.nan
        exr.write(path, {"": picture}, finite=False)
        with pytest.raises(SceneError, match="the plate has 1 pixels that are infinite"):
            work.run(verify_plate(ready))
        path.write_bytes(good[: len(good) // 2])
        with pytest.raises(ExrError):
            work.run(verify_plate(ready))
    finally:
        path.write_bytes(good)


def test_look_inside(ready) -> None:
    """What it says of a pixel adds up to all of its light; the world and the sun lamp are named."""
    found = inside.look(ready, 12, 15)
    assert found.lines[0].startswith("Pixel 12, 15") and "the scene's lamps" in found.lines[1]
    shares = [int(word[:-1]) for word in found.lines[1].split() if word.endswith("%")]
    assert sum(shares) == pytest.approx(100, abs=len(shares))
    assert found.picture.shape == (3 * inside.SIDE, 4 * inside.SIDE, 4)
    up, _ = inside.light_from(ready, np.array([0.0, 0.0, 1.0]))
    down, text = inside.light_from(ready, np.array([0.0, 0.0, -1.0]))
    # the floor hides what is below
    assert up[..., :3].mean() > 20 * down[..., :3].mean()
    assert "0.0%" in text


def test_places_on_pictures_are_directions(ready) -> None:
    """A click on the unfolded patches and one on the HDRI."""
    top = inside.direction_at(ready, inside.IMAGE, 1.5 / 4, 2.5 / 3)
    assert np.allclose(top / np.linalg.norm(top), (0, 0, 1), atol=0.02)
    back = inside.direction_at(ready, inside.IMAGE, 1.5 / 4, 1.5 / 3)
    assert np.allclose(back / np.linalg.norm(back), (0, 1, 0), atol=0.02)
    assert inside.direction_at(ready, inside.IMAGE, 0.05, 0.9) is None
    # Cycles: u = 0.5 - atan2(y, x) / 2 pi
    east = inside.direction_at(ready, "an HDRI", 0.5, 0.5)
    assert np.allclose(east, (1, 0, 0), atol=1e-6)
    north = inside.direction_at(ready, "an HDRI", 0.25, 0.5)
    assert np.allclose(north, (0, 1, 0), atol=1e-6)


def test_looks_are_worlds_by_name(ready) -> None:
    """Two looks, each with its own light: relit together they are what each is alone."""
    first = looks.add(ready, "Warm")
    assert first.world == ready.world
    second = looks.add(ready, "Warm")
    assert second.name == "Warm 2" and second.world != first.world
    assert ready.world == second.world and ready.arto.look == "Warm 2"
    set_colour(ready, (0.1, 0.3, 0.8))
    done = work.run(looks.relight_looks(ready, LAYER))
    assert done == [relit_file(ready, "Warm"), relit_file(ready, "Warm 2")]
    blue = _plate(ready, "Warm 2")
    ready.arto.active_look = 0
    assert ready.world == first.world and ready.arto.look == "Warm"
    work.run(compute(ready, LAYER))
    warm = _plate(ready)
    assert warm[..., 0].mean() > warm[..., 2].mean()
    assert blue[..., 2].mean() > blue[..., 0].mean()
    ready.arto.active_look = 1
    work.run(compute(ready, LAYER))
    np.testing.assert_allclose(_plate(ready), blue, rtol=1e-4, atol=1e-5)
    assert looks.remove(ready) == "Warm 2"
    assert ready.arto.look == "Warm" and ready.world == first.world
    looks.remove(ready)
    assert ready.arto.look == ""


def test_composite_without_a_render(ready) -> None:
    """Instead of the Render, the file has the plate's pixels; in a viewer it would need a render,
    and says so."""
    present(ready, relit_file(ready))
    with pytest.raises(SceneError, match="shows the render"):
        work.run(save_composite(ready, LAYER))
    settings = ready.render.image_settings
    settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    ready.arto.use_in_compositor = "RENDER"
    use(ready)
    scenes = len(bpy.data.scenes)
    others = Path(ready.arto.folder) / "comp.nk"
    others.write_text("mine")
    composite_file(ready).symlink_to(others)  # a link in the way is replaced, not followed
    path = work.run(save_composite(ready, LAYER))
    assert others.read_text() == "mine" and not path.is_symlink()
    assert not list(path.parent.glob("*.part"))
    assert path.suffix == ".exr" and len(bpy.data.scenes) == scenes
    saved = next(iter(exr.read(path).values()))
    np.testing.assert_allclose(saved[..., :3], _plate(ready)[..., :3], rtol=1e-3, atol=1e-4)
    ready.arto.use_in_compositor = "VIEWER"


def test_compare_puts_plate_and_render_side_by_side(ready, tmp_path) -> None:
    plate = _plate(ready)
    render = cycles(ready, 4, 0, tmp_path)
    side = compare.joined(plate, render, "SIDE", 0.5)
    assert side.shape == plate.shape
    np.testing.assert_array_equal(side[:, :12], plate[:, 6:18])
    np.testing.assert_array_equal(side[:, 12:], render[:, 6:18])
    wiped = compare.joined(plate, render, "WIPE", 0.25)
    np.testing.assert_array_equal(wiped[:, :6], plate[:, :6])
    np.testing.assert_array_equal(wiped[:, 7:], render[:, 7:])
    np.testing.assert_array_equal(compare.joined(plate, render, "OFF", 0.3), plate)
    np.testing.assert_array_equal(compare.joined(plate, render, "RENDER", 0.3), render)


def test_the_overlay_is_around_the_scene(ready) -> None:
    """Each patch is drawn at its place, twice the radius away, and nothing is in the scene."""
    hemicube = overlay.hemicube_of(ready)
    middle, radius = overlay.middle_of(ready)
    things = len(ready.objects)
    faces, edges = overlay.triangles(hemicube, middle, 2 * radius)
    assert faces.shape == (6 * len(hemicube), 3) and edges.shape == (8 * len(hemicube), 3)
    far = np.abs(faces - middle).max(axis=-1)
    np.testing.assert_allclose(far, 2 * radius, rtol=1e-5)
    for k in (0, len(hemicube) - 1):
        middle_of_patch = faces[6 * k : 6 * k + 6].mean(axis=0) - middle
        assert hemicube.locate(middle_of_patch[None].astype(float))[0][0] == k
    assert len(ready.objects) == things


def test_quality_is_a_multiple_of_the_scenes_own(tmp_path) -> None:
    scene = small_scene(tmp_path)
    assert samples_of(scene) == 64  # a script said how many
    scene.cycles.use_adaptive_sampling, scene.cycles.samples = False, 400
    scene.arto.quality = "GOOD"
    assert samples_of(scene) == 400
    scene.arto.quality = "DRAFT"
    assert samples_of(scene) == 100
    scene.arto.quality = "FINAL"
    assert samples_of(scene) == 1600
    scene.cycles.use_adaptive_sampling, scene.cycles.samples = True, 4096
    assert samples_of(scene) == 1024
    scene.arto.samples = 7
    assert scene.arto.quality == "CUSTOM" and samples_of(scene) == 7
    scene.arto.quality = "DRAFT"
    scene.cycles.use_adaptive_sampling, scene.cycles.samples = False, 8
    assert captured(scene).head.samples == 2


def test_states_before_a_capture(tmp_path) -> None:
    scene = small_scene(tmp_path)
    assert state.told(scene).lines == ("No capture yet",)
    assert len(state.price(scene)) == 2 and "while it runs" in state.price(scene)[1]
    scene.arto.folder = "//arto/"
    found = state.told(scene)
    assert found.kind == "blocked" and "never saved" in found.lines[0]
    scene.arto.folder = str(tmp_path / "arto")
    scene.render.engine = "BLENDER_WORKBENCH"
    assert state.told(scene).kind == "blocked"
    scene.render.engine = "CYCLES"
    captured(scene)
    found = state.told(scene)
    assert (found.kind, found.button) == ("unfitted", "Continue")
    work.run(fit.fit(scene))
    assert state.told(scene).kind == "ready"
    scene.camera = None
    assert state.told(scene).lines == ("The scene has no camera",)


def test_an_unfinished_capture_goes_on(tmp_path) -> None:
    scene = small_scene(tmp_path)
    scene.arto.memory = 1
    scene.render.resolution_x, scene.render.resolution_y = 320, 240
    scene.arto.samples = 1
    steps = shoot.shoot(scene)
    for step in steps:
        if isinstance(step, work.Render):
            if "render 2 of" in step.text:
                steps.close()
                break
            work.blocking_render(step)
    found = state.told(scene)
    assert (found.kind, found.button) == ("unfinished", "Continue")
    assert found.lines[0].startswith("1 of ") and "tiles done" in found.lines[0]
    # what is left costs as much for each pixel as the first tile did
    (header,) = paths.place(scene).source.glob("unfinished-*/capture.json")
    head = status.capture_at(header).head
    seconds, known = state._seconds(scene, 320 * 240, head)
    left = 320 * 240 / head.tiles[0].region.pixels - 1
    assert known and seconds == pytest.approx(state.OTHERS + left * head.seconds)
    # of another quality, or of another scene, another one would begin
    scene.arto.samples = 2
    assert (state.told(scene).button, state.told(scene).stopped) == ("Capture", True)
    scene.arto.samples = 1
    assert state.told(scene).button == "Continue"
    bpy.data.materials["Matt"].node_tree.nodes["Principled BSDF"].inputs[2].default_value = 0.9
    assert state.told(scene).button == "Capture"


def test_a_built_hemicube_can_be_seen_and_is_the_one_that_captures(tmp_path) -> None:
    scene = small_scene(tmp_path)
    bpy.ops.arto.build_hemicube()
    hemicube, radius = planes.built(scene)
    assert hemicube.size == pytest.approx(1000 * radius)
    corners = [
        o.matrix_world @ v.co for o in planes.of_artist(scene).objects for v in o.data.vertices
    ]
    assert max(abs(x) for corner in corners for x in corner) < 10 * radius


def test_the_button_in_a_batch_run_shows_the_plate(tmp_path) -> None:
    """As the three operators do: image and node are in the file, and the lamps in the panel."""
    scene = small_scene(tmp_path, lamp=True)
    scene.view_layers[0].lightgroups.add(name="sun")
    scene.objects["Sun"].lightgroup = "sun"
    scene.arto.keep, scene.arto.support, scene.arto.samples = "never", "auto", 8
    scene.arto.grain, scene.arto.patterns = False, "linear"
    assert bpy.ops.arto.shoot() == {"FINISHED"}
    assert tuple(bpy.data.images["ARTO Relit"].size) == (24, 18)
    assert any(n.label == "ARTO Relit" for n in compositor(scene).nodes)
    assert [g.name for g in scene.arto.own_groups] == ["sun"]
    # the lamp off by its eye: what is left is the world's light
    with_sun = _plate(scene)
    scene.arto.own_groups[0].show = False
    bpy.ops.arto.relight()
    without = _plate(scene)
    scene.arto.own_groups[0].show, scene.arto.own_lamps = True, 0.0
    bpy.ops.arto.relight()
    np.testing.assert_allclose(without, _plate(scene), atol=2e-3)
    assert with_sun[..., :3].mean() > 1.2 * without[..., :3].mean()


def test_no_two_looks_have_one_name(tmp_path) -> None:
    scene = small_scene(tmp_path)
    looks.add(scene, "Dawn")
    looks.add(scene, "Dusk")
    settings = scene.arto
    settings.looks[1].name = "Dawn"
    assert [k.name for k in settings.looks] == ["Dawn", "Dawn 2"]
    assert settings.look == "Dawn 2"
    settings.looks[0].name = "Noon"
    assert settings.look == "Dawn 2"
    settings.looks[1].name = ""
    assert settings.look == settings.looks[1].name == "Look"


def test_sentences_are_never_clipped() -> None:
    """A label is cut at its end by Blender: what is long is in lines."""
    text = "Captured through the camera with a long name, the camera is another"
    lines = _lines(text, 34)
    assert " ".join(lines) == text and max(map(len, lines)) <= 34
    wide = _lines("このショットはまだキャプチャされていません。カメラを選んでください", 30)
    assert max(map(len, wide)) <= 15 and "".join(wide).startswith("このショット")
