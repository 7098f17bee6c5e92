"""Live: what is seen is the plate, turns need no map, and the newest wish wins."""

from __future__ import annotations

import time
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from arto.arto_addon import shoot, work
from arto.arto_addon.fit import fit
from arto.arto_addon.live import live, maps
from arto.arto_addon.live.image import IMAGE, put_away
from arto.arto_addon.live.viewer import Viewer, Wish
from arto.arto_addon.plate.names import relit_file
from arto.arto_addon.relight.relight import compute
from arto.arto_addon.resident import resident, sent
from arto.arto_addon.shot import paths, pixels
from arto.arto_addon.world import kept
from arto.arto_addon.world.dials import without_dials
from arto.core import exr
from arto.core.errors import SceneError
from scene_tools import captured, set_colour, small_scene


def _hdri(scene) -> None:
    image = bpy.data.images.new("Sky", 64, 32, float_buffer=True)
    rng = np.random.default_rng(0)
    pixels = np.ones((32, 64, 4), np.float32)
    pixels[..., :3] = rng.uniform(0.1, 2, (32, 64, 3))
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    image.pack()
    tree = scene.world.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    tree.links.new(texture.outputs[0], tree.nodes["Background"].inputs["Color"])


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    scene = small_scene(tmp_path_factory.mktemp("live"), lamp=True)
    scene.render.film_transparent = True
    scene.arto.environment_width, scene.arto.live_finish = 128, False
    scene.arto.samples, scene.arto.support = 16, "auto"
    _hdri(scene)
    captured(scene)
    work.run(fit.fit(scene))
    return scene


@pytest.fixture(autouse=True, scope="module")
def ended():
    """The second Blender serves all tests of this module."""
    yield
    resident.end(wait=True)


@pytest.fixture
def made() -> maps.Maps:
    return maps.Maps(resident.current())


@pytest.fixture
def on(scene):
    found = live.Live(scene)
    yield found
    found.close()
    put_away(found.name)


def _rest(on: live.Live) -> np.ndarray:
    """Tick until the whole picture is shown -> it, top-down."""
    until = time.monotonic() + 240
    while True:
        on.dirty = True
        assert on.tick()
        assert not on.trouble, on.trouble
        assert time.monotonic() < until, on.line
        if on.settled:
            break
        time.sleep(0.02)
    image = bpy.data.images[IMAGE]
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(image.size[1], image.size[0], 4)[::-1]


def test_what_is_seen_is_the_plate(scene, on) -> None:
    """To 1e-3 of the picture's light, before denoising; the scene's lamps too."""
    seen = _rest(on)
    work.run(compute(scene, scene.view_layers[0].name))
    plate = next(iter(exr.read(relit_file(scene)).values()))
    assert np.abs(seen - plate).max() < 1e-3 * plate[..., :3].mean()
    # and after a turn, a strength and less of the scene's lamps
    scene.world.arto.rotation, scene.world.arto.strength = 1.1, 0.6
    scene.arto.own_lamps = 0.5
    try:
        seen = _rest(on)
        work.run(compute(scene, scene.view_layers[0].name))
        plate = next(iter(exr.read(relit_file(scene)).values()))
        assert np.abs(seen - plate).max() < 1e-3 * plate[..., :3].mean()
    finally:
        scene.world.arto.rotation, scene.world.arto.strength = 0.0, 1.0
        scene.arto.own_lamps = 1.0


def test_turns_and_strengths_ask_for_no_map(scene, on, monkeypatch) -> None:
    scene.world.arto.rotation = 0.2  # puts its node in, which is another world
    _rest(on)
    asked = []
    monkeypatch.setattr(on.maps, "ask", lambda *a: asked.append(a))
    shown = [_rest(on)]
    for turn, strength in ((0.9, 1.0), (2.0, 0.5), (-1.0, 2.0)):
        scene.world.arto.rotation, scene.world.arto.strength = turn, strength
        shown.append(_rest(on))
    assert not asked
    assert all((a != b).any() for a, b in pairwise(shown))
    scene.world.arto.rotation, scene.world.arto.strength = 0.2, 1.0


def test_any_node_is_followed(scene, on) -> None:
    """A tint of the world multiplies what is seen, but for the scene's own lamps."""
    scene.arto.own_lamps = 0.0
    try:
        before = _rest(on)
        scene.world.arto.tint = (1.0, 0.25, 0.5)
        after = _rest(on)
        scale = np.array((1.0, 0.25, 0.5))
        lit = before[..., :3] > 0.02
        ratio = after[..., :3] / np.maximum(before[..., :3] * scale, 1e-6)
        assert np.abs(ratio[lit] - 1).max() < 0.02
    finally:
        scene.world.arto.tint, scene.arto.own_lamps = (1, 1, 1), 1.0


def test_a_world_that_cannot_light_is_said(scene, on) -> None:
    texture = next(
        n for n in scene.world.node_tree.nodes if n.bl_idname == "ShaderNodeTexEnvironment"
    )
    _rest(on)
    image, texture.image = texture.image, None
    on.dirty = True
    assert on.tick() and "no image" in on.trouble
    # another is put in, and it goes on
    texture.image = image
    _rest(on)
    assert not on.trouble


def test_live_ends_with_what_it_was_on_for(scene, on) -> None:
    """The file saved as another, and the world that is gone, each with a sentence."""
    _rest(on)
    on.blend = "/elsewhere/other.blend"
    with pytest.raises(SceneError, match="another name now"):
        on.tick()
    on.blend = bpy.data.filepath
    world, scene.world = scene.world, None
    try:
        on.dirty = True
        with pytest.raises(SceneError, match="no world any more"):
            on.tick()
    finally:
        scene.world = world
    assert on.tick()


def test_the_newest_wish_wins(on) -> None:
    """Of a thousand wishes at once few are begun, and the last one is shown."""
    image = np.ones((64, 128, 3), np.float32)
    viewer = Viewer(on.viewer.preview)
    try:
        for i in range(1000):
            viewer.wish(Wish(image, 1 + i, 0.0, 0.0, {}, resting=True))
        until = time.monotonic() + 240
        last = None
        while time.monotonic() < until:
            last = viewer.take() or last
            if last and last.wish.strength == 1000:
                break
            time.sleep(0.01)
        assert last and last.wish.strength == 1000
        assert viewer.made < 200
        # light is linear
        viewer.wish(Wish(image, 1.0, 0.0, 0.0, {}, resting=True))
        while (one := viewer.take()) is None and time.monotonic() < until:
            time.sleep(0.01)
        assert one is not None
        np.testing.assert_allclose(last.picture[..., :3], 1000 * one.picture[..., :3], rtol=1e-3)
    finally:
        viewer.close()


def test_a_map_that_is_on_its_way_is_shown_though_the_hand_moved_on(scene, on) -> None:
    """Else a hand that never rests would see nothing."""
    _rest(on)
    made = on.viewer.made
    until = time.monotonic() + 240
    i = 0
    while time.monotonic() < until and on.viewer.made < made + 3:
        i += 1
        scene.world.arto.tint = (1.0, 0.3 + 0.001 * i, 0.5)
        on.dirty = True
        on.tick()
        time.sleep(0.02)
    scene.world.arto.tint = (1, 1, 1)
    assert on.viewer.made >= made + 3


def _answer(made: maps.Maps, scene, key: str) -> str:
    """Ask for a map of another tint, by that key -> what went wrong."""
    assert made.ask(scene, scene.view_layers[0].name, scene.world, key, False)
    until = time.monotonic() + 240
    while made.busy:
        assert time.monotonic() < until
        time.sleep(0.02)
    return made.trouble_with(key)


def _kill() -> None:
    process = resident.current().process
    process.kill()
    process.wait(10)


def test_a_killed_blender_is_said_and_another_one_is_started(scene, made) -> None:
    resident.current().begin()
    _kill()
    assert _answer(made, scene, "one") == ""
    assert made.get("one", False) is not None
    # in the middle of a question
    made.ask(scene, scene.view_layers[0].name, scene.world, "lost", False)
    _kill()
    until = time.monotonic() + 240
    while made.busy and time.monotonic() < until:
        time.sleep(0.02)
    assert made.get("lost", False) is not None or "ended" in made.trouble_with("lost")
    assert _answer(made, scene, "two") == ""
    assert made.get("two", False) is not None
    # what failed is not asked for again and again
    made._failed["three", False] = "why"
    assert not made.ask(scene, scene.view_layers[0].name, scene.world, "three", False)
    assert made.trouble_with("three") == "why" and made.trouble_with("two") == ""


def test_no_room_for_the_worlds_file(scene, made, tmp_path) -> None:
    """A sentence, and it goes on once there is room again."""
    resident.current().begin()
    folder, made._sent._folder = made._sent._folder, tmp_path / "gone" / "far"
    with pytest.raises(SceneError, match="cannot be written"):
        made.ask(scene, scene.view_layers[0].name, scene.world, "one", False)
    assert not made.busy
    made._sent._folder = folder
    assert _answer(made, scene, "one") == ""


def test_half_a_map_is_said(scene, made, monkeypatch) -> None:
    assert _answer(made, scene, "one") == ""

    def half(path, most):
        raise ValueError(f"{path} is not what was written")

    monkeypatch.setattr(maps.arrays, "read", half)
    assert "cannot be read" in _answer(made, scene, "two")
    monkeypatch.undo()
    assert _answer(made, scene, "three") == ""


def test_nothing_is_left(scene) -> None:
    """Live switched off leaves the second Blender, for the next time; the file's end ends it."""
    before = {i.name for i in bpy.data.images}
    found = live.Live(scene)
    _rest(found)
    beside = resident.current()
    found.close()
    put_away(found.name)
    assert beside.process.poll() is None
    resident.end(wait=True)
    assert not beside.folder.exists() and beside.process.poll() is not None
    assert {i.name for i in bpy.data.images} == before


def whole_map(made: maps.Maps, scene) -> np.ndarray:
    """The map of the scene's world at full size, once it is there."""
    key = kept.shows(scene, scene.world)[0]
    made.ask(scene, scene.view_layers[0].name, scene.world, key, True)
    until = time.monotonic() + 240
    while (found := made.get(key, True)) is None:
        assert not made.trouble, made.trouble
        assert time.monotonic() < until
        time.sleep(0.05)
    return found


def test_maps_are_those_of_a_relight(scene, made) -> None:
    """What the other Blender makes is what this one makes, whole."""
    found = whole_map(made, scene)
    with without_dials(scene, scene.view_layers[0].name, scene.world) as (plain, _, _):
        expected = kept.environment(scene, 128, None, plain).image
    np.testing.assert_array_equal(found, expected)


def test_a_packed_hdri_is_sent_once_for_each_change(scene, made, monkeypatch) -> None:
    """And the map is that of a relight, kept by the same key."""
    monkeypatch.setattr(pixels, "FEW", 0)
    written, write = [], sent._write
    monkeypatch.setattr(
        sent, "_write", lambda path, of: (written.append(type(of)), write(path, of))
    )
    worlds, images = len(bpy.data.worlds), len(bpy.data.images)
    image = next(n.image for n in scene.world.node_tree.nodes if getattr(n, "image", None))
    painted = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(painted)
    try:
        for change in (1.0, 0.5):
            image.pixels.foreach_set(painted * np.tile(np.float32([change] * 3 + [1]), 64 * 32))
            image.update()
            image.pack()
            for tint in (0.9, 0.8):
                scene.world.arto.tint = (1.0, tint, 1.0)
                found = whole_map(made, scene)
                with without_dials(scene, scene.view_layers[0].name, scene.world) as (plain, _, _):
                    kept_as = f"{kept._key(scene, plain, 128)}.npy"
                    assert (paths.worlds_folder(scene) / kept_as).is_file()
                    np.testing.assert_array_equal(found, kept.bake(scene, 128, None, plain).image)
        kinds = [bpy.types.Image, bpy.types.World, bpy.types.World]
        assert written == 2 * kinds
    finally:
        scene.world.arto.tint = (1, 1, 1)
        image.pixels.foreach_set(painted)
        image.pack()
    assert (len(bpy.data.worlds), len(bpy.data.images)) == (worlds, images)


def test_another_film_while_it_is_on(scene, on) -> None:
    """The world behind comes and goes with the film; a film that the shot's Ray Portals were not
    captured for is said, and nothing wrong is shown meanwhile."""
    clear = _rest(on)
    scene.render.film_transparent = False
    try:
        opaque = _rest(on)
        assert (clear[..., 3] < 1).any() and (opaque[..., 3] == 1).all()
        scene.render.film_transparent = True
        np.testing.assert_array_equal(_rest(on), clear)
        on.opened.field = SimpleNamespace(about=replace(on.opened.field.about, portals=True))
        on.dirty = True
        assert on.tick() and "Ray Portals" in on.trouble
        made = on.viewer.made
        scene.world.arto.strength = 0.7
        on.dirty = True
        assert on.tick() and on.viewer.made == made
        scene.render.film_transparent = False
        _rest(on)
        assert on.viewer.made > made
    finally:
        scene.render.film_transparent, scene.world.arto.strength = True, 1.0


def test_a_linked_world(tmp_path, made) -> None:
    """What is in another file lights live as it does here."""
    scene = small_scene(tmp_path)
    _hdri(scene)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "library.blend"))
    scene = small_scene(tmp_path)
    scene.arto.environment_width = 128
    with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, into):
        into.worlds = ["World"]
    scene.world = into.worlds[0]
    assert scene.world.library
    worlds = len(bpy.data.worlds)
    found = whole_map(made, scene)
    np.testing.assert_array_equal(found, kept.environment(scene, 128).image)
    assert len(bpy.data.worlds) == worlds


def test_the_world_behind_and_a_render_region(tmp_path) -> None:
    """An even world is behind the things as it is behind the plate's, in the region alone."""
    scene = small_scene(tmp_path)
    scene.arto.keep, scene.arto.support, scene.arto.samples = "never", "auto", 8
    scene.arto.grain, scene.arto.patterns, scene.arto.live_finish = False, "linear", False
    scene.camera.data.lens /= 2
    scene.render.use_border = True
    scene.render.border_min_x, scene.render.border_max_y = 0.25, 0.9
    set_colour(scene, (0.5, 0.4, 0.3), 2.0)
    work.run(shoot.shoot(scene))
    plate = next(iter(exr.read(relit_file(scene)).values()))
    assert (plate[..., 3] == 0).any() and (plate[1:4, 12:, 3] == 1).any()
    on = live.Live(scene)
    try:
        seen = _rest(on)
    finally:
        on.close()
        put_away(on.name)
    assert np.abs(seen - plate).max() < 1e-3 * plate[..., :3].mean()
