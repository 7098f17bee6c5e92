"""A field is written whole or not at all: the old one stays until the new one is complete."""

from __future__ import annotations

import errno
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from arto.core.capture.capture_set import CaptureSet
from arto.core.errors import CaptureSetError, FieldError, PatternError
from arto.core.field.field import Field
from arto.core.field.tile_file import TileFileWriter
from arto.core.fit import fit
from arto.core.hemicube import Hemicube
from arto.core.region import Region

CUBE = Hemicube(faces=("top", "back"), patches=2)


@pytest.fixture
def capture(tmp_path: Path, scene, write_scene) -> Path:
    return write_scene(tmp_path / "capture", scene(CUBE))


def contents(folder: Path) -> dict[str, bytes]:
    return {str(f.relative_to(folder)): f.read_bytes() for f in folder.rglob("*") if f.is_file()}


@pytest.mark.parametrize("steps", [0, 1, 4, 9])
def test_a_fit_that_is_stopped_keeps_the_old_field(
    tmp_path: Path, capture: Path, fitted, steps: int
) -> None:
    fitted(capture, tmp_path / "field", "whole")
    before = contents(tmp_path / "field")
    job = fit.fit(CaptureSet(capture), tmp_path / "field", "box")
    for _ in range(steps):
        next(job)
    job.close()
    assert contents(tmp_path / "field") == before
    assert {f.name for f in tmp_path.iterdir()} == {"capture", "field"}
    # and run to its end it is replaced
    assert fitted(capture, tmp_path / "field", "box").about.choice == "box"
    assert {f.name for f in tmp_path.iterdir()} == {"capture", "field"}


def test_a_stopped_first_fit_leaves_nothing(tmp_path: Path, capture: Path) -> None:
    job = fit.fit(CaptureSet(capture), tmp_path / "field")
    next(job), next(job)
    assert not (tmp_path / "field").exists()
    job.close()
    assert {f.name for f in tmp_path.iterdir()} == {"capture"}
    with pytest.raises(FieldError, match="run Fit first"):
        Field(tmp_path / "field")


def test_a_capture_that_breaks_on_the_way_keeps_the_old_field(
    tmp_path: Path, scene, write_scene, fitted
) -> None:
    regions = [Region(0, 0, 8, 3), Region(0, 3, 8, 3)]
    folder = write_scene(tmp_path / "c", scene(CUBE), regions)
    fitted(folder, tmp_path / "field")
    before = contents(tmp_path / "field")
    (folder / "tile_0001.exr").unlink()
    with pytest.raises(CaptureSetError, match=r"tile_0001\.exr"):
        fitted(folder, tmp_path / "field")
    assert contents(tmp_path / "field") == before
    assert not (tmp_path / "field.part").exists()


def test_what_a_crash_left_behind_does_no_harm(tmp_path: Path, capture: Path, fitted) -> None:
    for name in ("field.part", "field.old"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "tile_0000.arto").write_text("half of it")
    fitted(capture, tmp_path / "field")
    assert {f.name for f in tmp_path.iterdir()} == {"capture", "field"}


def test_a_field_that_cannot_take_its_place_leaves_the_old_one(
    tmp_path: Path, capture: Path, fitted, monkeypatch
) -> None:
    fitted(capture, tmp_path / "field")
    before = contents(tmp_path / "field")
    replace: Callable = Path.replace

    def failing(path: Path, to: Path) -> Path:
        if path.name.startswith("field.") and path.suffix == ".part":
            raise PermissionError("in use")
        return replace(path, to)

    monkeypatch.setattr(Path, "replace", failing)
    with pytest.raises(FieldError, match="in use"):
        fitted(capture, tmp_path / "field", "whole")
    assert contents(tmp_path / "field") == before
    assert {f.name for f in tmp_path.iterdir()} == {"capture", "field"}


def test_a_choice_that_the_patterns_cannot_tell_starts_nothing(
    tmp_path: Path, scene, write_scene
) -> None:
    folder = write_scene(tmp_path / "c", scene(CUBE, patterns="paper"))
    for choice, error in (("box", PatternError), ("gauss", FieldError)):
        with pytest.raises(error):
            next(fit.fit(CaptureSet(folder), tmp_path / "field", choice))
    assert {f.name for f in tmp_path.iterdir()} == {"c"}


def test_a_full_disk_keeps_the_old_field(
    tiny_disk: Path, tmp_path: Path, capture: Path, scene, write_scene, fitted
) -> None:
    fitted(capture, tiny_disk / "field")
    before = contents(tiny_disk / "field")
    large = write_scene(tmp_path / "large", scene(CUBE, (80, 80)))
    with pytest.raises(FieldError, match=r"field cannot be written .* make room on the disk"):
        fitted(large, tiny_disk / "field")
    assert contents(tiny_disk / "field") == before
    assert {f.name for f in tiny_disk.iterdir()} == {"field"}


@pytest.mark.parametrize("name", ["peaks", "alpha", "box_parameters"])
def test_a_write_that_fails_keeps_the_old_field(
    tmp_path: Path, capture: Path, fitted, monkeypatch, name: str
) -> None:
    fitted(capture, tmp_path / "field")
    before = contents(tmp_path / "field")
    add: Callable = TileFileWriter.add

    def failing(out: TileFileWriter, array_name: str, array: np.ndarray) -> None:
        if array_name == name:
            raise OSError(errno.ENOSPC, "No space left on device")
        add(out, array_name, array)

    monkeypatch.setattr(TileFileWriter, "add", failing)
    with pytest.raises(FieldError, match=r"No space left on device.*make room"):
        fitted(capture, tmp_path / "field")
    assert contents(tmp_path / "field") == before
    assert {f.name for f in tmp_path.iterdir()} == {"capture", "field"}


def test_a_folder_that_cannot_be_written(read_only: Path, capture: Path) -> None:
    with pytest.raises(FieldError, match=r"cannot be written .* choose a folder that can"):
        next(fit.fit(CaptureSet(capture), read_only / "field"))
