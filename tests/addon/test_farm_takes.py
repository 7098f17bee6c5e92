"""A shot with shadow catchers by many machines: each take in parts of its own, all of one noise."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.capture import planned, room
from arto.arto_addon.capture.capture import estimate
from arto.arto_addon.farm import gather as gathering
from arto.arto_addon.farm import part as parts
from arto.arto_addon.farm import templates
from arto.arto_addon.farm.gather import gather
from arto.arto_addon.fit import fit
from arto.arto_addon.plate import plate
from arto.arto_addon.plate.names import relit_file
from arto.arto_addon.shot import paths
from arto.arto_addon.stage.takes import TAKES
from arto.core import exr
from arto.core.errors import CancelledError, FarmError, FieldError, SceneError
from arto.core.field.field import Field
from scene_tools import captured
from shot_tools import (
    arrays,
    assert_same,
    footage_of,
    planned_job,
    relit_and_share,
    with_catcher,
)


def saved_shot(folder: Path, samples: int = 8, patches: int = 1) -> bpy.types.Scene:
    """A saved shot with a shadow catcher, as a farm's machines open it."""
    scene = with_catcher(folder, samples, patches)
    scene.arto.patterns = "linear"
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    return scene


def fields(scene: bpy.types.Scene) -> dict[str, np.ndarray]:
    """Those of all takes."""
    return arrays(paths.field_folder(scene).parent)


def relit(scene: bpy.types.Scene) -> list[np.ndarray]:
    """The plate, how much is seen of what is behind, and the comp on the footage."""
    found = relit_and_share(scene)
    return [*found, exr.read(plate.comp_file(relit_file(scene)))[""]]


def test_parts_of_takes_are_what_one_machine_makes(tmp_path, monkeypatch):
    """Bit for bit: each take's field, the plate, the share and the comp; rendered backwards, a part
    of every take killed and run again. The artist's catcher stays one on every way out."""
    monkeypatch.setattr(planned, "tiles_of", lambda r, n, m: planned.strips_of(r, 2))
    scene = saved_shot(tmp_path)
    footage_of(scene, tmp_path)
    bpy.ops.wm.save_mainfile()
    captured(scene)
    alone, pictures = fields(scene), relit(scene)
    assert {Path(n).parts[0] for n in alone} == {"field", "ground", "things"}
    shutil.rmtree(tmp_path / "arto")
    job = planned_job(scene, tmp_path / "job")
    assert [(p.frame, p.take, p.tile) for p in job.parts] == [
        (1, "", 0), (1, "", 1), (1, "ground", 0), (1, "ground", 1), (1, "things", 0),
        (1, "things", 1),
    ]  # fmt: skip
    lines = (job.folder / templates.LINES).read_text().splitlines()
    assert len(lines) == 7 and "part 5 " in lines[5] and "gather" in lines[6]
    space = templates.openjd(job)["steps"][0]["parameterSpace"]["taskParameterDefinitions"]
    assert space[0]["range"] == "0-5"
    floor, box = scene.objects["Floor"], scene.objects["Matt"]
    for number in (1, 3, 5):
        killed = parts.render_part(job.folder, number)
        for step in killed:
            if isinstance(step, work.Render):
                break
        killed.close()
        assert floor.is_shadow_catcher and box.visible_camera and box.visible_shadow
        assert not list((job.folder / "parts").iterdir()), "whole or not at all"
    for number in (5, 3, 1, 4, 0):
        work.run(parts.render_part(job.folder, number))
    with pytest.raises(FarmError, match=r"1 of 6 parts are not there \(2\): render them"):
        work.run(gather(job.folder))
    assert not (tmp_path / "arto").exists(), "then nothing has changed"
    work.run(parts.render_part(job.folder, 2))
    assert not list(job.folder.rglob("*.exr")), "a part keeps what was fitted"
    assert work.run(gather(job.folder)) == [paths.field_folder(scene)]
    assert_same(fields(scene), alone)
    for one, two in zip(relit(scene), pictures, strict=True):
        np.testing.assert_array_equal(one, two)
    assert not list((job.folder / "parts").iterdir())
    # and again, which has nothing to do
    work.run(gather(job.folder))
    assert_same(fields(scene), alone)


@pytest.mark.newest
def test_stretches_of_takes_are_one_capture_of_their_samples(tmp_path):
    """Their noise is the same where takes are divided by each other, as in one piece: the share is
    off by a ten-thousandth, at most, of what another seed's is off by."""
    scene = saved_shot(tmp_path, samples=16)

    def one(seed: int) -> tuple[np.ndarray, ...]:
        scene.arto.seed = seed
        captured(scene)
        return relit_and_share(scene)

    other, expected = one(1), one(0)
    shutil.rmtree(tmp_path / "arto")
    scene.arto.samples, scene.arto.keep = 8, "always"
    job = planned_job(scene, tmp_path / "job", tiles=1, seeds=2)
    assert len(job.parts) == 6
    for p in job.parts:
        work.run(parts.render_part(job.folder, p.number))
    work.run(gather(job.folder))
    work.run(fit.fit(scene))
    for name in ("", *TAKES):
        about = Field(paths.field_folder(scene).parent / name / "field").about
        assert about.samples == 16
    for found, right, noisy in zip(relit_and_share(scene), expected, other, strict=True):
        noise = np.abs(noisy - right).mean()
        assert noise > 1e-3
        assert np.abs(found - right).mean() < 1e-4 * noise


@pytest.mark.newest
def test_a_gathering_stopped_between_takes_is_gone_on_with(tmp_path, monkeypatch):
    """What is there of a new capture is never shown with what is left of an old one, also where
    that is of the same settings, and not of two seeds."""
    scene = saved_shot(tmp_path, samples=4)
    job = planned_job(scene, tmp_path / "job", tiles=1, seeds=2)
    for p in job.parts:
        work.run(parts.render_part(job.folder, p.number))
    shutil.copytree(job.folder, tmp_path / "other")
    work.run(gather(tmp_path / "other"))
    expected = fields(scene)
    shutil.rmtree(tmp_path / "arto")
    captured(scene)
    ended = []

    def stopping(source: Path, target: Path) -> None:
        if ended:
            raise KeyboardInterrupt
        ended.append(target)
        real(source, target)

    real = gathering.finish
    monkeypatch.setattr(gathering, "finish", stopping)
    with pytest.raises(CancelledError):
        work.run(gather(job.folder))
    assert [f.parent.name for f in ended] == ["things"], "the first take is the last"
    monkeypatch.undo()
    with pytest.raises(FieldError, match="captured for another picture"):
        relit_and_share(scene)
    assert work.run(gather(job.folder)) == [paths.field_folder(scene)]
    assert_same(fields(scene), expected)
    relit_and_share(scene)


def test_takes_are_of_the_frames_that_show_a_catcher(tmp_path):
    """And where there is none any more, what an earlier capture had beside it goes."""
    scene = saved_shot(tmp_path, samples=2)
    floor = scene.objects["Floor"]
    for frame, hidden in ((1, False), (2, True)):
        floor.hide_render = hidden
        floor.keyframe_insert("hide_render", frame=frame)
    scene.frame_set(2)
    left = paths.claim(scene, scene.view_layers[0].name) / "ground" / "field"
    left.mkdir(parents=True)
    scene.frame_set(1)
    bpy.ops.wm.save_mainfile()
    job = planned_job(scene, tmp_path / "job", frames=[1, 2], tiles=1)
    assert [(p.frame, p.take) for p in job.parts] == [
        (1, ""), (1, "ground"), (1, "things"), (2, ""),
    ]  # fmt: skip
    for p in job.parts:
        work.run(parts.render_part(job.folder, p.number))
    first, second = work.run(gather(job.folder))
    assert [(first.parent / name).exists() for name in TAKES] == [True, True]
    assert [(second.parent / name).exists() for name in TAKES] == [False, False]
    assert Field(first).about.catchers == ("Floor",)
    assert Field(second).about.catchers is None
    relit_and_share(scene)


def test_a_file_whose_catcher_is_none_is_refused(tmp_path):
    scene = saved_shot(tmp_path, samples=2)
    job = planned_job(scene, tmp_path / "job", tiles=1)
    scene.objects["Floor"].is_shadow_catcher = False
    with pytest.raises(FarmError, match=r"not the scene that was planned"):
        work.run(parts.render_part(job.folder, 0))
    with pytest.raises(SceneError, match="nothing in the scene catches shadows"):
        work.run(parts.render_part(job.folder, 1))
    assert not list((job.folder / "parts").iterdir())
    (job.folder / "frame_0001_ground").rename(tmp_path / "gone")
    shutil.copytree(job.folder / "frame_0001_things", job.folder / "frame_0001_ground")
    with pytest.raises(FarmError, match="not of the take 'ground': plan again"):
        work.run(parts.render_part(job.folder, 1))


def test_a_blender_without_arto_renders_takes(tmp_path):
    """Bit for bit what ARTO's own parts are. Of a library's catcher it would not: that is said."""
    scene = saved_shot(tmp_path, samples=4)
    job = planned_job(scene, tmp_path / "job", tiles=1)
    other = tmp_path / "other"
    shutil.copytree(job.folder, other)
    for number in range(3):
        work.run(parts.render_part(other, number))
    work.run(gather(other))
    expected = fields(scene)
    saved = [str(work.run(parts.save_part(job.folder, number))) for number in range(3)]
    assert scene.objects["Floor"].is_shadow_catcher
    script = (
        "import bpy, sys\n"
        "for path in sys.argv[1:]:\n"
        "    bpy.ops.wm.open_mainfile(filepath=path)\n"
        "    bpy.ops.render.render(animation=True)\n"
    )
    subprocess.run([sys.executable, "-c", script, *saved], check=True, cwd=tmp_path)
    work.run(gather(job.folder))
    assert_same(fields(scene), expected)


def test_a_part_of_linked_catchers_is_not_saved_for_a_blender_without_arto(tmp_path):
    scene = saved_shot(tmp_path, samples=2)
    floor = scene.objects["Floor"]
    bpy.data.libraries.write(str(tmp_path / "set.blend"), {floor})
    bpy.data.objects.remove(floor)
    with bpy.data.libraries.load(str(tmp_path / "set.blend"), link=True) as (there, here):
        here.objects = list(there.objects)
    scene.collection.objects.link(here.objects[0])
    bpy.ops.wm.save_mainfile()
    job = planned_job(scene, tmp_path / "job", tiles=1)
    for number in (0, 1):
        with pytest.raises(FarmError, match="'Floor' comes from a library"):
            work.run(parts.save_part(job.folder, number))
    # in this one everything is as its library has it
    assert work.run(parts.save_part(job.folder, 2)).is_file()


def test_all_takes_must_find_room(tmp_path, monkeypatch):
    """What three have to keep waits in the job's folder."""
    scene = saved_shot(tmp_path, samples=2)
    scene.arto.keep = "always"
    scene.objects["Floor"].is_shadow_catcher = False
    one = work.run(estimate(scene, scene.view_layers[0].name))
    real = room.shutil.disk_usage
    monkeypatch.setattr(
        room.shutil, "disk_usage", lambda p: real(p)._replace(free=int(1.5 * one.disk))
    )
    planned_job(scene, tmp_path / "job", tiles=1)
    scene.objects["Floor"].is_shadow_catcher = True
    with pytest.raises(SceneError, match=r"needs .* of disk"):
        planned_job(scene, tmp_path / "job", tiles=1)


def test_a_job_on_another_disk_is_gathered(tmp_path):
    """Folders cannot be renamed from one to another."""
    elsewhere = Path("/dev/shm")
    if not elsewhere.is_dir() or elsewhere.stat().st_dev == tmp_path.stat().st_dev:
        pytest.skip("there is no second disk at hand")
    scene = saved_shot(tmp_path, samples=2)
    with tempfile.TemporaryDirectory(dir=elsewhere) as there:
        job = planned_job(scene, Path(there) / "job", tiles=1)
        for p in job.parts:
            work.run(parts.render_part(job.folder, p.number))
        (found,) = work.run(gather(job.folder))
        assert not list(job.folder.glob("frame_*"))
        assert not list(tmp_path.rglob("*.part"))
        assert found == paths.field_folder(scene)
    relit_and_share(scene)
