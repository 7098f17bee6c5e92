"""What would end a relight is found before its first second of work, and the others are made."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.plate.names import relit_file
from arto.arto_addon.relight import many, outputs
from arto.arto_addon.relight.looks import relight_looks
from arto.arto_addon.work import Batch, Failed, Warned, Wrote
from arto.core import exr
from arto.core.errors import ArtoError, ExrError, SceneError, StrictError


@pytest.fixture
def maps(tmp_path):
    """Two environment maps, and between them one that is cut off."""
    files = [tmp_path / f"{name}.exr" for name in ("a", "broken", "c")]
    for n, file in enumerate(files):
        exr.write(file, {"": np.full((8, 16, 3), n + 1.0, np.float32)})
    files[1].write_bytes(files[1].read_bytes()[:-9])
    return files


class Said:
    """The steps of a work, by their kind."""

    def __init__(self) -> None:
        self.wrote: list[str] = []
        self.failed: list[str] = []
        self.warned: list[str] = []

    def __call__(self, step) -> None:
        if isinstance(step, Wrote):
            self.wrote.append(step.path.name)
        elif isinstance(step, Failed):
            self.failed.append(step.of)
        elif isinstance(step, Warned):
            self.warned.append(step.of)


def relit(scene, *, batch=work.PLAIN, **asked) -> Said:
    said = Said()
    steps = many.relight_many(scene, scene.view_layers[0].name, batch=batch, **asked)
    try:
        work.run(steps, said)
    except ArtoError as e:
        said.error = e
    else:
        said.error = None
    return said


def pictures(scene) -> set[str]:
    return {path.name for path in relit_file(scene).parent.glob("*.exr")}


def texture_of(scene):
    nodes = scene.world.node_tree.nodes
    return next(node for node in nodes if node.bl_idname == "ShaderNodeTexEnvironment")


@pytest.fixture(autouse=True)
def clean(shot):
    yield
    for path in relit_file(shot).parent.glob("*.exr"):
        path.unlink()


def test_a_bad_world_ends_all_before_any_is_made(shot, maps):
    said = relit(shot, worlds=maps)
    assert isinstance(said.error, SceneError) and "broken.exr" in str(said.error)
    assert said.failed == ["shot_relit_broken.exr"] and not said.wrote
    assert not pictures(shot)


def test_the_others_are_made_where_asked(shot, maps):
    said = relit(shot, worlds=maps, batch=Batch(keep_going=True))
    assert said.error is None and said.failed == ["shot_relit_broken.exr"]
    assert said.wrote == ["shot_relit_a.exr", "shot_relit_c.exr"]
    assert pictures(shot) == set(said.wrote)
    said = relit(shot, worlds=maps[1:2], batch=Batch(keep_going=True))
    assert isinstance(said.error, SceneError) and not said.wrote


def test_what_fails_at_work_is_one_of_many_too(shot, maps, monkeypatch):
    real = many.finish

    def finish(shown, ready, pictures):
        if ready.lit.look == "a":
            yield work.Warned(0.5, "almost")
            raise ExrError("the disk is full")
        return (yield from real(shown, ready, pictures))

    monkeypatch.setattr(many, "finish", finish)
    said = relit(shot, worlds=[maps[0], maps[2]], batch=Batch(keep_going=True))
    assert said.error is None and said.wrote == ["shot_relit_c.exr"]
    assert said.failed == said.warned == ["shot_relit_a.exr"]
    said = relit(shot, worlds=[maps[2], maps[0]])
    assert isinstance(said.error, ExrError) and said.wrote == ["shot_relit_c.exr"]


def test_a_warning_is_an_error_where_asked(shot, maps):
    """Before anything is made, where it can be known."""
    shot.objects["Floor"].location.z -= 0.1
    try:
        assert relit(shot, worlds=maps[:1]).warned
        said = relit(shot, worlds=maps[2:], batch=Batch(strict=True))
        assert isinstance(said.error, StrictError) and "not the captured one" in str(said.error)
        assert pictures(shot) == {"shot_relit_a.exr"}
    finally:
        shot.objects["Floor"].location.z += 0.1


@pytest.mark.parametrize(
    ("output", "match"),
    [
        ("{tmp}/" + "x" * 240 + ".exr", "bytes long"),
        ("{tmp}/folder.exr", "is a folder"),
        ("{tmp}/file/shot.exr", "nothing can be written into"),
        ("{map}", "written over"),
    ],
)
def test_a_picture_without_a_place_is_said_before(shot, maps, tmp_path, output, match):
    (tmp_path / "folder_a.exr").mkdir()
    (tmp_path / "folder.exr").mkdir()
    (tmp_path / "file").write_text("mine")
    before_output, shot.arto.output = shot.arto.output, output.format(tmp=tmp_path, map=maps[0])
    image = bpy.data.images.load(str(maps[0]))
    texture = texture_of(shot)
    theirs, texture.image = texture.image, image
    before = maps[0].read_bytes()
    try:
        said = relit(shot)
        assert isinstance(said.error, SceneError) and match in str(said.error)
        assert maps[0].read_bytes() == before
    finally:
        shot.arto.output, texture.image = before_output, theirs


def test_room_on_the_disk_is_looked_at(shot, maps, monkeypatch):
    monkeypatch.setattr(outputs.room.shutil, "disk_usage", lambda _: SimpleNamespace(free=1))
    said = relit(shot, worlds=[maps[0], maps[2]])
    assert isinstance(said.error, SceneError) and "make room" in str(said.error)
    assert not said.wrote


def test_a_turntable_has_a_picture(shot):
    for turns in (0, -1):
        assert isinstance(relit(shot, turns=turns).error, SceneError)
    assert not pictures(shot)


def test_frames_of_a_world_with_a_gap_are_found_first(shot, tmp_path):
    """An animated world over a still: the picture of one frame is missing."""
    for frame in (1, 2, 4):
        exr.write(tmp_path / f"sky_{frame:04d}.exr", {"": np.full((8, 16, 3), 1.0, np.float32)})
    image = bpy.data.images.load(str(tmp_path / "sky_0001.exr"))
    image.source = "SEQUENCE"
    texture = texture_of(shot)
    theirs, texture.image = texture.image, image
    texture.image_user.frame_duration, texture.image_user.frame_start = 4, 1
    try:
        said = relit(shot, frames=range(1, 5))
        assert "sky_0003.exr" in str(said.error) and not said.wrote
        assert said.failed == ["shot_relit_0003.exr"]
        said = relit(shot, frames=range(3, 5), batch=Batch(keep_going=True))
        assert said.error is None and said.wrote == ["shot_relit_0004.exr"]
    finally:
        texture.image = theirs


def test_two_looks_of_one_picture_are_refused(shot):
    """Windows and macOS do not tell their files apart."""
    for name in ("Warm", "warm"):
        entry = shot.arto.looks.add()
        entry.name, entry.world = name, shot.world
    try:
        with pytest.raises(SceneError, match="one picture"):
            work.run(relight_looks(shot, shot.view_layers[0].name))
    finally:
        shot.arto.looks.clear()
        shot.arto.look = ""
    assert not pictures(shot)
