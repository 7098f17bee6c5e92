"""The snapshot has all that is in memory, and its paths lead to the same files."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import pytest
from arto.arto_addon.blender import devices
from arto.arto_addon.blender.devices import Devices
from arto.arto_addon.job import run, snapshot
from arto.arto_addon.job.run import Pace
from arto.arto_addon.job.task import Painted, State, Task
from arto.arto_addon.shot import home
from arto.arto_addon.shot.fingerprint import changes, fingerprint
from arto.arto_addon.work import driven, retold
from arto.core.errors import ArtoError, CancelledError, SceneError
from arto.core.signed import parsed
from arto.core.units import clock
from scene_tools import add_mesh, small_scene


@pytest.fixture
def back():
    """Forget afterwards that this process worked on a copy."""
    yield
    home._home.clear()


def textured(folder: Path, name: str, image: bpy.types.Image) -> None:
    tree = bpy.data.materials[name].node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    tree.links.new(texture.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])


def scene_with_files(folder: Path) -> bpy.types.Scene:
    """An image and an IES lamp by relative paths, a linked library, painted and packed pixels."""
    shots = folder / "shots"
    (folder / "textures").mkdir(parents=True)
    shots.mkdir()
    small_scene(folder)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "library.blend"))
    scene = small_scene(folder)
    scene.arto.folder = "//arto/"
    bpy.ops.wm.save_as_mainfile(filepath=str(shots / "shot.blend"))
    for name in ("plain", "packed", "painted"):
        image = bpy.data.images.new(name, 2, 2)
        image.pixels.foreach_set(np.linspace(0, 1, 16, dtype=np.float32))
        image.filepath_raw, image.file_format = str(folder / "textures" / f"{name}.png"), "PNG"
        image.save()
        image.filepath = f"//../textures/{name}.png"
    bpy.data.images["packed"].pack()
    textured(folder, "Matt", bpy.data.images["plain"])
    textured(folder, "Glossy", bpy.data.images["painted"])
    textured(folder, "Floor", bpy.data.images["packed"])
    with bpy.data.libraries.load("//../library.blend", link=True, relative=True) as (_, wanted):
        wanted.meshes = ["Matt"]
    linked = bpy.data.objects.new("Linked", wanted.meshes[0])
    scene.collection.objects.link(linked)
    (folder / "lamp.ies").write_text("IESNA:LM-63-1995\nTILT=NONE\n")
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    lamp.data.use_nodes = True
    ies = lamp.data.node_tree.nodes.new("ShaderNodeTexIES")
    ies.mode, ies.filepath = "EXTERNAL", "//../lamp.ies"
    scene.collection.objects.link(lamp)
    bpy.ops.wm.save_mainfile()
    # what follows is in memory only
    add_mesh(scene, "Unsaved", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    bpy.data.images["painted"].pixels.foreach_set(np.full(16, 0.5, np.float32))
    bpy.data.images["painted"].update()
    bpy.context.view_layer.update()
    return scene


def test_snapshot_is_what_is_in_memory(tmp_path, back):
    scene = scene_with_files(tmp_path)
    saved = (tmp_path / "shots" / "shot.blend").read_bytes()
    before = fingerprint(scene, "ViewLayer", full=True)
    folder = tmp_path / "elsewhere" / "deep" / "job"
    folder.mkdir(parents=True)
    blend, task = snapshot.take(folder, "capture", scene, "ViewLayer")
    # the artist's file is what it was
    assert (tmp_path / "shots" / "shot.blend").read_bytes() == saved
    assert bpy.data.filepath == str(tmp_path / "shots" / "shot.blend")
    assert bpy.data.images["painted"].is_dirty and not bpy.data.use_autopack
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    run._steps(Task.read(task), folder).close()
    scene = bpy.context.scene
    bpy.context.view_layer.update()
    assert changes(before, fingerprint(scene, "ViewLayer", full=True)) == []
    np.testing.assert_allclose(bpy.data.images["painted"].pixels[:], 0.5, atol=0.01)
    files = [(i.filepath, i.library) for i in bpy.data.images if i.source == "FILE"]
    files += [(x.filepath, None) for x in bpy.data.libraries]
    files += [(n.filepath, None) for n in bpy.data.lights["Lamp"].node_tree.nodes
              if n.bl_idname == "ShaderNodeTexIES"]  # fmt: skip
    assert len(files) == 5
    for path, library in files:
        assert Path(bpy.path.abspath(path, library=library)).is_file(), path
    # and what is by a path of the artist's goes where it would
    assert home.absolute(scene.arto.folder) == tmp_path / "shots" / "arto"


def test_caches_beside_the_file_are_there(tmp_path, back):
    scene = scene_with_files(tmp_path)
    caches = tmp_path / "shots" / "blendcache_shot"
    caches.mkdir()
    (caches / "cloth_000001.bphys").write_text("x")
    folder = tmp_path / "job"
    folder.mkdir()
    snapshot.take(folder, "capture", scene, "ViewLayer")
    assert (folder / "blendcache_shot" / "cloth_000001.bphys").read_text() == "x"


def test_a_task_and_a_state_come_back(tmp_path):
    devices = Devices("NONE", {"CPU": True})
    painted = (Painted("Wood", "//wood.blend", "painted_1.npy"),)
    task = Task("fit", "Scene", "ViewLayer", "/a/b.blend", devices, painted)
    assert Task.read(task.write(tmp_path)) == task
    bare = Task("shoot", "Scene", "ViewLayer", "")
    assert Task.read(bare.write(tmp_path)) == bare
    state = State(0.5, "text", 3.0, 4.0)
    state.write(tmp_path)
    assert State.read(tmp_path) == state
    (tmp_path / "progress.json").unlink()
    assert State.read(tmp_path) == State()


@pytest.mark.parametrize(
    ("where", "name", "value"),
    [
        ((), "verb", "burn"),
        ((), "verb", None),
        ((), "scene", 3),
        ((), "blend", ["/a/b.blend"]),
        ((), "devices", "CPU"),
        ((), "painted", {}),
        ((), "painted", ["Wood"]),
        ((), "extra", 1),
        (("devices",), "kind", None),
        (("devices",), "use", {"CPU": 1}),
        (("devices",), "use", ["CPU"]),
        (("devices",), "more", 1),
        (("painted", 0), "name", None),
        (("painted", 0), "pixels", "../../elsewhere.npy"),
        (("painted", 0), "more", 1),
    ],
)
def test_what_a_task_cannot_be_is_said(tmp_path, where, name, value):
    painted = (Painted("Wood", "", "painted_1.npy"),)
    task = Task("fit", "Scene", "Layer", "", Devices("NONE", {"CPU": True}), painted)
    path = task.write(tmp_path)
    data = parsed(path.read_text())
    part = data
    for step in where:
        part = part[step]
    part[name] = value
    path.write_text(json.dumps(data))
    with pytest.raises(ArtoError, match=f"'{name}'.*no task .* start the work again"):
        Task.read(path)


@pytest.mark.parametrize("text", ["{", "[]", "{}", "\xff"])
def test_a_file_that_is_no_task_is_said(tmp_path, text):
    (tmp_path / "task.json").write_text(text, encoding="latin-1")
    with pytest.raises(ArtoError, match=r"task\.json .*no task"):
        Task.read(tmp_path / "task.json")


@pytest.mark.parametrize(
    ("name", "value"),
    [("share", 1.1), ("share", "0.5"), ("spent", -1.0), ("left", -1), ("end", "over"), ("text", 3),
     ("result", None), ("extra", 0)],
)  # fmt: skip
def test_what_a_state_cannot_be_is_said(tmp_path, name, value):
    State(0.5, "text", 3.0, 4.0, "done", "/a/plate.exr").write(tmp_path)
    path = tmp_path / "progress.json"
    path.write_text(json.dumps(parsed(path.read_text()) | {name: value}))
    with pytest.raises(ArtoError, match=f"'{name}'.*start it again"):
        State.read(tmp_path)


def test_devices_of_a_kind_that_is_not_here_are_said():
    there = devices.chosen()
    devices.use(there)
    assert devices.chosen() == there
    with pytest.raises(SceneError, match="NOTHING"):
        devices.use(Devices("NOTHING", {}))
    assert devices.chosen() == there


def test_work_is_told_and_driven_to_what_it_makes():
    closed = []

    def work():
        try:
            yield from range(5)
        finally:
            closed.append(True)
        return "made"

    seen = []
    assert driven(retold(work(), lambda n: None if n % 2 else n * 10), seen.append) == "made"
    assert seen == [0, 20, 40] and closed == [True]
    some = retold(work(), lambda n: n)
    assert next(some) == 0
    some.close()
    assert closed == [True, True]

    def stop(_):
        raise CancelledError("enough")

    with pytest.raises(CancelledError):
        driven(work(), stop)
    assert closed == [True, True, True]


def test_times_in_few_words():
    assert [clock(s) for s in (0.4, 59.6, 200, 7500)] == [
        "0 s",
        "1 min 0 s",
        "3 min 20 s",
        "2 h 5 min",
    ]


def told(busy: Callable[[float], float]) -> list[tuple[float, float]]:
    """What is told to be left of a work, and what is: every second. busy: how many times longer a
    second of it takes, by how many seconds have passed."""
    pace, now, share, said = Pace(), 0.0, 0.0, []
    pace.begin(now, share)
    while share < 1:
        now += 0.25
        share += 0.25 / 100 / busy(now)
        if (left := pace.left(now, share)) is not None and now > 20:
            said.append((now, left))
    return [(left, now - at) for at, left in said if now - at > 10]


def test_what_is_left_is_told_to_a_third_when_the_machine_becomes_busy_or_idle() -> None:
    for busy in (lambda _: 1.0, lambda at: 1 + at / 200, lambda at: 1 + 0.5 * (at % 10 < 5)):
        assert all(0.7 < left / then < 1.3 for left, then in told(busy))
    # another program comes, and takes half of the machine: it is known as soon as it has run as
    # long as all before
    found = told(lambda at: 2.0 if at > 30 else 1.0)
    late = [(left, then) for left, then in found if then < 110]
    assert late and all(0.7 < left / then < 1.3 for left, then in late)
