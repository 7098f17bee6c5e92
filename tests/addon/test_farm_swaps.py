"""Parts of a farm's job that were swapped, copied or damaged are never taken for others."""

from __future__ import annotations

import shutil

import pytest
from arto.arto_addon import work
from arto.arto_addon.farm import part as parts
from arto.arto_addon.farm import templates
from arto.arto_addon.farm.gather import _found, gather
from arto.arto_addon.farm.head import Part
from arto.arto_addon.farm.plan import _make_way
from arto.arto_addon.shot import paths
from arto.core import exr
from arto.core.capture.capture_set import CaptureSet
from arto.core.errors import FarmError, FilesError
from arto.core.field.field import Field
from arto.core.marked import MARK
from arto.core.signed import parsed
from shot_tools import planned_job


@pytest.fixture
def few(farm_scene):
    farm_scene.arto.adaptive = farm_scene.arto.far = False
    farm_scene.arto.samples = 2
    return farm_scene


def render(job, *numbers):
    for number in numbers:
        work.run(parts.render_part(job.folder, number))


def flip(path):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 255
    path.write_bytes(data)


def test_a_blender_without_arto_says_which_part_it_rendered(few, tmp_path):
    job = planned_job(few, tmp_path / "job", tiles=1, seeds=2)
    captured = job.set_of(1, "")
    first, second = job.parts
    blend = work.run(parts.save_part(job.folder, 0))
    assert blend.is_file()
    told = first.note(0, captured.head.key)
    rendered = job.folder / "parts" / first.rendered_name(0)
    # what it renders, without the seconds of a render: light groups by name, and the note
    render(job, 0)
    layers = exr.read(job.part_folder(first) / "tile_0000.exr")
    shutil.rmtree(job.part_folder(first))
    exr.write(rendered, layers, {"Note": told})
    found = _found(job, first, captured)
    assert found and found.files == (rendered.name,)
    copy = job.folder / "parts" / second.rendered_name(0)
    shutil.copy(rendered, copy)
    with pytest.raises(FarmError, match="not of this part"):
        _found(job, second, captured)
    copy.unlink()
    # a name of another form is nobody's part
    shutil.copy(rendered, rendered.with_name("part_0001_00_old.exr"))
    assert _found(job, second, captured) is None
    assert Part(3, -7, 0, 0).rendered_name(1) == "part_0003_01_-0007.exr"


def test_a_damaged_part_is_rendered_again_and_gathered(few, tmp_path):
    job = planned_job(few, tmp_path / "job", tiles=1, seeds=2)
    render(job, 0, 1)
    flip(job.part_folder(job.parts[0]) / "tile_0000.exr")
    before = {p: p.read_bytes() for p in job.folder.rglob("*") if p.is_file()}
    with pytest.raises(FarmError, match="not what was rendered: render part 0 again"):
        work.run(gather(job.folder))
    assert before == {p: p.read_bytes() for p in job.folder.rglob("*") if p.is_file()}
    render(job, 0, 1)
    (folder,) = work.run(gather(job.folder))
    assert Field(folder).about.samples == 4


def test_an_image_that_was_damaged_after_it_was_moved_is_rendered_again(few, tmp_path, monkeypatch):
    job = planned_job(few, tmp_path / "job", tiles=1, seeds=2)
    render(job, 0, 1)
    with monkeypatch.context() as m:
        m.setattr("arto.arto_addon.farm.gather._fit", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            work.run(gather(job.folder))
    flip(job.set_folder(1, "") / job.parts[0].file_name(0))
    with pytest.raises(FarmError, match="render part 0 again"):
        work.run(gather(job.folder))
    render(job, 0)
    (folder,) = work.run(gather(job.folder))
    assert Field(folder).about.samples == 4


def test_kept_images_are_fitted_before_they_take_their_place(few, tmp_path):
    few.arto.keep = "always"
    job = planned_job(few, tmp_path / "job", tiles=1)
    render(job, 0)
    (folder,) = work.run(gather(job.folder))
    captured = CaptureSet(paths.capture_folder(few))
    about = Field(folder).about
    assert captured.kept and captured.open(0) and about.key == captured.head.key
    assert about.shot.scene_id == captured.head.shot.scene_id
    assert not (captured.folder / "field").exists()


def test_frames_that_were_swapped_are_told(few, tmp_path):
    job = planned_job(few, tmp_path / "job", frames=(1, 2), tiles=1)
    one, other = (job.set_folder(frame, "") for frame in (1, 2))
    one.rename(tmp_path / "away")
    other.rename(one)
    (tmp_path / "away").rename(other)
    with pytest.raises(FarmError, match="is of frame 2"):
        job.set_of(1, "")


def test_a_field_of_others_is_found_before_the_parts_are_joined(few, tmp_path):
    job = planned_job(few, tmp_path / "job", tiles=1)
    render(job, 0)
    theirs = paths.place(few).folder / "field"
    theirs.mkdir(parents=True)
    (theirs / MARK).write_text("{")
    with pytest.raises(FilesError, match="not made by ARTO"):
        work.run(gather(job.folder))
    assert job.part_folder(job.parts[0]).is_dir() and not job.set_of(1, "").head.done


def test_a_template_that_was_edited_stays(few, tmp_path):
    job = planned_job(few, tmp_path / "job", tiles=1)
    _make_way(job.folder, [1])
    for name in (templates.OPENJD, templates.LINES, templates.FLAMENCO, templates.WRITTEN):
        path = job.folder / name
        text = path.read_text()
        path.write_text(text + " " if name != templates.WRITTEN else '{"format": "mine"}')
        with pytest.raises(FarmError, match=name):
            templates.check(job.folder)
        path.write_text(text)
    templates.check(job.folder)
    assert parsed((job.folder / templates.WRITTEN).read_text())["format"] == templates.FORMAT
