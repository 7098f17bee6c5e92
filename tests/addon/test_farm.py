"""A capture by many machines: the parts, in any order and killed or not, are what one makes."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.capture import planned
from arto.arto_addon.capture.sequence import capture_frames
from arto.arto_addon.farm import head as job_heads
from arto.arto_addon.farm import job as jobs
from arto.arto_addon.farm import part as parts
from arto.arto_addon.farm import templates
from arto.arto_addon.farm.gather import gather
from arto.arto_addon.fit import fit
from arto.arto_addon.shot import paths
from arto.core.capture.capture_set import CaptureSet
from arto.core.capture.kinds import Take
from arto.core.errors import ArtoError, FarmError
from arto.core.field.field import Field
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from arto.core.metrics import mean_relative_error
from arto.core.relight import relight
from arto.core.signed import parsed
from scene_tools import captured
from shot_tools import arrays, assert_same, planned_job


def test_parts_are_what_one_machine_makes(farm_scene, tmp_path, monkeypatch):
    """Bit for bit, rendered backwards, one of them killed in the middle and one run twice."""
    monkeypatch.setattr(planned, "tiles_of", lambda r, n, m: planned.strips_of(r, 2))
    captured(farm_scene)
    alone = arrays(paths.field_folder(farm_scene))
    shutil.rmtree(tmp_path / "arto")
    job = planned_job(farm_scene, tmp_path / "job")
    assert [p.to_json() for p in job.parts] == [
        {"number": 0, "frame": 1, "tile": 0, "seed": 0},
        {"number": 1, "frame": 1, "tile": 1, "seed": 0},
    ]
    killed = parts.render_part(job.folder, 1)
    for step in killed:
        if isinstance(step, work.Render):
            break
    killed.close()
    left = [p.name for p in (job.folder / "parts").iterdir()]
    assert not left, "whole or not at all"
    with pytest.raises(FarmError, match=r"2 of 2 parts are not there \(0, 1\): render them"):
        work.run(gather(job.folder))
    with monkeypatch.context() as m:
        # a driver that ran where the job was planned would give 0 here
        m.setattr(jobs.scripts, "check_drivers", lambda: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            work.run(parts.render_part(job.folder, 1))
    with monkeypatch.context() as m:
        # a farm gave the part to two machines, and the other one was first
        def second(partial: Path, folder: Path) -> None:
            shutil.copytree(partial, folder)
            raise OSError("File exists")

        m.setattr(parts, "replace_folder", second)
        work.run(parts.render_part(job.folder, 1))
        assert [p.name for p in (job.folder / "parts").iterdir()] == ["part_0001"]
    work.run(parts.render_part(job.folder, 0))
    rendered = []
    folder = work.run(parts.render_part(job.folder, 0), lambda s: rendered.append(s))
    assert folder == job.folder / "parts" / "part_0000"
    assert [type(s) for s in rendered] == [work.Wrote], "a part that is there is not rendered"
    assert not list(job.folder.rglob("*.exr")), "a part keeps what was fitted"
    (job.folder / "parts" / "part_0001.77.part").mkdir()  # of a process that was killed
    tile = job.folder / "parts" / "part_0001" / "field" / "tile_0001.arto"
    good = tile.read_bytes()
    tile.write_bytes(good[:300] + bytes([good[300] ^ 1]) + good[301:])
    with pytest.raises(FarmError, match=r"tile_0001.*render part 1 again"):
        work.run(gather(job.folder))
    tile.write_bytes(good)
    (found,) = work.run(gather(job.folder))
    assert found == paths.field_folder(farm_scene)
    assert_same(arrays(found), alone)
    assert Field(found).about.samples == 16
    assert not list((job.folder / "parts").iterdir())
    # and again, which has nothing to do
    assert work.run(gather(job.folder)) == [found]
    assert_same(arrays(found), alone)


@pytest.mark.newest
def test_two_seeds_are_one_capture_of_twice_the_samples(farm_scene, tmp_path):
    """Their error, against many samples, is that of the doubled number, to a hundredth."""
    farm_scene.arto.adaptive, farm_scene.arto.support = False, "linear"
    world = Environment(np.random.default_rng(4).random((32, 64, 3), np.float32))

    def picture(folder: Path) -> np.ndarray:
        field = Field(folder)
        return relight(field, PatchLight(world, field.hemicube))[..., :3]

    def one(samples: int, seed: int) -> np.ndarray:
        farm_scene.arto.samples, farm_scene.arto.seed = samples, seed
        captured(farm_scene)
        return picture(paths.field_folder(farm_scene))

    truth = one(4096, 90)
    single, double = one(32, 21), one(64, 21)
    farm_scene.arto.samples, farm_scene.arto.seed = 32, 21
    job = planned_job(farm_scene, tmp_path / "job", seeds=2, tiles=1)
    for p in job.parts:
        work.run(parts.render_part(job.folder, p.number))
    # seeds are averaged light by light, so a part has its images
    assert len(list(job.folder.rglob("*.exr"))) == 2
    (folder,) = work.run(gather(job.folder))
    assert Field(folder).about.samples == 64
    assert not list(tmp_path.rglob("*.exr")), "once fitted, the images go"
    errors = [mean_relative_error(p, truth) for p in (single, double, picture(folder))]
    assert errors[1] < 0.85 * errors[0]
    assert errors[2] == pytest.approx(errors[1], rel=0.01)


@pytest.mark.newest
def test_kept_images_of_seeds_are_a_capture_set(farm_scene, tmp_path):
    """Which can be fitted again; its images are those of the seeds, by their samples. A field of
    one seed's samples alone is not taken for one of it."""
    farm_scene.arto.keep = "always"
    captured(farm_scene)
    assert Field(work.run(fit.fit(farm_scene))).about.samples == 16
    job = planned_job(farm_scene, tmp_path / "job", seeds=2, tiles=1)
    each = []
    for p in job.parts:
        folder = work.run(parts.render_part(job.folder, p.number))
        head = job.set_of(1, Take.WHOLE).head.with_tile(0, files=("tile_0000.exr",))
        each.append(CaptureSet(folder, unfinished=True, head=head).read(0))
    work.run(gather(job.folder))
    there = CaptureSet(paths.capture_folder(farm_scene))
    found = there.read(0)
    assert there.samples == 32
    mean = (each[0].basis + each[1].basis) / 2
    np.testing.assert_allclose(found.basis, mean, atol=1e-6)
    assert np.abs(each[0].basis - each[1].basis).mean() > 1e-4, "two seeds differ"
    assert Field(work.run(fit.fit(farm_scene))).about.samples == 32


@pytest.mark.newest
def test_frames_are_as_a_sequence_has_them(farm_scene, tmp_path):
    """The same patches for all, and each frame's field in its place."""
    ball = farm_scene.objects["Matt"]
    for frame, x in ((1, -1.5), (2, 0.0)):
        ball.location.x = x
        ball.keyframe_insert("location", frame=frame)
    farm_scene.frame_set(1)
    bpy.ops.wm.save_mainfile()
    layer = farm_scene.view_layers[0].name
    work.run(capture_frames(farm_scene, layer, range(1, 3)))
    alone = {}
    for frame in (1, 2):
        farm_scene.frame_set(frame)
        alone[frame] = arrays(paths.field_folder(farm_scene))
    shutil.rmtree(tmp_path / "arto")
    farm_scene.frame_set(1)
    job = planned_job(farm_scene, tmp_path / "job", frames=(1, 2), tiles=1)
    assert len(job.parts) == 2
    for number in (0, 1):
        work.run(parts.render_part(job.folder, number))
    found = work.run(gather(job.folder))
    assert farm_scene.frame_current == 1
    for frame, folder in zip((1, 2), found, strict=True):
        assert_same(arrays(folder), alone[frame])


def test_another_scene_is_refused(farm_scene, tmp_path):
    job = planned_job(farm_scene, tmp_path / "job")
    work.run(parts.render_part(job.folder, 0))
    before = arrays(job.folder)
    farm_scene.objects["Glossy"].location.x += 0.1
    with pytest.raises(FarmError, match=r"not the scene that was planned \(.*Glossy.* is another"):
        work.run(parts.render_part(job.folder, 1))
    assert_same(arrays(job.folder), before)
    farm_scene.objects["Glossy"].location.x -= 0.1
    work.run(parts.render_part(job.folder, 1))
    told = parsed((job.folder / "parts/part_0001/part.json").read_text())
    told["key"] = "another"
    (job.folder / "parts/part_0001/part.json").write_text(json.dumps(told))
    with pytest.raises(FarmError, match="another scene, or for another plan"):
        work.run(gather(job.folder))
    with pytest.raises(FarmError, match="has a job with parts that were rendered"):
        planned_job(farm_scene, job.folder)
    with pytest.raises(FarmError, match=r"no part 9: .* has 0 to 1"):
        work.run(parts.render_part(job.folder, 9))
    with pytest.raises(FarmError, match="there is no job"):
        jobs.Job(tmp_path)


DAMAGE = [
    ("seeds", 0),
    ("tiles", "2"),
    ("frames", []),
    ("frames", [1.5]),
    ("settings", []),
    ("catchers", [2]),
    ("catchers", 1),
    ("version", 3),
    ("subframe", "half"),
]


def test_a_damaged_job_is_refused(farm_scene, tmp_path):
    job = planned_job(farm_scene, tmp_path / "job")
    data = parsed((job.folder / job_heads.HEADER).read_text())
    for key, value in DAMAGE:
        (job.folder / job_heads.HEADER).write_text(json.dumps(data | {key: value}))
        with pytest.raises(ArtoError, match=rf"'{key}' cannot be .*plan again"):
            jobs.Job(job.folder)
    (job.folder / job_heads.HEADER).write_text(json.dumps(data))
    assert len(jobs.Job(job.folder).parts) == 2


def test_a_blender_without_arto_renders_a_part(farm_scene, tmp_path, monkeypatch):
    """Its .blend, opened as it is and rendered; the field is the one that ARTO's own part makes."""
    job = planned_job(farm_scene, tmp_path / "job", tiles=1)
    other = tmp_path / "other"
    shutil.copytree(job.folder, other)
    work.run(parts.render_part(other, 0))
    (found,) = work.run(gather(other))
    expected = arrays(found)
    saved = work.run(parts.save_part(job.folder, 0))
    assert saved.name == "part_0000_00.blend"
    script = (
        "import bpy, sys; bpy.ops.wm.open_mainfile(filepath=sys.argv[1]); "
        "assert not hasattr(bpy.types.Scene, 'arto'); "
        "bpy.ops.render.render(animation=True)"
    )
    subprocess.run([sys.executable, "-c", script, str(saved)], check=True, cwd=tmp_path)
    assert [p.name for p in saved.parent.glob("*.exr")] == ["part_0000_00_0001.exr"]
    (found,) = work.run(gather(job.folder))
    assert_same(arrays(found), expected)


def test_flamenco_makes_the_tasks(tmp_path):
    """The job type, compiled by node with a stand-in for Flamenco's `author`."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not there")
    script = Path(templates.__file__).with_name(templates.FLAMENCO).read_text()
    stand_in = """
const made = [];
const author = {
  Task: (name, type) => ({name, type, commands: [], needs: [],
    addCommand(c) { this.commands.push(c); }, addDependency(t) { this.needs.push(t.name); }}),
  Command: (name, parameters) => ({name, parameters}),
};
"""
    settings = {
        "job_folder": "/shared/job",
        "parts": 2,
        "addon": "bl_ext.user_default.arto",
        "blendfile": "/shared/a b.blend",
    }
    call = f"""
const job = {{settings: {json.dumps(settings)}, addTask(t) {{ made.push(t); }}}};
compileJob(job);
console.log(JSON.stringify({{made, keys: JOB_TYPE.settings.map(s => s.key)}}));
"""
    done = subprocess.run(
        [node, "-e", stand_in + script + call], capture_output=True, text=True, check=True
    )
    found = json.loads(done.stdout)
    assert set(found["keys"]) == set(settings)
    golden = json.loads((Path(__file__).parent / "flamenco_job.json").read_text())
    assert found["made"] == golden


def test_lines_of_a_shell_and_openjd_name_every_part(farm_scene, tmp_path):
    job = planned_job(farm_scene, tmp_path / "job", tiles=3)
    lines = (job.folder / templates.LINES).read_text().splitlines()
    assert [line.split("--command arto ")[1] for line in lines] == [
        *(f'part {i} --job "$JOB"' for i in range(3)),
        'gather --job "$JOB"',
    ]
    template = json.loads((job.folder / templates.OPENJD).read_text())
    space = template["steps"][0]["parameterSpace"]["taskParameterDefinitions"]
    assert space == [{"name": "Part", "type": "INT", "range": "0-2"}]
    assert template["steps"][1]["dependencies"] == [{"dependsOn": "Parts"}]
    assert (job.folder / templates.FLAMENCO).is_file()
