"""What the table of settings says is so: in the keys, on a farm, in the panels."""

from __future__ import annotations

import ast
import dataclasses
import os
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import pytest
from arto.arto_addon.capture.asked import asked
from arto.arto_addon.farm.job import settings_of
from arto.arto_addon.relight.light_key import light_key
from arto.arto_addon.settings.setting import Setting
from arto.arto_addon.settings.table import SETTINGS
from arto.arto_addon.ui import light_panel, more_panels, result_panel, shot_panel
from arto.arto_addon.ui.lists import ENTRIES
from arto.core import exr
from arto.core.field.about import About
from scene_tools import hdri, small_scene, smooth

from tools import setting_types

VALUES = [s for s in SETTINGS if s.kind not in ("image", "list")]


@pytest.fixture
def scene(tmp_path) -> bpy.types.Scene:
    """A scene in which every setting counts: the hemicube is near, and its images are not kept."""
    made = small_scene(tmp_path)
    hdri(made, smooth(16))
    made.camera.rotation_euler.z = 0.5
    settings = made.arto
    settings.keep, settings.far, settings.samples, settings.rotation = "never", False, 77, 0.1
    return made


def other(setting: Setting, value: Any) -> Any:
    """A value that the setting does not have."""
    if setting.kind == "switch":
        return not value
    if setting.kind == "choice":
        return next(identifier for identifier, _, _ in setting.items if identifier != value)
    if setting.kind == "choices":
        return set(value) - {setting.items[0][0]}
    if setting.kind == "text":
        return f"{value}other"
    return value / 2 + 1 if setting.kind == "number" else value + 3


def keys(scene: bpy.types.Scene) -> tuple[str, str]:
    """Of a capture, and of the light of a plate."""
    with asked(scene, scene.view_layers[0].name) as this:
        return this.key, light_key(scene, scene.world)


def test_a_setting_says_all_that_hangs_on_it():
    """Nobody adds one without asking whether it decides, and where it goes."""
    facts = {f.name: f for f in dataclasses.fields(Setting)}
    for name in ("work", "decides", "farm", "option", "panels"):
        assert facts[name].default is dataclasses.MISSING
        assert facts[name].default_factory is dataclasses.MISSING


def test_a_scene_has_the_settings_of_the_table(scene):
    there = {p.identifier for p in scene.arto.bl_rna.properties} - {"rna_type", "name"}
    assert there == {s.name for s in SETTINGS}


def test_the_types_of_settings_are_those_of_the_table():
    """pyright checks the names of settings and the items of choices by these files."""
    there = setting_types.FILE.read_text(encoding="utf-8")
    assert there == setting_types.text(), "run python -m tools.setting_types"
    lists = setting_types.FILE.with_name("arto_lists.pyi").read_text(encoding="utf-8")
    said = {
        node.name: {line.target.id for line in node.body if isinstance(line, ast.AnnAssign)}
        for node in ast.parse(lists).body
        if isinstance(node, ast.ClassDef)
    }
    for kind in ENTRIES.values():
        there = {p.identifier for p in kind.bl_rna.properties} - {"rna_type"}
        assert there in said.values(), kind


@pytest.mark.parametrize("setting", VALUES, ids=lambda s: s.name)
def test_a_setting_decides_what_it_says(scene, setting):
    capture, plate = keys(scene)
    setattr(scene.arto, setting.name, other(setting, getattr(scene.arto, setting.name)))
    after = keys(scene)
    assert (after[0] != capture) == setting.decides.of_capture
    assert (after[1] != plate) == setting.decides.of_plate


@pytest.mark.parametrize("name", ["keep_limit", "support", "separate"])
def test_a_fit_decides_no_capture_whose_images_are_kept(scene, name):
    scene.arto.keep = "always"
    before = keys(scene)
    (setting,) = (s for s in SETTINGS if s.name == name)
    setattr(scene.arto, name, other(setting, getattr(scene.arto, name)))
    assert keys(scene) == before


def test_lists_decide_what_they_say(scene):
    scene.arto.layers = "GROUPS"
    before = keys(scene)
    for setting in (s for s in SETTINGS if s.kind == "list"):
        entry = getattr(scene.arto, setting.name).add()
        entry.name = "new"
        capture, plate = keys(scene)
        assert (capture != before[0], plate != before[1]) == (
            setting.decides.of_capture,
            setting.decides.of_plate,
        )
        getattr(scene.arto, setting.name).clear()


# What no file of a plate has: how the window shows it, and the names by which it is found.
OF_NO_PLATE = {
    "look", "output", "overwrite", "use_in_compositor", "compare", "wipe", "live_finish",
    "live_first", "looks", "active_look", "active_own_group", "active_group",
    "finish_samples",
}  # fmt: skip


def test_all_that_a_relight_reads_decides_a_plate():
    """A new setting is in the key, unless it is of the window alone."""
    read = {s.name: s.decides.of_plate for s in SETTINGS if s.work == "relight"}
    assert {name for name, decides in read.items() if not decides} == OF_NO_PLATE


def changed(scene, change) -> bool:
    before = light_key(scene, scene.world)
    change()
    return light_key(scene, scene.world) != before


def test_all_that_a_plate_shows_is_in_its_key(scene, tmp_path):
    """Camera, frame, size, region, footage, groups: two plates of one key are the same."""
    settings, render = scene.arto, scene.render
    group = settings.groups.add()
    other_camera = scene.camera.copy()
    scene.collection.objects.link(other_camera)
    filmed = tmp_path / "filmed.exr"
    image = bpy.data.images.new("Mask", 4, 2)
    render.use_border = settings.lamps = settings.denoise = True

    def of(target, name, value):
        return lambda: setattr(target, name, value)

    def moved():
        scene.camera.location.x += 1
        scene.view_layers[0].update()

    def written(value):
        def write():
            exr.write(filmed, {"": np.full((18, 24, 3), value, np.float32)})
            os.utime(filmed, ns=(1, 1))
            if settings.footage is None:
                settings.footage = bpy.data.images.load(str(filmed))

        return write

    changes = [
        moved, of(scene.camera.data, "lens", 40), of(scene, "camera", other_camera),
        lambda: scene.frame_set(7), lambda: scene.frame_set(7, subframe=0.5),
        of(render, "resolution_x", 48), of(render, "resolution_percentage", 50),
        of(render, "border_max_x", 0.5),
        of(render, "pixel_aspect_x", 2.0), of(render, "film_transparent", True),
        of(scene.cycles, "film_transparent_glass", True),
        of(scene.view_layers[0], "name", "Other"),
        *(of(group, name, 0.3) for name in ("azimuth", "elevation", "radius", "soft")),
        of(group, "name", "key"), of(group, "mask", image),
        lambda: image.pixels.foreach_set(np.full(32, 0.7, np.float32)),
        of(settings, "seed", 7), of(scene.cycles, "sample_clamp_indirect", 3.0),
        of(scene.cycles, "use_animated_seed", not scene.cycles.use_animated_seed),
        of(render, "compositor_denoise_final_quality", "FAST"),
        written(0.25), written(0.75),  # another picture of the same size and time
    ]  # fmt: skip
    assert not changed(scene, lambda: None)
    for number, change in enumerate(changes):
        assert changed(scene, change), number


def test_things_that_moved_make_another_plate(scene):
    """Cycles renders the light of suns on them as they are now."""
    field = SimpleNamespace(about=About(key="a", fingerprint={"Object 'Matt'": "as it was"}))
    one = light_key(scene, scene.world, None, field)
    assert one == light_key(scene, scene.world, None, field)
    scene.objects["Matt"].location.x += 1
    assert one != light_key(scene, scene.world, None, field)


def test_another_field_makes_another_plate(scene):
    def field(**about):
        return SimpleNamespace(about=About(**about))

    one = light_key(scene, scene.world, None, field(key="a", choice="auto"))
    assert one == light_key(scene, scene.world, None, field(key="a", choice="auto"))
    for about in ({"key": "b", "choice": "auto"}, {"key": "a", "choice": "box"}):
        assert one != light_key(scene, scene.world, None, field(**about))


def test_what_decides_a_capture_goes_to_a_farm(scene):
    """Its machines would capture something else; where files are is each machine's own."""
    goes = set(settings_of(scene))
    assert goes == {s.name for s in SETTINGS if s.farm}
    assert goes == {s.name for s in SETTINGS if s.decides.of_capture} | {"denoise"}
    assert all(s.option for s in SETTINGS if s.farm)


class Layout:
    """A panel's layout that writes down the settings that stand in it."""

    def __init__(self, settings: Any, found: set[str]) -> None:
        self._settings, self._found = settings, found

    def prop(self, of: Any, name: str, **_: Any) -> None:
        if of == self._settings:
            self._found.add(name)

    def template_list(self, _kind: str, _id: str, of: Any, name: str, at: Any, active: str, **_):
        self._found |= {name, active} if of == at == self._settings else set()

    def row(self, **_: Any) -> Layout:
        return Layout(self._settings, self._found)

    column = row

    def __getattr__(self, name: str) -> Any:
        # what a panel has besides settings: labels, buttons, pictures
        return lambda *_, **__: SimpleNamespace()


def test_a_setting_stands_in_the_panels_that_it_says(scene, monkeypatch):
    monkeypatch.setattr(result_panel, "plate_line", lambda scene: ("12:00", True))
    settings = scene.arto
    settings.preset, settings.keep, settings.layers = "custom", "fits", "GROUPS"
    settings.write_data, settings.lamps, settings.compare = True, True, "WIPE"
    settings.looks.add().name = "Evening"
    settings.own_groups.add().name = "Lamp"
    context = SimpleNamespace(
        scene=scene,
        window_manager=bpy.context.window_manager,
        preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1.0)),
        region=None,
    )
    panels = {
        "Shot": shot_panel.ShotPanel,
        "Light": light_panel.LightPanel,
        "Result": result_panel.Result,
        "Quality": shot_panel.Quality,
        "Layers": more_panels.Layers,
        "Storage": more_panels.Storage,
        "Method": more_panels.Method,
    }
    for title, panel in panels.items():
        found: set[str] = set()
        panel.draw_column(Layout(settings, found), context)
        said = {s.name for s in SETTINGS if title in s.panels}
        # an own group stands by itself, a row each
        assert found == said - {"own_groups"}, title
