"""A hidden world's own plate comes back as a look; what no light makes is told."""

from __future__ import annotations

import json
from pathlib import Path

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender.nodes import new_world
from arto.arto_addon.capture.capture import capture
from arto.arto_addon.kit import kit as kits
from arto.arto_addon.match import apply, region
from arto.arto_addon.match.asked import asked, paint_over, pixels_of
from arto.arto_addon.match.found import match_file, read
from arto.arto_addon.match.match import even_out, match_target
from arto.arto_addon.plate.names import relit_file
from arto.arto_addon.relight.relight import compute
from arto.arto_addon.ui import cli
from arto.arto_addon.world import controls
from arto.core import exr
from arto.core.errors import TargetError
from arto.core.kit.light import Light
from arto.core.kit.model import Base, BaseKind, Kit
from scene_tools import hdri, set_colour, small_scene, smooth

LAYER = "ViewLayer"


@pytest.fixture(scope="module")
def captured_shot(tmp_path_factory):
    folder = tmp_path_factory.mktemp("match")
    scene = small_scene(folder, lamp=True)
    settings = scene.arto
    settings.output = str(folder / "shot_relit.exr")
    settings.samples, settings.patches, settings.adaptive = 16, 2, False
    settings.keep, settings.denoise, settings.lamps = "never", False, False
    settings.environment_width = 64
    scene.render.film_transparent = True
    hdri(scene, smooth(16))
    work.run(capture(scene, LAYER))
    return scene


@pytest.fixture
def shot(captured_shot):
    """The shot under an even grey world, with the settings of a new file."""
    scene = captured_shot
    settings = scene.arto
    scene.world = new_world("Grey")
    set_colour(scene, (0.4, 0.4, 0.4))
    settings.looks.clear()
    settings.look, settings.match_change, settings.match_near = "", "LIGHT", 0.0
    settings.match_target, settings.match_mask, settings.match_keep = "", None, None
    settings.match_exposure = settings.match_balance = settings.match_colours = False
    settings.match_own, settings.own_lamps = False, 1.0
    return scene


def plate_of(scene, world=None) -> np.ndarray:
    before = scene.world
    scene.world = world or before
    path, _ = work.run(compute(scene, LAYER))
    scene.world = before
    return next(iter(exr.read(path).values()))


def as_target(scene, tmp_path: Path, picture: np.ndarray) -> Path:
    path = tmp_path / "target.exr"
    exr.write(path, {"": np.ascontiguousarray(picture, np.float32)})
    scene.arto.match_target = str(path)
    return path


@pytest.fixture
def hidden(shot):
    grey, shot.world = shot.world, new_world("Hidden")
    hdri(shot, smooth(16))
    world, shot.world = shot.world, grey
    return world


def mean_error(one: np.ndarray, two: np.ndarray) -> float:
    solid = two[..., 3] > 0.99
    return float(np.abs(one - two)[solid][:, :3].mean() / two[solid][:, :3].mean())


def test_a_hidden_worlds_own_plate_comes_back(shot, hidden, tmp_path) -> None:
    target = plate_of(shot, hidden)
    as_target(shot, tmp_path, target)
    path = work.run(match_target(shot, LAYER))
    assert path == match_file(relit_file(shot)) and shot.world.name.startswith("Grey")
    before = mean_error(plate_of(shot), target)
    found = apply.apply(shot, path)
    assert found.error < 0.05 < found.before and "off by" in found.words
    # the light is a look, marked as a file of its plate, and the light as it was is one as well
    assert [look.name for look in shot.arto.looks] == [apply.BEFORE, "Matched"]
    assert shot.arto.look == "Matched" and shot.arto.looks[0].world.name.startswith("Grey")
    assert exr.header(Path(found.world))["arto.plate"] == relit_file(shot).name
    assert mean_error(plate_of(shot), target) < 0.15 * before
    assert bpy.data.images[apply.IMAGE].size[0] > 1
    # again: another look, and the first one's file stays
    again = apply.apply(shot, work.run(match_target(shot, LAYER)))
    assert again.look == "Matched 2" and again.world != found.world
    assert Path(found.world).is_file()


def test_the_command_matches(shot, hidden, tmp_path) -> None:
    path = as_target(shot, tmp_path, plate_of(shot, hidden))
    report = tmp_path / "report.json"
    made = cli.main(["match", str(path), "--match-near", "0.1", "--json", str(report)])
    assert made == 0
    assert shot.arto.look == "Matched"
    assert [Path(p).name for p in json.loads(report.read_text())["wrote"]] == [
        "shot_relit_Matched_world.exr"
    ]
    assert cli.main(["match", str(tmp_path / "none.exr")]) == 1


def test_a_shadow_without_a_cause_is_told(shot, hidden, tmp_path) -> None:
    target = plate_of(shot, hidden)
    solid = np.argwhere(target[..., 3] > 0.99)
    y, x = solid.mean(axis=0).astype(int)
    target[y - 3 : y + 3, x - 5 : x + 5, :3] *= 0.1
    as_target(shot, tmp_path, target)
    said = []
    path = work.run(match_target(shot, LAYER), said.append)
    assert any(isinstance(s, work.Warned) and "no light makes" in s.text for s in said)
    assert "dark" in read(path).words
    difference = next(iter(exr.read(path).values()))
    assert difference.min() < -0.02


def test_strengths_of_a_kit_and_lamps_come_back(shot, tmp_path) -> None:
    kit = Kit(
        (Light("Key", azimuth=-90, elevation=40, width=60, height=60, strength=2.0),),
        Base(BaseKind.GRADIENT, top=(0.3,) * 3, horizon=(0.2,) * 3, bottom=(0.1,) * 3),
    )
    kits.write(shot.world, kit)
    target = plate_of(shot)
    as_target(shot, tmp_path, target)
    warm = kit.lights[0].__class__(**{**vars(kit.lights[0]), "strength": 0.5})
    kits.write(shot.world, Kit((warm,), Base(**{**vars(kit.base), "strength": 3.0})))
    shot.arto.own_lamps = 0.3
    shot.arto.match_change, shot.arto.match_own = "GAINS", True
    found = apply.apply(shot, work.run(match_target(shot, LAYER)))
    assert found.error < 0.03 and not found.world
    now = kits.read(shot.world)
    assert now.light("Key").strength == pytest.approx(2.0, rel=0.1)
    assert now.base.strength == pytest.approx(1.0, rel=0.1)
    assert shot.arto.own_lamps == pytest.approx(1.0, rel=0.05)
    # the world as it was has kept its values
    assert kits.read(shot.arto.looks[0].world).light("Key").strength == pytest.approx(0.5)


def test_turn_and_strength_of_a_world_come_back(shot, hidden, tmp_path) -> None:
    turned = hidden.copy()
    controls.set_turn(turned, np.radians(50))
    controls.set_strength(turned, 2.0)
    as_target(shot, tmp_path, plate_of(shot, turned))
    shot.world, shot.arto.match_change = hidden, "TURN"
    apply.apply(shot, work.run(match_target(shot, LAYER)))
    assert controls.strength(shot.world) == pytest.approx(2.0, rel=0.05)
    assert np.degrees(controls.turn(shot.world)) == pytest.approx(50, abs=4)


def test_a_photograph_of_bytes_is_read_as_light(shot, tmp_path) -> None:
    image = bpy.data.images.new("Photo", 48, 36)
    image.pixels.foreach_set(np.tile(np.float32([0.5, 0.25, 1.0, 1.0]), 48 * 36))
    light = pixels_of(image)
    np.testing.assert_allclose(light[0, 0, :3], [0.2159, 0.0513, 1.0], atol=0.002)
    shot.arto.match_image = image
    found = asked(shot, (18, 24))
    assert found.picture.shape == (18, 24, 3) and "was scaled" in found.words
    with pytest.raises(TargetError, match="other proportions"):
        asked(shot, (20, 20))
    shot.arto.match_image = None
    with pytest.raises(TargetError, match="there is no target"):
        asked(shot, (18, 24))
    shot.arto.match_target = str(tmp_path / "none.png")
    with pytest.raises(TargetError, match="there is no file"):
        asked(shot, (18, 24))


def test_what_is_behind_the_things_does_not_count(shot, hidden, tmp_path) -> None:
    """And neither what the mask leaves out."""
    target = plate_of(shot, hidden)
    target[target[..., 3] < 0.5] = (9.0, 0.0, 9.0, 1.0)
    mask = bpy.data.images.new("Mask", 24, 18, alpha=False)
    white = np.ones((18, 24, 4), np.float32)
    white[-4:] = (0, 0, 0, 1)
    mask.pixels.foreach_set(white[::-1].ravel())
    target[-4:] = 7.0
    as_target(shot, tmp_path, target)
    shot.arto.match_mask = mask
    assert read(work.run(match_target(shot, LAYER))).error < 0.05


def test_a_plate_that_is_painted_over_is_a_target(shot, hidden) -> None:
    """Painted warmer all over: the light is warmer."""
    plate_of(shot)
    image = paint_over(shot)
    assert tuple(image.size) == (24, 18) and shot.arto.match_image == image
    pixels = np.empty(24 * 18 * 4, np.float32)
    image.pixels.foreach_get(pixels)
    pixels.reshape(-1, 4)[:, :3] *= (1.3, 1.0, 0.7)
    image.pixels.foreach_set(pixels)
    shot.arto.own_lamps = 0.0
    found = apply.apply(shot, work.run(match_target(shot, LAYER)))
    red, _, blue = exr.read(Path(found.world))[""].mean(axis=(0, 1))
    assert red / blue > 1.4


def test_a_region_says_where_its_light_is_from(shot) -> None:
    told = region.where_from(shot, (12, 12))
    assert sum(p.share for p in told.parts) == pytest.approx(1)
    assert {"world", "scene lamps"} == {p.name for p in told.parts}
    assert sum(d.share for d in told.directions) == pytest.approx(1)
    assert told.lines[0].startswith("Lit ")


def test_a_region_is_made_even(shot, hidden) -> None:
    shot.world = hidden
    with pytest.raises(TargetError, match="no region"):
        work.run(even_out(shot, LAYER))
    mask = bpy.data.images.new("Region", 24, 18, alpha=False)
    region_pixels = np.zeros((18, 24, 4), np.float32)
    region_pixels[11:15, 4:20] = 1
    mask.pixels.foreach_set(region_pixels[::-1].ravel())
    shot.arto.match_mask = mask
    before = plate_of(shot)[11:15, 4:20, :3].mean(axis=-1)
    found = apply.apply(shot, work.run(even_out(shot, LAYER)))
    after = plate_of(shot)[11:15, 4:20, :3].mean(axis=-1)
    assert found.look == "Even"
    assert after.std() / after.mean() < 0.9 * before.std() / before.mean()
