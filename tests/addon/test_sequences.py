"""A sequence that was stopped goes on, and one that is not whole is never taken for a still."""

from __future__ import annotations

import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.capture import sequence
from arto.arto_addon.capture.sequence import capture_frames
from arto.arto_addon.relight import many
from arto.arto_addon.shot import home, paths
from arto.arto_addon.work import Batch, Failed, Wrote
from arto.core import exr
from arto.core.errors import CancelledError, CaptureSetError, SceneError
from scene_tools import hdri, small_scene, smooth


@pytest.fixture
def scene(tmp_path):
    made = small_scene(tmp_path)
    made.arto.samples, made.arto.keep, made.arto.grain = 1, "never", False
    made.arto.patterns, made.arto.support, made.arto.environment_width = "white", "whole", 64
    made.arto.far, made.arto.size = False, 20  # its light is not checked
    hdri(made, smooth(16))
    return made


class Renders:
    """Counts the renders of basis images; ends the work at one of them."""

    def __init__(self, stop: int = -1) -> None:
        self.stop, self.wrote, self.failed, self.renders = stop, [], [], 0

    def __call__(self, step) -> None:
        if "basis images" in step.text:
            self.renders += 1
            if self.renders == self.stop:
                raise CancelledError("stopped")
        elif isinstance(step, Wrote):
            self.wrote.append(step.text)
        elif isinstance(step, Failed):
            self.failed.append(step.of)


def captured(scene, frames, stop=-1, batch=work.PLAIN) -> Renders:
    said = Renders(stop)
    steps = capture_frames(scene, scene.view_layers[0].name, frames, batch)
    if stop > 0:
        with pytest.raises(CancelledError):
            work.run(steps, said)
    else:
        work.run(steps, said)
    return said


def test_frames_that_are_there_are_passed_by(scene):
    captured(scene, range(1, 4), stop=3)
    said = captured(scene, range(1, 4))
    assert said.renders == 1 and sum("there already" in text for text in said.wrote) == 2
    field = next(paths.field_folder(scene).glob("*.arto"))
    data = field.read_bytes()
    field.write_bytes(data[: len(data) // 2])  # a frame that is not whole is captured again
    scene.objects["Matt"].location.z += 0.5  # and so is all of another scene
    assert captured(scene, range(1, 3)).renders == 2


@pytest.mark.parametrize("stop", [2, 3])
@pytest.mark.parametrize("saved", [True, False])
def test_a_sequence_that_was_stopped_is_no_still(scene, tmp_path, monkeypatch, stop, saved):
    """Also where the scene's ID was never saved, and where the first frame alone is there."""
    monkeypatch.setattr(home, "file", lambda: str(tmp_path / "shot.blend"))
    captured(scene, range(1, 4), stop=stop)
    if not saved:
        scene.arto.scene_id = ""
    steps = many.relight_many(scene, scene.view_layers[0].name, frames=range(1, 4))
    with pytest.raises(CaptureSetError, match="not to the end"):
        work.run(steps)
    assert not list(tmp_path.glob("relit*.exr"))


def test_frames_are_looked_at_before_the_first_is_rendered(scene, monkeypatch):
    real = sequence.check_scene

    def check(scene, layer=None):
        real(scene, layer)
        if scene.frame_current == 3:
            raise SceneError("the cloth was not baked")

    monkeypatch.setattr(sequence, "check_scene", check)
    said = Renders()
    with pytest.raises(SceneError, match="cloth"):
        work.run(capture_frames(scene, scene.view_layers[0].name, [1, 3]), said)
    assert said.renders == 0 and said.failed == ["frame 3"]
    said = captured(scene, [1, 3], batch=Batch(keep_going=True))
    assert said.renders == 1 and said.failed == ["frame 3"]


def test_a_frame_that_shows_nothing_is_found_first(scene):
    for thing in list(scene.objects):
        if thing.type == "MESH":
            thing.hide_render = False
            thing.keyframe_insert("hide_render", frame=1)
            thing.hide_render = True
            thing.keyframe_insert("hide_render", frame=2)
    said = Renders()
    with pytest.raises(SceneError, match="shows nothing"):
        work.run(capture_frames(scene, scene.view_layers[0].name, [1, 2, 3]), said)
    assert said.renders == 0 and said.failed == ["frame 2", "frame 3"]


def test_one_file_of_mattes_for_several_frames_is_refused(scene, tmp_path):
    """Of the program that wrote it nothing says of which frame it is."""
    captured(scene, [1, 2])
    about = {"cryptomatte/a1b2c3d/name": "CryptoObject"}
    planes = {"CryptoObject00": {"R": np.zeros((18, 24))}}
    for name in ("one.exr", "mine.0001.exr", "mine.0002.exr"):
        exr.write_planes(tmp_path / name, planes, about)
    scene.arto.write_data, scene.arto.cryptomatte = True, str(tmp_path / "one.exr")
    layer = scene.view_layers[0].name
    with pytest.raises(SceneError, match="write ####"):
        work.run(many.relight_many(scene, layer, frames=[1, 2]))
    assert not list(tmp_path.glob("relit*.exr"))
    scene.arto.cryptomatte = str(tmp_path / "mine.####.exr")
    assert len(work.run(many.relight_many(scene, layer, frames=[1, 2]))) == 2


def test_room_for_all_frames_is_looked_at(scene, monkeypatch):
    seen = []
    monkeypatch.setattr(sequence.room, "check_disk", lambda _, needed, what: seen.append(needed))
    monkeypatch.setattr(sequence, "capture", lambda *_: (step for step in ()))
    for frames in (range(1, 3), range(1, 11)):
        with pytest.raises(SceneError, match="none of the frames"):
            captured(scene, frames)
    assert seen[1] > 2 * seen[0]
