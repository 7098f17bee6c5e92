"""What is of others stays: folders that ARTO has not made, and scripts that the artist refuses."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from arto.arto_addon.blender import scripts
from arto.arto_addon.capture.resume import empty, empty_take
from arto.arto_addon.farm import job as farm_job
from arto.arto_addon.farm.plan import _make_way
from arto.arto_addon.job import session
from arto.arto_addon.relight import ahead
from arto.arto_addon.relight.relight import check_finite
from arto.arto_addon.world import kept as maps
from arto.core import exr, marked
from arto.core.capture.head import CaptureHead, write
from arto.core.capture.tile_entry import TileEntry
from arto.core.errors import FarmError, FieldError, FilesError, SceneError
from arto.core.hemicube import Hemicube
from arto.core.patterns import pattern_set
from arto.core.region import Region


def others(folder: Path) -> Path:
    """A folder of somebody else's."""
    folder.mkdir(parents=True)
    (folder / "comp.nk").write_text("mine")
    return folder


def kept(folder: Path) -> bool:
    return (folder / "comp.nk").read_text() == "mine"


JOB = """
import os, signal, sys, time, arto
signal.signal(signal.SIGINT, signal.SIG_IGN)  # as in the program, where a render ends by it
from pathlib import Path
arto.register()
from arto.arto_addon.job import run
class Told(run._Told):  # the work begins when the job has looked at its input
    def __init__(self, folder):
        super().__init__(folder)
        while not self.to_end:
            time.sleep(0.01)

run._Told = Told
code = run.main(Path(sys.argv[1]))
sys.stdout.flush()
os._exit(code)  # Blender 4.5 as a module may crash where Python ends
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
    tile = TileEntry(Region(0, 0, 3, 2), done=done)
    write(folder, CaptureHead(Hemicube(patches=1), pattern_set("linear"), 2, 3, (tile,), "x"))
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


@pytest.mark.parametrize(
    ("begun", "frames", "good"),
    [
        ({1: True}, [1, 2, 3], True),  # an animated world over a still
        ({5: True}, [1, 2, 3], True),
        ({}, [1, 2], True),  # which says to capture
        ({1: True, 2: True, 3: True}, [1, 2, 3], True),
        ({1: True, 2: True, 3: False}, [1, 2, 3, 4], False),  # killed in frame 3
        ({1: True, 2: False}, [1, 2, 3], False),  # killed in frame 2
        ({1: True, 2: True}, [1, 2, 3], False),  # killed between two
        ({1: True, 2: True}, [2], True),
    ],
)
def test_a_sequence_with_a_gap_is_refused(monkeypatch, begun, frames, good):
    monkeypatch.setattr(ahead.paths, "frames", lambda *_: begun)
    wrong = ahead.missing_frames(bpy.context.scene, "ViewLayer", frames)
    assert bool(wrong) != good and wrong.keys() <= set(frames) - {f for f in begun if begun[f]}
    assert all("not to the end" in str(error) for error in wrong.values())


def test_two_worlds_of_one_name_are_refused_before_work(tmp_path):
    scene = bpy.context.scene
    scene.arto.output = str(tmp_path / "shot.exr")
    for name in ("a/ok.exr", "b/OK.exr", "b/other.exr"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        exr.write(tmp_path / name, {"": np.ones((2, 4, 3), np.float32)})
    a, b, other = (tmp_path / n for n in ("a/ok.exr", "b/OK.exr", "b/other.exr"))

    def wrong(*worlds):
        pictures = ahead.wanted(scene, worlds, 1, ())
        found = ahead.same_names(pictures)
        return [str(found.get(p) or ahead._map(p.file) or "") for p in pictures]

    assert wrong(a, other) == ["", ""]
    assert all("one picture" in text for text in wrong(a, b) + wrong(a, a))
    (tmp_path / "cut.exr").write_bytes(a.read_bytes()[:-20])
    (tmp_path / "text.hdr").write_text("no picture")
    some = {name: np.ones((2, 4, 3), np.float32) for name in ("diffuse", "glossy")}
    exr.write(tmp_path / "layers.exr", some)
    for name, match in (
        ("none.exr", "no environment map"),
        ("cut.exr", "truncated or damaged"),
        ("text.hdr", "damaged or cut off"),
        ("layers.exr", "an EXR of layers"),
    ):
        good, bad = wrong(other, tmp_path / name)
        assert not good and match in bad
    # a world named as a file beside a plate is
    assert wrong(tmp_path / "b" / "other.exr", a) == ["", ""]
    names = {p.path.name for p in ahead.wanted(scene, [a, tmp_path / "ok_layers.exr"], 1, ())}
    assert "shot_ok_layers.exr" not in names and len(names) == 2
    scene.arto.output = ""


def test_an_hdri_of_the_same_size_and_time_is_another(tmp_path):
    """As `rsync -t` and `cp -p` put it there."""
    path = tmp_path / "sky.exr"
    path.write_bytes(b"one sky")
    os.utime(path, ns=(1, 1))
    world = bpy.data.worlds.new("Sky")
    world.use_nodes = True
    image = bpy.data.images.new("sky", 4, 2, float_buffer=True)
    image.source, image.filepath = "FILE", str(path)
    world.node_tree.nodes.new("ShaderNodeTexEnvironment").image = image
    before = maps._key(bpy.context.scene, world, 64)
    assert maps._key(bpy.context.scene, world, 64) == before
    (tmp_path / "new").write_bytes(b"two sky")
    os.utime(tmp_path / "new", ns=(1, 1))
    (tmp_path / "new").replace(path)
    assert maps._key(bpy.context.scene, world, 64) != before
    bpy.data.worlds.remove(world)
    bpy.data.images.remove(image)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("channel", [0, 3])
def test_a_picture_that_is_no_number_names_where_it_comes_from(value, channel):
    picture = np.ones((4, 5, 4), np.float32)
    check_finite(picture, "the field")
    check_finite(0.0, "own lamps")
    picture[2, 3, channel] = value
    with pytest.raises(FieldError, match=r"the field is infinite.* 1 pixels.*row 2, column 3"):
        check_finite(picture, "the field")
