"""A page shows in a browser what the field shows, and anyone can turn it."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender.display import image_of, saving
from arto.arto_addon.shot.shot import layer_of
from arto.arto_addon.web.display import table_of
from arto.arto_addon.web.make import Made, make
from arto.arto_addon.web.pages import SHOT, page
from arto.arto_addon.web.worlds import rays_of
from arto.core.errors import SceneError
from arto.core.web import file, view
from arto.core.web.reader import Dials, Reader
from arto.core.web.shot import Shot
from browser_tools import Browser, browsing, chromium, served
from mathutils import Vector


@pytest.fixture(scope="module")
def made(shot: bpy.types.Scene, tmp_path_factory: pytest.TempPathFactory) -> Made:
    return work.run(make(shot, layer_of(shot), tmp_path_factory.mktemp("page") / "for client"))


@pytest.fixture(scope="module")
def kept(made: Made) -> Shot:
    return file.from_bytes((made.index.parent / SHOT).read_bytes())


def test_it_is_near_the_plate_and_says_how_near(shot: bpy.types.Scene, made: Made) -> None:
    (error,) = made.errors.values()
    assert 0 < error.all < 0.05
    assert {p.name for p in made.index.parent.iterdir()} == {
        *("index.html", "for client.html", "look_0.jpg", SHOT)
    }
    # it is made again in its place, and not over files of others
    (made.index.parent / SHOT).rename(made.index.parent / "mine.txt")
    with pytest.raises(SceneError, match="of no page"):
        work.run(make(shot, layer_of(shot), made.index.parent))
    (made.index.parent / "mine.txt").rename(made.index.parent / SHOT)


def test_the_camera_looks_where_its_rays_go(shot: bpy.types.Scene) -> None:
    rays = rays_of(shot)
    camera = shot.camera
    corners = [camera.matrix_world.to_3x3() @ v for v in camera.data.view_frame(scene=shot)]
    middle = sum(corners, Vector()).normalized()
    height, width = rays.shape[:2]
    found = rays[height // 2 - 1 : height // 2 + 1, width // 2 - 1 : width // 2 + 1].mean((0, 1))
    assert found @ np.array(middle) / np.linalg.norm(found) > 1 - 1e-4
    # the frame begins at the upper right
    corner = rays[0, -1] / np.linalg.norm(rays[0, -1])
    assert corner @ np.array(corners[0].normalized()) > 0.999


@pytest.mark.parametrize("transform", ["AgX", "Standard"])
def test_the_table_shows_what_blender_shows(shot: bpy.types.Scene, transform: str) -> None:
    """Colours that are not on the grid, beside what Blender saves of them."""
    before = shot.view_settings.view_transform
    shot.view_settings.view_transform = transform
    try:
        table = table_of(shot)
        rng = np.random.default_rng(1)
        light = (2.0 ** rng.uniform(-8, 4, (16, 16, 3))).astype(np.float32)
        path = Path(bpy.app.tempdir) / "shown.png"
        with saving(shot, "PNG", "8") as on, image_of(light, float_buffer=True) as image:
            image.save_render(str(path), scene=on)
        saved = bpy.data.images.load(str(path))
        saved.colorspace_settings.name = "Non-Color"
        expected = np.array(saved.pixels[:]).reshape(16, 16, 4)[::-1, :, :3]
        bpy.data.images.remove(saved)
    finally:
        shot.view_settings.view_transform = before
    error = np.abs(view.shown(table, light.reshape(-1, 3)).reshape(16, 16, 3) - expected) * 255
    # the curve of Standard ends in a corner at white, between two places of the grid
    assert error.mean() < 1.5 and np.percentile(error, 99) < (4 if transform == "AgX" else 16)


def test_no_name_breaks_the_page() -> None:
    text = page("</script><b>", 1.5, ["</script>", "DATA"], [], "SCRIPT.html", b"TITLE")
    assert text.count("</script>") == 1 and "<b>" not in text
    assert '"DATA"' in text and "SCRIPT.html" in text


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if not chromium():
        pytest.skip("no Chromium is found on PATH, nor named by the variable CHROMIUM")
    with browsing() as found:
        yield found


def motion(browser: Browser, wanted: str) -> None:
    feature = {"name": "prefers-reduced-motion", "value": wanted}
    browser.call("Emulation.setEmulatedMedia", features=[feature])


def degrees(browser: Browser) -> int:
    return int(browser.run("document.getElementById('stage').getAttribute('aria-valuenow')"))


@pytest.mark.newest
def test_a_browser_shows_what_the_reader_shows(
    made: Made, kept: Shot, browser: Browser, tmp_path: Path
) -> None:
    reader, (height, width) = Reader(kept), kept.size
    browser.size(1280, 800)
    with served(made.index.parent) as address:
        assert browser.open(address) == "turns"
        for dials in (Dials(), Dials(turn=1.0, strength=1.5), Dials(turn=-2.0, behind=False)):
            said = (
                f"{{world: 0, turn: {dials.turn}, strength: {dials.strength}, own: 1, groups: {{}},"
                f" lights: {{}}, behind: {str(dials.behind).lower()}}}"
            )
            text = browser.run(f"btoa(String.fromCharCode(...picture.pixels({said})))")
            got = np.frombuffer(base64.b64decode(text), np.uint8).reshape(height, width, 4)
            want = view.shown(kept.view, reader.picture(dials).reshape(-1, 3)) * 255
            assert np.abs(got[..., :3] - want.reshape(height, width, 3)).max() <= 2
        assert not browser.complaints()
        # nothing but what is in the folder was asked for
        asked = [a for a in browser.addresses() if not a.startswith(("data:", "blob:"))]
        assert all(a.startswith(address) for a in asked)


@pytest.mark.newest
def test_it_turns_by_mouse_keys_and_touch(made: Made, browser: Browser) -> None:
    browser.size(1280, 800)
    motion(browser, "reduce")
    assert browser.open(made.single.as_uri()) == "turns"
    box = browser.run("(({x, y, width, height}) => [x, y, width, height])"
                      "(document.getElementById('stage').getBoundingClientRect())")  # fmt: skip
    x, y = box[0] + box[2] / 2, box[1] + box[3] / 2
    browser.drag(x, y, x + box[2] / 4, y)
    assert degrees(browser) == 45
    browser.run("document.getElementById('reset').click()")
    assert degrees(browser) == 0
    browser.run("document.getElementById('stage').focus()")
    browser.key("ArrowRight")
    assert degrees(browser) == 5
    browser.key("b")
    pressed = "document.getElementById('before').getAttribute('aria-pressed')"
    assert browser.run(pressed) == "true"
    # who turns on sees the present light again
    browser.key("ArrowLeft")
    assert browser.run(pressed) == "false"
    browser.size(390, 844, phone=True)
    assert browser.run("document.documentElement.scrollWidth") <= 390
    browser.run("document.getElementById('turn').value = 0")
    browser.drag(100, 150, 200, 150, touch=True)
    browser.settled()
    assert degrees(browser) > 20
    assert not browser.complaints()


@pytest.mark.newest
def test_motion_is_left_out_where_it_is_not_wanted(made: Made, browser: Browser) -> None:
    for wanted, at_once in (("reduce", True), ("no-preference", False)):
        motion(browser, wanted)
        browser.open(made.single.as_uri())
        browser.run("document.getElementById('stage').focus()")
        browser.key("ArrowRight", shift=True)
        assert (degrees(browser) == 30) == at_once
        browser.run("new Promise(r => setTimeout(r, 700))")
        assert degrees(browser) == 30


@pytest.mark.newest
def test_a_screen_reader_is_told_everything(made: Made, browser: Browser) -> None:
    browser.open(made.single.as_uri())
    found = {(role, name) for role, name, _ in browser.names()}
    assert {
        *(("slider", "Turn the light"), ("slider", "Turn"), ("slider", "Strength")),
        *(("button", "Before"), ("button", "Reset"), ("group", "World"), ("form", "Light")),
    } <= {(role, name.split("  ")[0]) for role, name in found}
    unnamed = {role for role, name in found if not name}
    assert not unnamed & {"slider", "button", "radio", "group", "form", "image"}


@pytest.mark.newest
def test_without_webgl_each_world_is_a_picture(made: Made) -> None:
    if not chromium():
        pytest.skip("no Chromium is found on PATH, nor named by the variable CHROMIUM")
    with browsing("--disable-3d-apis") as browser:
        assert browser.open(made.single.as_uri()) == "still"
        shown = "document.getElementById('still')"
        assert browser.run(f"{shown}.src.startsWith('data:image/jpeg') && {shown}.naturalWidth > 0")
        assert "no WebGL 2" in browser.run("document.getElementById('hint').textContent")
        names = {(role, name) for role, name, _ in browser.names()}
        assert ("slider", "Turn") not in names and ("button", "Before") in names
        assert not browser.complaints()
