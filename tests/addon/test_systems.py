"""Other systems, full systems: drives that are not there, Windows, libraries, too many files."""

from __future__ import annotations

import errno
import ntpath
import os
import sys
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from arto.arto_addon.blender import scripts
from arto.arto_addon.capture import room
from arto.arto_addon.farm import job as farm_job
from arto.arto_addon.farm.templates import job_name
from arto.arto_addon.job import snapshot
from arto.arto_addon.live import maps
from arto.arto_addon.plate.header import time_code
from arto.arto_addon.resident import resident
from arto.arto_addon.shot import home
from arto.arto_addon.world.check import check_images
from arto.core import arrays, exr
from arto.core.errors import FarmError, SceneError
from arto.core.exr import TimeCode


def test_a_path_on_another_drive_stays_as_it_is(monkeypatch, tmp_path):
    """As Windows finds no way from one drive to another."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    assert home.relative(tmp_path / "arto" / "b.exr") == "//arto/b.exr"

    def relpath(path: str) -> str:
        return ntpath.relpath(path, "C:\\shots")

    monkeypatch.setattr(bpy.path, "relpath", relpath)
    assert home.relative(Path("D:/plates/b.exr")) == str(Path("D:/plates/b.exr"))


def test_a_drive_that_is_not_there_is_said(monkeypatch, tmp_path):
    """A path on it has no end that exists: asking its parents has one all the same."""
    room.check_disk(tmp_path / "not" / "yet", 1, "this")

    def usage(path):
        raise FileNotFoundError(errno.ENOENT, "no such drive", str(path))

    monkeypatch.setattr(room.shutil, "disk_usage", usage)
    with pytest.raises(SceneError, match="is not there: connect it"):
        room.check_disk(Path("Z:/arto/a"), 1, "this")


class Junctions:
    """Windows' own module, which makes junctions to disks of the machine alone."""

    def __init__(self, fails: bool) -> None:
        self.fails, self.made = fails, []

    def CreateJunction(self, source: str, link: str) -> None:
        if self.fails:
            Path(link).mkdir()  # as Windows leaves it
            raise OSError("the target is on a network")
        self.made.append((source, link))


@pytest.mark.parametrize(("fails", "links"), [(False, True), (True, True), (True, False)])
def test_caches_on_a_network_path(monkeypatch, tmp_path, fails, links):
    junctions = Junctions(fails)
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setitem(sys.modules, "_winapi", junctions)
    link = tmp_path / "link"
    if not links:
        monkeypatch.setattr(Path, "symlink_to", lambda *_, **__: _refused())
        with pytest.raises(SceneError, match="copy the"):
            snapshot.link_folder(tmp_path, link)
        return
    snapshot.link_folder(tmp_path, link)
    assert link.is_symlink() == fails and len(junctions.made) == (not fails)


def _refused():
    raise OSError("a right is missing")


def test_no_console_window_flashes(monkeypatch):
    monkeypatch.setattr(sys, "platform", "win32")
    started = []
    monkeypatch.setattr(resident.subprocess, "Popen", lambda *_, **how: started.append(how))
    beside = resident.Resident()
    monkeypatch.setattr(
        resident.threading,
        "Thread",
        lambda **_: SimpleNamespace(start=lambda: None, join=lambda *_: None),
    )
    beside.start()
    assert started[0]["creationflags"] & 0x08000000
    assert scripts.quietly()["creationflags"] == started[0]["creationflags"]
    monkeypatch.undo()
    beside.process = None
    beside.close()


@pytest.mark.parametrize(
    ("blend", "name"),
    [
        ("shot.blend", "ARTO shot"),
        ("{{Param.Job}} a.blend", "ARTO __Param.Job__ a"),
        ("a\nb\tc.blend", "ARTO a_b_c"),
        ("blå fjörð.blend", "ARTO blå fjörð"),
        ("x" * 200 + ".blend", "ARTO " + "x" * 59),
    ],
)
def test_the_name_of_a_job_is_one_line_and_no_format(blend, name):
    assert job_name(blend) == name


@pytest.mark.parametrize(
    ("name", "value"),
    [("patches", "many"), ("patches", 1e30), ("patches", 10**30), ("faces", [[1]]), ("patterns", 3),
     ("far", {}), ("quality", "NONE"), ("patches", None)],
)  # fmt: skip
def test_a_setting_that_cannot_be_is_said(scene, name, value):
    """Of a job's file, which anybody may have written; the scene's own come back."""
    before = farm_job.settings_of(scene)
    with pytest.raises(FarmError, match=f"the job's setting '{name}' cannot be .*plan again"):
        farm_job._set(scene, {name: value})
    assert farm_job.settings_of(scene) == before


def test_a_scene_of_a_library_is_told_from_one_of_the_same_name(tmp_path):
    bpy.ops.wm.read_factory_settings()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "lib.blend"))
    bpy.ops.wm.read_factory_settings()
    with bpy.data.libraries.load(str(tmp_path / "lib.blend"), link=True) as (_, into):
        into.scenes = ["Scene"]
    own, linked = bpy.data.scenes["Scene"], into.scenes[0]
    assert linked.library and own.name == linked.name and own != linked
    assert home.library_of(own) == ""
    for scene in (own, linked):
        found = home.of_library(bpy.data.scenes, "Scene", home.library_of(scene))
        assert found == scene
        there = Path(home.library_of(scene)).name
        assert farm_job._scene("Scene", there) == scene
    assert home.of_library(bpy.data.scenes, "Scene", "/elsewhere.blend") is None
    bpy.ops.wm.read_factory_settings()


@pytest.mark.parametrize("bad", ["cut", "bit", "size", "type", "huge", "pipe", "link", "none"])
def test_painted_pixels_are_those_that_were_written(tmp_path, bad):
    image = bpy.data.images.new("Wood", 8, 4)
    image.pixels.foreach_set(np.linspace(0, 1, 128, dtype=np.float32))
    path = tmp_path / snapshot._painted(image, tmp_path).pixels
    wanted, data = arrays.read(path, 512), path.read_bytes()
    snapshot.put_pixels(image, path)
    found = np.empty(128, np.float32)
    image.pixels.foreach_get(found)
    np.testing.assert_allclose(found, wanted, atol=1 / 255)
    path.unlink()
    if bad == "cut":
        path.write_bytes(data[:-5])
    elif bad == "bit":
        path.write_bytes(data[:200] + bytes([data[200] ^ 1]) + data[201:])
    elif bad in ("size", "type"):
        other = {"size": np.zeros(64, np.float32), "type": np.zeros(128, np.uint8)}
        arrays.write(path, other[bad])
    elif bad == "huge":
        with path.open("wb") as file:
            file.truncate(1 << 40)
    elif bad == "pipe":
        os.mkfifo(path)
    elif bad == "link":
        path.symlink_to("/dev/zero")
    with pytest.raises(SceneError, match="start the work again"):
        snapshot.put_pixels(image, path)
    bpy.data.images.remove(image)


NO_MAPS = [np.zeros((4, 8, 3)), np.zeros((4, 7, 3), "f4"), np.zeros(9, "f4")]


@pytest.mark.parametrize("image", [*NO_MAPS, np.full((4, 8, 3), np.nan, "f4")])
def test_a_map_for_live_is_a_map(tmp_path, image):
    arrays.write(tmp_path / "map.npy", np.zeros((4, 8, 3), np.float32))
    assert maps._map(tmp_path / "map.npy").shape == (4, 8, 3)
    arrays.write(tmp_path / "map.npy", image)
    with pytest.raises(ValueError, match=r"map|number"):
        maps._map(tmp_path / "map.npy")


def test_a_world_of_layers_is_no_damaged_world(tmp_path):
    """Blender shows no picture of such a file, as of one that is cut off."""
    plane = np.ones((4, 8, 3), np.float32)
    exr.write(tmp_path / "layers.exr", {"ViewLayer.Combined": plane, "ViewLayer.Normal": plane})
    exr.write(tmp_path / "cut.exr", {"": plane})
    (tmp_path / "cut.exr").write_bytes((tmp_path / "cut.exr").read_bytes()[:-40])
    world = bpy.data.worlds.new("Sky")
    world.use_nodes = True
    texture = world.node_tree.nodes.new("ShaderNodeTexEnvironment")
    background = world.node_tree.nodes["Background"]
    world.node_tree.links.new(texture.outputs[0], background.inputs["Color"])
    for name, says in (("layers", "an EXR of layers"), ("cut", "damaged or cut off")):
        texture.image = bpy.data.images.load(str(tmp_path / f"{name}.exr"))
        with pytest.raises(SceneError, match=says):
            check_images(world, 1)
    bpy.data.worlds.remove(world)


@pytest.mark.parametrize(
    ("text", "moment"),
    [
        ("01:02:03:04", TimeCode(1, 2, 3, 4)),
        ("23:59:59:29", TimeCode(23, 59, 59, 29)),
        ("23:59:59:30", None),  # of 60 frames a second
        ("24:00:00:00", None),
        ("-00:00:01:00", None),
        ("00:00:00:75", None),
        ("100:00:00:00", None),
        ("", None),
    ],
)
def test_a_moment_that_an_exr_cannot_have_is_left_out(text, moment):
    assert time_code(text) == moment
