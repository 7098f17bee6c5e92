"""What is of others stays: folders that ARTO has not made, and scripts that the artist refuses."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import bpy
import pytest
from arto.arto_addon.blender import scripts
from arto.arto_addon.capture.resume import empty, empty_take
from arto.arto_addon.farm import job as farm_job
from arto.arto_addon.farm.plan import _make_way
from arto.arto_addon.job import session
from arto.core import marked
from arto.core.capture.capture_set import describe, write_header
from arto.core.errors import FarmError, FilesError, SceneError
from arto.core.hemicube import Hemicube
from arto.core.patterns import pattern_set


def others(folder: Path) -> Path:
    """A folder of somebody else's."""
    folder.mkdir(parents=True)
    (folder / "comp.nk").write_text("mine")
    return folder


def kept(folder: Path) -> bool:
    return (folder / "comp.nk").read_text() == "mine"


JOB = """
import signal, sys, time, arto
signal.signal(signal.SIGINT, signal.SIG_IGN)  # as in the program, where a render ends by it
from pathlib import Path
arto.register()
from arto.arto_addon.job import run
read = run.Task.read
run.Task.read = lambda path: (time.sleep(0.5), read(path))[1]  # until it has looked at its input
sys.exit(run.main(Path(sys.argv[1])))
"""


@pytest.mark.parametrize("text", ["", "{}", '{"verb": "fit"}', None])
def test_a_job_that_nobody_waits_for_leaves_the_folder_of_others(tmp_path, text):
    """As cron starts it: with nothing on its standard input."""
    folder = others(tmp_path / "job-mine")
    if text is None:
        said = {"verb": "fit", "scene": "None", "view_layer": "", "blend": "", "painted": []}
        text = json.dumps(said)
    (folder / "task.json").write_text(text)
    done = subprocess.run(
        [sys.executable, "-c", JOB, folder / "task.json"],
        stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=100,
    )  # fmt: skip
    assert done.returncode == 1 and "no folder of a job" in done.stdout, done.stderr
    assert kept(folder) and len(list(folder.iterdir())) == 2


def test_a_job_that_nobody_waits_for_removes_its_own_folder(tmp_path):
    folder = marked.make(tmp_path / "job-ours", "job")
    (folder / "task.json").write_text("{}")
    subprocess.run(
        [sys.executable, "-c", JOB, folder / "task.json"],
        stdin=subprocess.DEVNULL, capture_output=True, timeout=100,
    )  # fmt: skip
    assert not folder.exists()


def test_leftovers_of_jobs_are_told_by_their_mark(tmp_path):
    theirs = others(tmp_path / "job-theirs")
    ours = marked.make(tmp_path / "job-ours", "job")
    session._remove_leftovers(tmp_path)
    assert kept(theirs) and not ours.exists()


def planned(folder: Path, done: bool = False) -> Path:
    """A capture set as a job plans it."""
    head = describe(Hemicube(patches=1), pattern_set("linear"), (2, 3), key="x")
    head["tiles"] = [{"region": [0, 0, 3, 2], "files": [], "done": done}]
    write_header(folder, head)
    return folder


@pytest.mark.parametrize("name", ["frame_0001", "frame_0001_ground"])
@pytest.mark.parametrize("what", ["folder", "file", "done", "link"])
def test_planning_removes_no_frames_of_others(tmp_path, name, what):
    old = planned(tmp_path / "frame_0007")
    there = tmp_path / name
    if what == "folder":
        others(there)
    elif what == "file":
        there.write_text("mine")
    elif what == "done":
        planned(there, done=True)
    else:
        there.symlink_to(planned(tmp_path / "elsewhere"))
    with pytest.raises(FarmError, match=f"{name} was not planned"):
        _make_way(tmp_path, [1, 2])
    assert os.path.lexists(there) and old.is_dir()
    _make_way(tmp_path, [2, 3])  # which that is not in the way of
    assert os.path.lexists(there) and not old.exists()


@pytest.mark.parametrize("name", ["job.json", "openjd.json", "commands.txt", "arto_capture.js"])
def test_planning_writes_over_no_files_of_others(tmp_path, name):
    (tmp_path / name).write_text('{"mine": 1}')
    old = planned(tmp_path / "frame_0001")
    with pytest.raises(FarmError, match=name):
        _make_way(tmp_path, [1])
    assert (tmp_path / name).read_text() == '{"mine": 1}' and old.is_dir()


@pytest.mark.parametrize(
    "name", ["/etc", "../../x", "..", "", "tile_0001.arto", "tile_0000/..", 3, None, "a\0b", "NUL"]
)
def test_a_part_names_nothing_but_its_own_tile(tmp_path, name):
    """What `fitted` names is moved, in place of what has that name in the frame's field."""
    part = farm_job.Part(0, 1, 0, 0)
    job = farm_job.Job.__new__(farm_job.Job)
    job.folder = tmp_path
    folder = marked.make(job.part_folder(part), "part")
    for key in ("file", "folder"):
        said = {
            "key": "x",
            "part": part.to_json(),
            "files": [],
            "samples": 1,
            "fitted": {key: name},
        }
        (folder / "part.json").write_text(json.dumps(said))
        with pytest.raises(FarmError, match="fitted"):
            job.there(part, "x")
    said["fitted"] = {"file": "tile_0000.arto"}
    (folder / "part.json").write_text(json.dumps(said))
    assert job.there(part, "x")


def test_what_is_in_the_way_of_a_capture_stays(tmp_path):
    folder = others(tmp_path / "unfinished-12345678")
    with pytest.raises(FilesError, match="not made by ARTO"):
        empty(folder)
    take = others(tmp_path / "ground")
    planned(take / "capture")
    others(take / "field")
    empty_take(take)
    assert kept(folder) and kept(take) and kept(take / "field")
    assert not (take / "capture").exists()


def session_of(monkeypatch, preference, arguments=(), failed=False, blend="", excluded=()):
    """The option that a job gets in a session of Blender's."""
    paths = [SimpleNamespace(path=p, use_glob=g) for p, g in excluded]
    preferences = SimpleNamespace(
        filepaths=SimpleNamespace(use_scripts_auto_execute=preference), autoexec_paths=paths
    )
    monkeypatch.setattr(
        scripts,
        "bpy",
        SimpleNamespace(
            app=SimpleNamespace(autoexec_fail=failed),
            context=SimpleNamespace(preferences=preferences),
            data=SimpleNamespace(filepath=blend),
        ),
    )
    monkeypatch.setattr(sys, "argv", ["blender", *arguments])
    return scripts.option()


def test_a_job_runs_scripts_only_where_the_artist_allows_them(monkeypatch, tmp_path):
    def of(*args, **more):
        return session_of(monkeypatch, *args, **more)

    assert of(False) == scripts.REFUSED
    assert of(True) == scripts.ALLOWED
    assert of(True, failed=True) == scripts.REFUSED
    assert of(False, ["-y"]) == scripts.ALLOWED
    assert of(False, ["--enable-autoexec", "a.blend"]) == scripts.ALLOWED
    assert of(True, ["-Y"]) == scripts.REFUSED
    assert of(False, ["-y", "-Y"]) == scripts.REFUSED
    assert of(False, ["--", "-y"]) == scripts.REFUSED
    blend = str(tmp_path / "downloads" / "in" / "a.blend")
    for path, glob in ((tmp_path / "downloads", False), (tmp_path / "down*", True)):
        assert of(True, blend=blend, excluded=[(str(path), glob)]) == scripts.REFUSED
    assert of(True, blend=blend, excluded=[(str(tmp_path / "down"), False)]) == scripts.ALLOWED


def test_the_command_of_a_job_says_so(monkeypatch):
    for said in (scripts.ALLOWED, scripts.REFUSED):
        monkeypatch.setattr(scripts, "option", lambda said=said: said)
        assert said in session._command(Path("a.blend"), Path("task.json"))


def test_a_driver_that_was_refused_is_said(tmp_path):
    """Refused, it gives 0: another picture, and no word."""
    bpy.ops.wm.read_factory_settings()
    driver = bpy.context.scene.camera.driver_add("location", 0).driver
    driver.expression = "__import__('math').sqrt(4)"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    for allowed in (True, False):
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"), use_scripts=allowed)
        bpy.context.view_layer.update()
        if allowed:
            scripts.check_drivers()
        else:
            with pytest.raises(SceneError, match="Auto Run Python Scripts"):
                scripts.check_drivers()
    bpy.ops.wm.read_factory_settings()
