"""A capture that ends before its time: the scene is as before, and no half file is left."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess

import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.capture import capture, plan, planned
from arto.arto_addon.capture.plan import strips_of
from arto.arto_addon.fit import fit
from arto.arto_addon.shot import paths, status
from arto.core.errors import ArtoError, CancelledError, CaptureSetError
from arto.core.marked import MARK
from scene_tools import (
    captured,
    differences,
    small_scene,
    snapshot,
)
from shot_tools import unfinished


def _interrupt_after(steps, renders):
    """Drive the work and stop it as ESC does, in the middle of the given render of basis images."""
    done = 0
    for step in steps:
        if isinstance(step, work.Render):
            long = "basis images" in step.text
            if long and done == renders:
                step.state = "cancelled"
                continue
            work.blocking_render(step)
            done += long


def test_cancelled_scene_is_as_before_and_goes_on(tmp_path, monkeypatch):
    scene = small_scene(tmp_path)
    monkeypatch.setattr(
        planned, "tiles_of", lambda r, n, m: [type(r)(0, y, r.width, 6) for y in (0, 6, 12)]
    )
    before = snapshot()
    with pytest.raises(CancelledError, match="run it again"):
        _interrupt_after(capture.capture(scene, "ViewLayer"), 2)
    assert not differences(before, snapshot())
    (folder,) = unfinished(scene)
    head = json.loads((folder / "capture.json").read_text())
    assert [t["done"] for t in head["tiles"]] == [True, True, False]
    with pytest.raises(CaptureSetError, match="2 of 3 tiles"):
        work.run(fit.fit(scene))
    kept = (folder / "tile_0001.exr").stat().st_mtime_ns
    there = captured(scene)
    assert (there.folder / "tile_0001.exr").stat().st_mtime_ns == kept
    assert not folder.exists()
    assert len([there.read(i) for i in range(3)]) == 3
    assert not differences(before, snapshot())


def test_another_capture_does_not_go_on_with_it(tmp_path, monkeypatch):
    scene = small_scene(tmp_path)
    monkeypatch.setattr(
        planned, "tiles_of", lambda r, n, m: [type(r)(0, y, r.width, 9) for y in (0, 9)]
    )
    with pytest.raises(CancelledError):
        _interrupt_after(capture.capture(scene, "ViewLayer"), 1)
    (kept,) = unfinished(scene)
    old = (kept / "tile_0000.exr").stat().st_mtime_ns
    scene.arto.samples += 1
    there = captured(scene)
    assert (there.folder / "tile_0000.exr").stat().st_mtime_ns != old
    # nor is it thrown away: with its settings again, it goes on
    assert status.unfinished(paths.place(scene, "ViewLayer").source) == ["1 of 2 tiles"]
    scene.arto.samples -= 1
    there = captured(scene)
    assert (there.folder / "tile_0000.exr").stat().st_mtime_ns == old
    assert there.head.samples == 64 and not unfinished(scene)
    # and what a crash left behind is in nobody's way
    left = there.folder.with_name("capture.old")
    shutil.copytree(there.folder, left)
    (left / "tile_0000.exr").write_text("half of it")
    scene.arto.samples += 1
    assert captured(scene).head.samples == scene.arto.samples
    assert not left.exists()


def test_cancelled_capture_keeps_the_finished_one(tmp_path):
    """Capture again and stop: the set that was there is as it was, and can be fitted."""
    scene = small_scene(tmp_path)
    there = captured(scene)
    before = {p.name: p.read_bytes() for p in there.folder.iterdir()}
    scene.arto.samples += 1
    with pytest.raises(CancelledError):
        _interrupt_after(capture.capture(scene, "ViewLayer"), 0)
    assert {p.name: p.read_bytes() for p in there.folder.iterdir()} == before
    work.run(fit.fit(scene))
    # the new one takes its place, and nothing is left beside it
    assert captured(scene).head.samples == scene.arto.samples
    assert sorted(p.name for p in there.folder.parent.iterdir()) == [
        "capture",
        "field",
        "lock",
        "shot.json",
    ]


def test_finished_capture_leaves_the_scene_as_before(tmp_path):
    scene = small_scene(tmp_path, lamp=True)
    scene.view_layers.new("Second")
    scene.view_layers[0].use_pass_mist = True
    scene.view_layers[0].lightgroups.add(name="key")
    scene.objects["Sun"].lightgroup = "key"
    before = snapshot()
    captured(scene)
    assert not differences(before, snapshot())


def test_failing_render_leaves_the_scene_as_before(tmp_path, monkeypatch):
    scene = small_scene(tmp_path)
    before = snapshot()

    def crash(request):
        raise RuntimeError("out of memory")

    monkeypatch.setattr(work, "blocking_render", crash)
    with pytest.raises(RuntimeError):
        work.run(capture.capture(scene, "ViewLayer"))
    assert not differences(before, snapshot())


def test_interrupt_from_the_keyboard(tmp_path, monkeypatch):
    scene = small_scene(tmp_path)
    before = snapshot()

    def interrupt(*args, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr(work, "blocking_render", interrupt)
    with pytest.raises(CancelledError):
        work.run(capture.capture(scene, "ViewLayer"))
    assert not differences(before, snapshot())


def test_unwritable_folder(scene, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    before = snapshot()
    scene.arto.folder = str(blocked)
    with pytest.raises(ArtoError, match="choose"):
        captured(scene)
    scene.arto.folder = str(tmp_path / "arto")
    assert not differences(before, snapshot())


def test_no_half_files_are_left(tmp_path):
    there = captured(small_scene(tmp_path))
    assert {p.name for p in there.folder.iterdir()} == {MARK, "capture.json", "tile_0000.exr"}


def test_full_disk(tmp_path):
    """A disk too small for the render: a message, nothing half-written, the scene as before."""
    small = tmp_path / "small"
    small.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=128k", "tmpfs", str(small)], capture_output=True
    )
    if mounted.returncode:
        pytest.skip("a small disk can only be mounted by root")
    try:
        scene = small_scene(tmp_path)
        scene.arto.folder = str(small)
        before = snapshot()
        with pytest.raises(ArtoError, match=r"make room|again"):
            captured(scene)
        assert not differences(before, snapshot())
        assert not list(small.rglob("*.exr*"))
        # with room the same capture works
        subprocess.run(["mount", "-o", "remount,size=64m", str(small)], check=True)
        assert captured(scene).read(0).basis.max() > 0
    finally:
        subprocess.run(["umount", str(small)], check=True)


def test_tiles_are_cut_finer_where_they_take_longer_than_planned(tmp_path, monkeypatch):
    """So about a minute is lost at most where the machine becomes busy; no bit changes."""
    scene = small_scene(tmp_path)
    scene.render.resolution_y, scene.arto.samples, scene.arto.far = 144, 2, False
    scene.arto.patterns, scene.arto.grain = "white", False
    monkeypatch.setattr(planned, "tiles_of", lambda r, n, m: strips_of(r, 2))
    two = captured(scene)
    basis = np.concatenate([two.read(t).basis for t in range(2)], axis=2)
    monkeypatch.setattr(plan, "KEPT", 1e-6)
    finer = captured(scene)
    assert [region.height for region in finer.regions] == [72, 24, 24, 24]
    cut = np.concatenate([finer.read(t).basis for t in range(4)], axis=2)
    np.testing.assert_array_equal(cut, basis)
    # and not where all is as it was planned
    monkeypatch.setattr(plan, "KEPT", 1e6)
    assert plan.finer(list(two.regions), 1.0, 0.0, 1) == list(two.regions)


def test_ctrl_c_in_the_module_ends_between_two_steps(capsys) -> None:
    """Python's own answer, an error in the midst of a render, would end the process."""
    # a shell that runs this beside other work has Ctrl-C ignored
    outside = signal.signal(signal.SIGINT, signal.default_int_handler)
    left = []

    def steps() -> work.Steps[None]:
        try:
            yield work.Progress(0.0, "one")
            signal.raise_signal(signal.SIGINT)
            left.append("goes on after Ctrl-C")
            yield work.Progress(0.5, "two")
            left.append("is never reached")
        finally:
            left.append("put back")

    try:
        with pytest.raises(CancelledError):
            work.run(steps())
        assert left == ["goes on after Ctrl-C", "put back"]
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, outside)
    assert "stopping" in capsys.readouterr().err
