"""The strip of HDRIs: what was used last, and what asset libraries have."""

from __future__ import annotations

import json

import bpy
import numpy as np
import pytest
from arto.arto_addon.ui import strip
from arto.arto_addon.world import shelf
from arto.arto_addon.world.blend_worlds import worlds_in, zstandard
from arto.arto_addon.world.controls import hdri
from arto.core import exr
from scene_tools import small_scene


@pytest.fixture
def library(tmp_path, monkeypatch):
    """An asset library with what is a light, and much that is none."""
    folder = tmp_path / "library"
    bpy.ops.wm.read_factory_settings(use_empty=True)
    for name, size in (("sky", (4, 8, 3)), ("inner/wood_normal", (8, 8, 3))):
        path = folder / f"{name}.exr"
        path.parent.mkdir(parents=True, exist_ok=True)
        exr.write(path, {"": np.ones(size, np.float32)})
    for name, size in (("old", b"-Y 4 +X 8"), ("square", b"-Y 8 +X 8")):
        (folder / f"{name}.hdr").write_bytes(b"#?RADIANCE\n\n" + size + b"\n")
    (folder / "damaged.exr").write_bytes(b"no picture")
    (folder / "damaged.blend").write_bytes(b"BLENDER17-01v0502" + b"WO\0\0" * 9)
    (folder / ".hidden").mkdir()
    exr.write(folder / ".hidden" / "sky.exr", {"": np.ones((4, 8, 3), np.float32)})
    for name in ("Größer Himmel", "No Asset"):
        world = bpy.data.worlds.new(name)
        world.use_fake_user = True
        if name != "No Asset":
            world.asset_mark()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "worlds.blend"), compress=False)
    monkeypatch.setattr(shelf, "_file", lambda: tmp_path / "config" / shelf.RECENT)
    for kept in (shelf._recent, shelf._found):
        kept.clear()
    shelf.forget()
    libraries = bpy.context.preferences.filepaths.asset_libraries
    libraries.new(name="Ours", directory=str(folder))
    yield folder
    bpy.ops.wm.read_factory_settings(use_empty=True)
    for kept in (shelf._recent, shelf._found):
        kept.clear()
    shelf.forget()


def looked() -> list[shelf.Item]:
    shelf.look(lambda: None)
    shelf._thread.join(60)
    return shelf.items()


def test_lights_of_an_asset_library(library, tmp_path):
    """Panoramas and worlds that are assets. A click lights the scene with one."""
    worlds = shelf.Item(str(library / "worlds.blend"), "Größer Himmel")
    ours = [i for i in looked() if i.path.startswith(str(tmp_path))]
    assert ours == [
        shelf.Item(str(library / "old.hdr")), shelf.Item(str(library / "sky.exr")), worlds,
    ]  # fmt: skip
    scene = small_scene(tmp_path)
    bpy.ops.arto.use_hdri(filepath=ours[1].path)
    world = scene.world
    assert hdri(world).name == "sky.exr" and strip._shown_by(world) == ours[1]
    for _ in range(2):  # the second time it is the one that is there
        bpy.ops.arto.use_hdri(filepath=worlds.path, world=worlds.world)
        assert scene.world.name == "Größer Himmel" and not scene.world.library
        assert strip._shown_by(scene.world) == worlds
    # an asset stays what it is: the HDRI gets a world of its own
    bpy.ops.arto.use_hdri(filepath=ours[1].path)
    assert scene.world.name != "Größer Himmel" and hdri(scene.world).name == "sky.exr"
    with pytest.raises(RuntimeError, match="any more"):
        bpy.ops.arto.use_hdri(filepath=worlds.path, world="Gone")


def test_the_last_hdris_are_remembered(library, tmp_path):
    """The newest first, each once, as many as there is room for, and none that is gone."""
    for i in range(shelf.MOST_RECENT + 3):
        shelf.note(str(library / f"{i}.exr"))
    shelf.note(str(library / "sky.exr"))
    shelf.note(str(library / "7.exr"))
    file = tmp_path / "config" / shelf.RECENT
    names = [path.rsplit("/", 1)[-1] for path in json.loads(file.read_text())]
    assert names[:3] == ["7.exr", "sky.exr", "14.exr"] and len(names) == shelf.MOST_RECENT
    # what is shown stays where it is until Blender is started anew
    shown = shelf.items()
    shelf.note(shown[5].path)
    assert shelf.items() == shown
    shelf._recent.clear()
    assert looked()[0] == shelf.Item(str(library / "sky.exr"))
    assert len(shelf._recent) == 1
    # a file that is something else has none
    for text in ("{", "[1, [2], null]", '"x"'):
        file.write_text(text)
        assert shelf._read(file) == []


def test_compressed_files(tmp_path):
    """Read where there is what Blender compresses with; else they have no worlds."""
    path = tmp_path / "small.blend"
    bpy.ops.wm.read_factory_settings(use_empty=True)
    world = bpy.data.worlds.new("Sky")
    world.use_fake_user = True
    world.asset_mark()
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True)
    assert worlds_in(path) == (["Sky"] if zstandard() else [])
