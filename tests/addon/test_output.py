"""What an artist's file says of its output changes nothing of what is written for us."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender.output import set_format, write_to
from arto.arto_addon.blender.version import FIVE
from arto.arto_addon.fit import fit
from arto.arto_addon.relight import relight
from arto.arto_addon.stage.settings import prepare
from arto.arto_addon.stage.stage import stage
from arto.arto_addon.world.background import background
from arto.core import exr
from scene_tools import HEIGHT, WIDTH, captured, set_colour, small_scene

# Of the render settings, what is rendered and not how it is written; the engine is checked.
PICTURE = {"engine", "filepath", "resolution_x", "resolution_y", "resolution_percentage"}


def staged(scene: Any, path: Any) -> dict[str, np.ndarray]:
    """A render of the stage, with a light group: its parts by name."""
    with stage(scene, scene.view_layers[0].name) as on:
        prepare(on, layers=0)
        on.change("cycles.samples", 1)
        on.scene.view_layers[0].lightgroups.add(name="group")
        write_to(on.scene.render, path)
        request = work.Render(on.scene.name, 0, "")
        work.blocking_render(request)
        request.check()
    return exr.read(path)


def others(owner: Any, prop: Any) -> list[Any]:
    """The values of a setting that it does not have, a few of them."""
    now = getattr(owner, prop.identifier)
    if prop.type == "BOOLEAN":
        return [not now] if not prop.is_array else []
    if prop.type == "ENUM":
        if prop.is_enum_flag:
            return []
        return [e.identifier for e in prop.enum_items_static if e.identifier != now]
    if prop.type in {"INT", "FLOAT"} and not prop.is_array:
        low, high = prop.soft_min, prop.soft_max
        return [v for v in (low, high) if v != now and abs(v) < 1e6]
    return []


def tried(scene: Any, owner: Any, skip: set[str], path: Any) -> tuple[list[str], int]:
    """Every setting of `owner` at its other values, one at a time: where parts differ."""
    expected = staged(scene, path)
    wrong, count = [], 0
    for prop in owner.bl_rna.properties:
        name = prop.identifier
        if prop.is_readonly or name in skip:
            continue
        before = getattr(owner, name)
        for value in others(owner, prop):
            try:
                setattr(owner, name, value)
            except TypeError:
                continue  # not offered beside the others
            found = staged(scene, path)
            count += 1
            if found.keys() != expected.keys():
                wrong.append(f"{name}={value}: parts")
            elif any(
                found[k].shape != expected[k].shape
                or np.abs(found[k].mean() - expected[k].mean()) > 0.1 * expected[k].mean() + 1e-3
                for k in expected
                if "Denoising" not in k
            ):
                wrong.append(f"{name}={value}: pixels")
        setattr(owner, name, before)
    return wrong, count


@pytest.fixture
def plain(tmp_path):
    scene = small_scene(tmp_path, lamp=True)
    # a sun in the view alone: any stamp or dithering over it shows
    scene.render.film_transparent = False
    return scene


@pytest.mark.parametrize(
    ("media", "kind"),
    [("IMAGE", "PNG"), ("MULTI_LAYER_IMAGE", "OPEN_EXR_MULTILAYER"), ("VIDEO", "FFMPEG")],
)
def test_image_settings_decide_nothing(plain, tmp_path, media, kind):
    settings = plain.render.image_settings
    set_format(settings, media, kind)
    wrong, count = tried(plain, settings, set(), tmp_path / "picture.exr")
    assert not wrong
    assert count > 10


def test_render_settings_of_writing_decide_nothing(plain, tmp_path):
    """All that Blender has, but those which say what is rendered."""
    render = plain.render
    skip = PICTURE | {
        "film_transparent",
        "use_border",
        "pixel_aspect_x",
        "pixel_aspect_y",
        "use_simplify",
        "threads",
        "threads_mode",
        "bake",
    }
    wrong, count = tried(plain, render, skip, tmp_path / "picture.exr")
    assert not wrong
    assert count > 60


# what Blender's own paths, or Python's, give a meaning: a few in a name, in two orders
@pytest.mark.parametrize("name", ["}{ 100% v1.2.#3### {{x}}", "ü 日本 %04d %s a{b} {blend_name}"])
def test_odd_folders_are_just_folders(tmp_path, name):
    """Whatever is in a folder's name, the plate is the same and stands where it was asked for."""
    folder = tmp_path / name
    folder.mkdir()
    scene = small_scene(folder)
    scene.arto.samples, scene.arto.patterns, scene.arto.denoise = 4, "linear", True
    scene.arto.adaptive = True
    set_colour(scene, (0.5, 0.5, 0.5))
    captured(scene)
    work.run(fit.fit(scene))
    path, _ = work.run(relight.relight(scene))
    assert path == folder / "relit.exr"
    assert exr.read(path)[""].shape == (HEIGHT, WIDTH, 4)
    # nothing beside it that a template would have made
    assert [p.name for p in tmp_path.iterdir()] == [name]


def test_a_stamp_is_not_burnt_into_the_light(tmp_path):
    scene = small_scene(tmp_path, lamp=True)
    scene.arto.samples, scene.arto.patterns, scene.arto.grain = 4, "linear", False
    clean = captured(scene).read(0).own
    scene.render.use_stamp = True
    scene.render.stamp_font_size = 8
    scene.render.stamp_background = (1, 0, 1, 1)
    np.testing.assert_allclose(captured(scene).read(0).own, clean, atol=1e-5)
    np.testing.assert_allclose(background(scene), 0.0509, atol=1e-3)


def test_the_header_says_what_blenders_own_does(tmp_path):
    """Attribute by attribute, beside F12's file of the same scene; but for what a render took."""
    scene = small_scene(tmp_path)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    r = scene.render
    r.pixel_aspect_x, r.stamp_note_text = 1.5, "graded for dusk"
    for flag in ("lens", "note", "marker", "hostname", "frame_range"):
        setattr(r, f"use_stamp_{flag}", True)
    r.use_stamp_camera = False
    scene.timeline_markers.new("take 2", frame=1)
    scene.frame_set(7)
    r.fps, r.fps_base = 24, 1.001
    captured(scene)
    work.run(fit.fit(scene))
    plate, _ = work.run(relight.relight(scene))
    r.filepath, r.image_settings.file_format = str(tmp_path / "own.exr"), "OPEN_EXR"
    scene.cycles.samples = 1
    bpy.ops.render.render(write_still=True)
    own, found = exr.header(tmp_path / "own.exr"), exr.header(plate)
    told = [n for n in own if n[0].isupper() and n not in {"RenderTime", "Date"}]
    assert {"File", "Lens", "Marker", "Note", "Frame"} <= set(told)
    assert ("Software" in told) == FIVE  # a plate says it in any case
    assert "Camera" not in own and "Camera" not in found
    assert {n: found.get(n) for n in told} == {n: own[n] for n in told}
    assert found["pixelAspectRatio"] == own["pixelAspectRatio"]
    assert abs(len(found["Date"]) - len(own["Date"])) == 0
    assert found["framesPerSecond"] == Fraction(24000, 1001)
    assert found["timeCode"] == exr.TimeCode(0, 0, 0, 7)
