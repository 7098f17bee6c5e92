"""The command line: what it wrote, warned of and failed in, its exit codes, and what there is."""

from __future__ import annotations

import json

import bpy
import numpy as np
import pytest
from arto.arto_addon.plate import plate
from arto.arto_addon.plate.names import relit_file
from arto.arto_addon.shot import home, paths, scene_id
from arto.arto_addon.ui import cli, options
from arto.core import exr


@pytest.fixture
def maps(tmp_path):
    files = [tmp_path / f"{name}.exr" for name in ("a", "broken", "c")]
    for n, file in enumerate(files):
        exr.write(file, {"": np.full((8, 16, 3), n + 1.0, np.float32)})
    files[1].write_bytes(files[1].read_bytes()[:-9])
    return [str(file) for file in files]


@pytest.fixture(autouse=True)
def clean(shot):
    yield
    for path in relit_file(shot).parent.glob("*.exr"):
        path.unlink()


def told(path, *arguments) -> tuple[int, dict]:
    """The exit code of a command and its report."""
    code = cli.main([*map(str, arguments), "--json", str(path)])
    return code, json.loads(path.read_text())


def test_a_report_says_what_was_written_and_what_failed(shot, maps, tmp_path):
    path = tmp_path / "report.json"
    code, said = told(path, "relight", "--worlds", *maps)
    assert code == 1 and said["outcome"] == "failed" and not said["wrote"]
    assert [f["of"] for f in said["failed"]] == ["shot_relit_broken.exr"]
    code, said = told(path, "relight", "--worlds", *maps, "--keep-going")
    assert code == 3 and said["outcome"] == "some failed"
    assert [p.rpartition("/")[2] for p in said["wrote"]] == ["shot_relit_a.exr", "shot_relit_c.exr"]
    assert said["failed"][0]["error"] == "SceneError" and "broken.exr" in said["failed"][0]["text"]
    code, said = told(path, "relight", "--worlds", maps[0])
    assert code == 0 and said["outcome"] == "done" and not said["failed"]
    code, said = told(path, "relight", "--view-layer", "None")
    assert code == 2 and said["outcome"] == "wrong options"


def test_warnings_are_told_and_are_errors_where_asked(shot, tmp_path):
    shot.objects["Floor"].location.z -= 0.1
    try:
        code, said = told(tmp_path / "a.json", "relight")
        assert code == 0 and "not the captured one" in said["warnings"][0]["text"]
        code, said = told(tmp_path / "a.json", "relight", "--strict")
        assert code == 1 and said["failed"][0]["error"] == "StrictError"
    finally:
        shot.objects["Floor"].location.z += 0.1


def test_a_report_is_written_over_no_other_file(shot, tmp_path):
    theirs = tmp_path / "scene.json"
    for text in ('{"mine": 1}', "[]", "no json"):
        theirs.write_text(text)
        for verb in ("relight", "status"):
            assert cli.main([verb, "--json", str(theirs)]) == 2
        assert theirs.read_text() == text
    assert cli.main(["relight", "--json", str(theirs / "in" / "a.json")]) == 2
    assert not list(relit_file(shot).parent.glob("*.exr"))


@pytest.mark.parametrize(
    "line",
    [
        "relight --turntable 0", "relight --turntable -1", "relight --frames 4-1",
        "relight --frames 1-4:0", "relight --frames 1-2000000", "relight --own-lamps nan",
        "relight --own-lamps inf", "relight --lamp-samples -1",
        "relight --lamp-samples 99999999999",
        "capture --patches 17", "capture --seed -1", "plan --job x --seeds 0",
        "plan --job x --tiles 0",
    ],
)  # fmt: skip
def test_options_that_cannot_be_are_refused(shot, line):
    assert cli.main(line.split()) == 2
    assert not list(relit_file(shot).parent.glob("*.exr"))


def test_frames_are_read_as_written():
    assert list(options.frames("1-10:4")) == [1, 5, 9]
    assert list(options.frames("-3--1")) == [-3, -2, -1]


def states(scene, *arguments) -> tuple[int, dict[str, str]]:
    code, said = told(paths.worlds_folder(scene).parent / "status.json", "status", *arguments)
    things = [t for frame in said["frames"] for t in frame["things"]]
    assert said["whole"] == (code == 0)
    return code, {thing["kind"]: thing["state"] for thing in things}


def test_the_status_says_what_is_there(shot, capsys):
    whole = {"capture": "whole", "field": "whole", "plate": "whole"}
    assert states(shot) == (3, whole | {"plate": "missing"})
    assert cli.main(["relight", "--layers", "FACES"]) == 0
    whole |= {f"script {ending}": "whole" for ending in (".nk", ".comp")}
    assert states(shot) == (0, whole | {"layers": "whole"})
    path = relit_file(shot)
    layers = plate.layers_file(path)
    data = layers.read_bytes()
    layers.write_bytes(data[:-20])
    assert states(shot) == (3, whole | {"layers": "damaged"})
    layers.unlink()
    assert states(shot) == (3, whole | {"layers": "missing"})
    shot.arto.layers = "OFF"
    shot.arto.own_lamps = 0.5
    assert states(shot)[1]["plate"] == "outdated"
    shot.arto.own_lamps = 1.0
    field = next(paths.field_folder(shot).glob("*.arto"))
    before = field.read_bytes()
    flipped = bytearray(before)
    flipped[len(before) // 2] ^= 1
    field.write_bytes(flipped)
    assert states(shot, "--frames", "1")[1]["field"] == "damaged"
    field.write_bytes(before)
    capsys.readouterr()
    cli.main(["status", "--frames", "--json"])
    last = capsys.readouterr().out.splitlines()[-1]
    assert [frame["frame"] for frame in json.loads(last)["frames"]] == [1]


def test_another_version_of_a_file_finds_the_capture(shot, monkeypatch, tmp_path, capsys):
    """Whose ID was never saved: it is said where the capture is, and it can be used."""
    folder = paths.place(shot).folder
    own = shot.arto.scene_id
    monkeypatch.setattr(home, "file", lambda: str(tmp_path / "shot_v2.blend"))
    shot.arto.scene_id = ""
    scene_id._given.clear()
    paths.forget()
    try:
        assert cli.main(["relight"]) == 1
        assert f"adopt --from '{folder}'" in capsys.readouterr().err
        assert cli.main(["adopt"]) == 1 and f"--from '{folder}'" in capsys.readouterr().err
        assert cli.main(["adopt", "--from", str(tmp_path)]) == 1
        # a folder above it does as well
        assert cli.main(["adopt", "--from", str(folder.parents[1])]) == 0
        assert paths.place(shot).folder != folder and "shot_v2" in str(paths.place(shot).folder)
        assert cli.main(["relight", "--output", str(tmp_path / "v2.exr")]) == 0
        assert (tmp_path / "v2.exr").is_file()
    finally:
        shot.arto.output = str(relit_file(shot).parent.parent / "plates" / "shot_relit.exr")
        shot.arto.scene_id = own
        scene_id._given.clear()
        paths.forget()


def test_a_saved_file_has_the_id(shot, monkeypatch, tmp_path):
    saved = []
    monkeypatch.setattr(home, "file", lambda: str(tmp_path / "shot.blend"))
    monkeypatch.setattr(cli, "capture", lambda *_: (step for step in ()))

    def save():
        saved.append((shot.arto.scene_id, shot.arto.samples))

    monkeypatch.setattr(cli, "save", save)
    own, samples, folder = shot.arto.scene_id, shot.arto.samples, shot.arto.folder
    shot.arto.scene_id = ""
    try:
        line = ["capture", "--save", "--samples", "7", "--folder", str(tmp_path / "kept")]
        assert cli.main(line) == 0
        assert saved == [(shot.arto.scene_id, samples)] and shot.arto.scene_id
    finally:
        shot.arto.scene_id, shot.arto.samples, shot.arto.folder = own, samples, folder
        scene_id._given.clear()
        paths.forget()
    assert bpy.data.filepath == ""
