"""What a job says: all that its parts need to be what a capture makes, wherever they are."""

from __future__ import annotations

import json
import shutil

import bpy
import pytest
from arto.arto_addon import work
from arto.arto_addon.capture import room, sequence
from arto.arto_addon.capture.capture import estimate
from arto.arto_addon.capture.sequence import capture_frames
from arto.arto_addon.farm import head as job_heads
from arto.arto_addon.farm import part as parts
from arto.arto_addon.farm.gather import gather
from arto.arto_addon.relight.relight import relight
from arto.arto_addon.settings.table import FARM
from arto.arto_addon.shot import paths
from arto.core import exr
from arto.core.capture.capture_set import CaptureSet
from arto.core.errors import FarmError, SceneError
from arto.core.field.field import Field
from arto.core.signed import parsed
from scene_tools import captured
from shot_tools import arrays, assert_same, planned_job


def test_between_two_frames_is_where_it_was_planned(farm_scene, tmp_path):
    """As a capture of the scene as it stands; a frame by its number is at its begin."""
    farm_scene.arto.adaptive = farm_scene.arto.far = False
    ball = farm_scene.objects["Matt"]
    for frame, x in ((1, -1.5), (2, 0.0)):
        ball.location.x = x
        ball.keyframe_insert("location", frame=frame)
    farm_scene.frame_set(1, subframe=0.5)
    captured(farm_scene)
    expected = paths.field_folder(farm_scene)
    alone = arrays(expected)
    shutil.rmtree(tmp_path / "arto")
    job = planned_job(farm_scene, tmp_path / "job", frames=None, tiles=1)
    farm_scene.frame_set(7)
    with pytest.raises(FarmError, match="between two frames"):
        work.run(parts.save_part(job.folder, 0))
    work.run(parts.render_part(job.folder, 0))
    assert work.run(gather(job.folder)) == [expected]
    assert_same(arrays(expected), alone)
    assert (farm_scene.frame_current, farm_scene.frame_subframe) == (7, 0.0)
    farm_scene.frame_set(1, subframe=0.5)
    job = planned_job(farm_scene, tmp_path / "other", frames=[1], tiles=1)
    assert job.set_of(1, "").head.shot.subframe == 0.0
    assert farm_scene.frame_subframe == 0.5


@pytest.mark.parametrize("seeds", [1, 2])
def test_the_quality_is_that_of_the_scene(farm_scene, tmp_path, seeds):
    """A share of its own samples, as the artist left it, also of what a Blender without ARTO has
    rendered and where a gathering is gone on with."""
    farm_scene.arto.adaptive = farm_scene.arto.far = False
    farm_scene.arto.quality, farm_scene.cycles.samples = "DRAFT", 24
    before = {name: getattr(farm_scene.arto, name) for name in FARM}
    job = planned_job(farm_scene, tmp_path / "job", seeds=seeds)
    for p in job.parts:
        folder = work.run(parts.render_part(job.folder, p.number))
        told = parsed((folder / job_heads.PART_HEADER).read_text())
        assert told["samples"] == 6
        if seeds == 2 and p.seed == 1:
            # as a Blender without ARTO leaves it
            layers = exr.read(folder / told["files"][0])
            said = {"Note": p.note(0, told["key"])}
            exr.write(folder.with_name(p.rendered_name(0)), layers, said)
            shutil.rmtree(folder)
    steps = gather(job.folder)
    assert any("tile 2" in step.text for step in steps), "stopped after the first tile"
    steps.close()
    (found,) = work.run(gather(job.folder))
    head = CaptureSet(paths.capture_folder(farm_scene)).head
    assert Field(found).about.samples == head.samples == 6 * seeds
    assert {name: getattr(farm_scene.arto, name) for name in FARM} == before


def test_a_scene_that_has_no_id_yet_is_found_when_it_is_renamed(farm_scene, tmp_path):
    """As after a capture, which gives it one: what a job was planned from may have none."""
    farm_scene.arto.adaptive = farm_scene.arto.far = False
    farm_scene.arto.scene_id = ""
    job = planned_job(farm_scene, tmp_path / "job", tiles=1)
    work.run(parts.render_part(job.folder, 0))
    (found,) = work.run(gather(job.folder))
    assert farm_scene.arto.scene_id
    assert Field(found).about.shot.scene_id == farm_scene.arto.scene_id
    farm_scene.name = "Renamed"
    work.run(relight(farm_scene))


def test_a_preset_does_not_undo_what_was_chosen_after_it(farm_scene, tmp_path):
    farm_scene.arto.preset = "paper"
    farm_scene.arto.faces = {"top", "left"}
    farm_scene.arto.adaptive = farm_scene.arto.far = False
    job = planned_job(farm_scene, tmp_path / "job")
    farm_scene.arto.preset = "full"
    farm_scene.arto.patches = 3
    with job.scene() as (scene, _):
        assert scene.arto.faces == {"top", "left"} and scene.arto.half_sides
        assert scene.arto.patches == 2
    assert len(farm_scene.arto.faces) == 6 and farm_scene.arto.patches == 3


def test_a_job_of_the_version_before_goes_on(farm_scene, tmp_path):
    """It knew no takes, and had all settings: one that is not a capture's changes nothing."""
    farm_scene.arto.adaptive = farm_scene.arto.far = False
    job = planned_job(farm_scene, tmp_path / "job")
    work.run(parts.render_part(job.folder, 0))
    part = parsed((job.part_folder(job.parts[0]) / job_heads.PART_HEADER).read_text())
    assert part["part"] == {"number": 0, "frame": 1, "tile": 0, "seed": 0}, "as before"
    data = parsed((job.folder / job_heads.HEADER).read_text())
    del data["catchers"], data["subframe"]
    data["settings"] |= {"overscan": 7, "scene_id": ""}
    (job.folder / job_heads.HEADER).write_text(json.dumps(data | {"version": 1}))
    work.run(parts.render_part(job.folder, 1))
    (found,) = work.run(gather(job.folder))
    assert Field(found).about.samples == 16 and farm_scene.arto.overscan == 0


def test_the_parts_of_all_seeds_must_find_room(farm_scene, tmp_path, monkeypatch):
    """Their images wait for each other; the room that one capture needs is not enough."""
    farm_scene.arto.adaptive = farm_scene.arto.far = False
    layer = farm_scene.view_layers[0].name
    one = work.run(estimate(farm_scene, layer))
    real = room.shutil.disk_usage
    free = int(1.5 * one.disk)
    monkeypatch.setattr(room.shutil, "disk_usage", lambda p: real(p)._replace(free=free))
    planned_job(farm_scene, tmp_path / "job")
    with pytest.raises(FarmError, match=r"parts of this job need .* fewer frames or seeds"):
        planned_job(farm_scene, tmp_path / "job", seeds=8)
    assert not (tmp_path / "job" / job_heads.HEADER).exists(), "nothing that half a job hangs on"


def test_a_machine_without_the_memory_says_so(farm_scene, tmp_path, monkeypatch):
    """Before it renders: farms have machines of many kinds."""
    farm_scene.arto.adaptive = farm_scene.arto.far = False
    job = planned_job(farm_scene, tmp_path / "job")
    monkeypatch.setattr(room, "memory", lambda: (1 << 20, 1 << 20))
    with pytest.raises(SceneError, match=r"part_0000 needs .* of memory"):
        for step in parts.render_part(job.folder, 0):
            assert not isinstance(step, work.Render)


def test_frames_by_number_are_those_of_a_sequence(farm_scene, tmp_path):
    """Also where there is one: it is looked at anew, and the scene as it stands is lit by the
    hemicube that was built into it."""
    farm_scene.arto.adaptive = farm_scene.arto.far = False
    layer = farm_scene.view_layers[0].name
    bpy.ops.arto.build_hemicube()
    farm_scene.objects["Matt"].location.z += 2
    bpy.context.view_layer.update()
    (folder,) = work.run(capture_frames(farm_scene, layer, [1]))
    anew = CaptureSet(folder).hemicube.centre
    as_built = captured(farm_scene).hemicube.centre
    assert anew[2] == pytest.approx(as_built[2] + 1), "half of what it is higher"
    for frames, expected in (([1], anew), (None, as_built)):
        job = planned_job(farm_scene, tmp_path / "job", frames)
        assert job.set_of(1, "").hemicube.centre == expected


def test_frames_whose_parts_are_there_can_be_gathered(farm_scene, tmp_path):
    farm_scene.arto.adaptive = farm_scene.arto.far = False
    farm_scene.arto.samples = 2
    job = planned_job(farm_scene, tmp_path / "job", frames=[1, 2], tiles=1)
    work.run(parts.render_part(job.folder, 0))
    with pytest.raises(FarmError, match=r"1 of 1 parts are not there \(1\)"):
        work.run(gather(job.folder))
    failed = []

    def say(step):
        failed.extend([step.of] if isinstance(step, work.Failed) else [])

    (folder,) = work.run(gather(job.folder, work.Batch(keep_going=True)), say)
    assert failed == ["frame 2"] and Field(folder).has_layer("alpha")
    work.run(parts.render_part(job.folder, 1))
    assert len(work.run(gather(job.folder))) == 2


def test_a_plan_looks_at_all_frames_before_it_removes_anything(farm_scene, tmp_path, monkeypatch):
    farm_scene.arto.adaptive = farm_scene.arto.far = False
    job = planned_job(farm_scene, tmp_path / "job", frames=[1], tiles=1)
    before = {path: path.read_bytes() for path in job.folder.rglob("*") if path.is_file()}
    real = sequence.check_scene

    def check(scene, layer=None):
        real(scene, layer)
        if scene.frame_current == 2:
            raise SceneError("the cloth was not baked")

    monkeypatch.setattr(sequence, "check_scene", check)
    with pytest.raises(SceneError, match="cloth"):
        planned_job(farm_scene, tmp_path / "job", frames=[1, 2], tiles=1)
    assert {path: path.read_bytes() for path in job.folder.rglob("*") if path.is_file()} == before
