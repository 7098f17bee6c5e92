"""Where things may be written, and what a shot's damaged or swapped files are told as."""

from __future__ import annotations

import json
import re
import shutil

import bpy
import pytest
from arto.arto_addon import work
from arto.arto_addon.capture import capture as captures
from arto.arto_addon.farm.plan import plan
from arto.arto_addon.plate.names import relit_file
from arto.arto_addon.relight import ahead, many
from arto.arto_addon.relight.shown import Shown
from arto.arto_addon.shot import home, paths, scene_id, status
from arto.arto_addon.ui import cli, report, state
from arto.arto_addon.ui.inventory import inventory
from arto.arto_addon.ui.options import parser
from arto.core.errors import FilesError, SceneError, ShotError
from arto.core.marked import MARK
from arto.core.places import around
from arto.core.signed import parsed, text_of


def states(shot):
    found = inventory(shot, shot.view_layers[0].name, None)
    return {thing.kind: (thing.state, thing.why) for thing in found.frames[0].things}


def test_nothing_is_put_into_a_folder_that_arto_removes(shot, tmp_path, monkeypatch):
    layer, field = shot.view_layers[0].name, paths.field_folder(shot)
    before = shot.arto.folder, shot.arto.output
    try:
        shot.arto.output = str(field / "plates" / "plate.exr")
        with pytest.raises(SceneError, match="removed with all that is in it"):
            work.run(many.relight_many(shot, layer, turns=2))
        shot.arto.folder = str(field / "more")
        with pytest.raises(SceneError, match="removed with all that is in it"):
            work.run(captures.capture(shot, layer))
        assert not (field / "more").exists()
    finally:
        shot.arto.folder, shot.arto.output = before
    monkeypatch.setattr("arto.arto_addon.farm.plan.home.file", lambda: "saved.blend")
    with pytest.raises(SceneError, match="removed with all that is in it"):
        work.run(plan(shot, layer, field.parent / "capture" / "job", None, 1, 1))
    with pytest.raises(report.OptionError, match="removed with all that is in it"):
        report.check_file(field / "report.json", report.FORMAT)
    with pytest.raises(SceneError, match=re.escape(f"lies in {field.resolve()}, a folder of")):
        home.check_outside(field / "a" / "b", "it")
    home.check_outside(tmp_path / "a", "it")
    assert around(field / "a" / "b") == field.resolve()
    assert around(tmp_path / "a") is None


def test_a_report_takes_no_name_of_arto(tmp_path):
    job = tmp_path / "job"
    for name in ("shot_relit_sky_0001.exr", "SHOT_CATCHER.EXR", "a.blend", "shot.json"):
        with pytest.raises(report.OptionError, match="own files"):
            report.Report("relight", tmp_path / name, lambda _: None)
    with pytest.raises(report.OptionError, match="own files"):
        report.Report("plan", job / "openjd.json", lambda _: None, job)
    with pytest.raises(report.OptionError, match="UTF-8"):
        report.Report("plan", tmp_path / "\udcff.json", lambda _: None)
    assert not list(tmp_path.iterdir())
    report.check_file(tmp_path / "openjd.json", report.FORMAT)
    report.check_file(job / "report.json", report.FORMAT, job)


def test_a_full_disk_is_no_wrong_option(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(report.FULL[0], "No space left on device")

    monkeypatch.setattr(report, "write_text", full)
    with pytest.raises(FilesError, match="make room"):
        report.Report("relight", tmp_path / "r.json", lambda _: None)


@pytest.mark.parametrize("option", ["--output", "--folder", "--json", "--worlds", "--cryptomatte"])
def test_names_that_are_no_text_are_wrong_options(option, capsys):
    with pytest.raises(SystemExit):
        parser().parse_args(["relight", option, "t9/\udcffo.exr"])
    assert "UTF-8" in capsys.readouterr().err
    assert cli.main(["relight", option, "t9/\udcffo.exr"]) == 2


def test_an_output_that_is_a_folder_is_said(shot, tmp_path):
    before = shot.arto.output
    (tmp_path / "renders").mkdir()
    try:
        for output in (tmp_path / "renders", tmp_path / "renders" / "..", tmp_path):
            shot.arto.output = str(output)
            with pytest.raises(SceneError, match="is a folder"):
                relit_file(shot)
        shot.arto.output = f"{tmp_path}/renders/"
        assert relit_file(shot).parent == tmp_path / "renders"
        shot.arto.output = f"{tmp_path}/renders.exr"
        assert relit_file(shot) == tmp_path / "renders.exr"
    finally:
        shot.arto.output = before
    options = {"scene": None, "view_layer": None, "output": "/"}
    cli._scene(options)
    assert options["output"] == "/"


def test_a_damaged_description_of_a_shot_is_named(shot):
    folder = paths.place(shot).folder
    header = folder / paths.HEADER
    text = header.read_text()
    header.write_text(text[:-40])
    try:
        with pytest.raises(ShotError, match=r"shot\.json is damaged"):
            Shown(shot, shot.view_layers[0].name)
        with pytest.raises(ShotError, match=r"shot\.json is damaged"):
            work.run(captures.capture(shot, shot.view_layers[0].name))
        assert states(shot)["shot"][0] == "damaged"
        assert "damaged" in status.capture_line(shot)[0] and "damaged" in state.told(shot).lines[0]
        header.unlink()  # as the message says
        assert paths.place(shot).source == folder
    finally:
        header.write_text(text)


def test_a_swap_between_frames_is_told(shot):
    assert {state for state, _ in states(shot).values()} <= {"whole", "missing"}
    folder = paths.place(shot).folder
    for header in (folder / "capture" / "capture.json", folder / "field" / "field.json"):
        text = header.read_text()
        data = parsed(text)
        data.get("about", data)["shot"]["frame"] = 2
        header.write_text(text_of(data))
        try:
            kind = header.parent.name
            assert states(shot)[kind] == ("outdated", "it is of another frame (2, now 1)")
        finally:
            header.write_text(text)
    text = (proxy := folder / "field" / "proxy_2" / "field.json").read_text()
    data = parsed(text)
    data["about"]["key"] = "another"
    proxy.write_text(text_of(data))
    try:
        assert states(shot)["field"][0] == "damaged" and "proxy" in states(shot)["field"][1]
    finally:
        proxy.write_text(text)


def test_a_field_of_an_earlier_capture_is_warned_of(shot):
    header = paths.place(shot).folder / "capture" / "capture.json"
    text = header.read_text()
    header.write_text(text_of({**parsed(text), "key": "0123456789abcdef"}))
    try:
        said = ahead.warnings(Shown(shot, shot.view_layers[0].name), shot.world)
        assert any("earlier capture" in text for text in said)
        assert states(shot)["field"][0] == "outdated"
    finally:
        header.write_text(text)
    assert json.loads(text)


def test_a_field_of_others_is_found_before_the_capture(shot):
    """Also where its mark is damaged."""
    for name in ("field", "ground/capture", "unfinished-12345678"):
        there = paths.place(shot).folder / name
        mark = there / MARK
        before = mark.read_text() if mark.is_file() else None
        there.mkdir(parents=True, exist_ok=True)
        mark.write_text("{")
        steps = captures.capture(shot, shot.view_layers[0].name)
        try:
            if name.startswith("unfinished"):
                continue  # of another key: nobody touches it
            with pytest.raises(FilesError, match="not made by ARTO"):
                next(steps)
        finally:
            steps.close()
            if before is None:
                mark.unlink()
                there.rmdir()
            else:
                mark.write_text(before)


def test_the_window_shows_captures_of_a_scene_of_this_name(shot, tmp_path):
    """Of another file, which has no ID of this scene's."""
    layer, own = shot.view_layers[0].name, shot.arto.scene_id
    scene_id.give(shot, "another")
    paths.forget()
    before = status._alike.copy()
    status._alike.clear()
    try:
        said = state.told(shot)
        assert said.kind == "other" and "Camera_0001" in said.lines[1]
        assert bpy.ops.arto.adopt() == {"FINISHED"}
        assert Shown(shot, layer).field.about.shot.scene_id == "another"
        assert state.told(shot).kind == "ready"
    finally:
        shutil.rmtree(paths.place(shot).folder)
        status._alike.update(before)
        scene_id.give(shot, own)
        paths.forget()
