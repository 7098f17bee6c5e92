"""Folders of photographs as other programs describe them: read, or refused in a sentence."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from arto.core.errors import PhotographsError
from arto.core.photographs import description_file, folder
from arto.core.photographs.description import Description, Kind, Lamp, Photograph


def test_folders_of_other_programs_are_read(tmp_path: Path) -> None:
    for name in ("img 1.jpg", "img 2.jpg", "img 10.jpg", "stone_mask.png", "dark.jpg"):
        (tmp_path / name).write_bytes(b"")
    (tmp_path / "dome.lp").write_text(
        "3\r\nC:\\rti\\img 1.jpg 0 0 1\r\nimg 2.jpg 0.5 0.1 0.9\r\nimg 10.jpg -1e-1 0 1\r\n"
    )
    said = folder.read(tmp_path)
    assert [p.file for p in said.of(Kind.LIGHT)] == ["img 1.jpg", "img 2.jpg", "img 10.jpg"]
    assert said.lamps[2].direction == (-0.1, 0.0, 1.0)
    assert [p.file for p in said.of(Kind.MASK)] == ["stone_mask.png"]
    (tmp_path / "dome.lp").unlink()
    (tmp_path / "light_directions.txt").write_text("0 0 1\n1 0 1\n0 1 1\n")
    (tmp_path / "light_intensities.txt").write_text("1 1 1\n2 2 2\n1 .9 .8\n")
    said = folder.read(tmp_path)
    assert said.lamps[2] == Lamp((0.0, 1.0, 1.0), strength=(1.0, 0.9, 0.8))
    assert said.photographs[2].file == "img 10.jpg"
    (tmp_path / "light_directions.txt").unlink()
    (tmp_path / "lights.csv").write_text(
        "file;azimuth;elevation\nimg 1.jpg;0;0\nimg 2.jpg;90;0\nimg 10.jpg;0;90\n"
    )
    there = [lamp.direction for lamp in folder.read(tmp_path).lamps]
    np.testing.assert_allclose(np.array(there), [[1, 0, 0], [0, 0, 1], [0, 1, 0]], atol=1e-9)


@pytest.mark.parametrize(
    ("lights", "listed"),
    [
        ("2\n0 0 1 2\n1 0 1 1\n", "3\nb.0.tga\nb.1.tga\nb.mask.tga\n"),
        ("b.1.tga 1 0 1 1\nb.0.tga 0 0 1 2\n", ""),
        ("0, 0, 1, 2, 2, 2\n1, 0, 1, 1, 1, 1\n", ""),
    ],
)
def test_lists_of_photometric_stereo_are_read(tmp_path: Path, lights: str, listed: str) -> None:
    for name in ("b.0.tga", "b.1.tga", "b.mask.tga", "Normal_gt.png"):
        (tmp_path / name).write_bytes(b"")
    (tmp_path / "lights.txt").write_text(lights)
    if listed:
        (tmp_path / "b.txt").write_text(listed)
    said = folder.read(tmp_path)
    lit = {p.file: said.lamps[p.lamp or 0] for p in said.of(Kind.LIGHT)}
    assert lit == {
        "b.0.tga": Lamp((0.0, 0.0, 1.0), strength=(2.0, 2.0, 2.0)),
        "b.1.tga": Lamp((1.0, 0.0, 1.0)),
    }
    assert [p.file for p in said.of(Kind.MASK)] == ["b.mask.tga"]


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("2\na.jpg 0 0 1\nmissing.jpg 0 1 1\n", "names 'missing.jpg'"),
        ("2\na.jpg 0 0 1\na.jpg 0 1 1\n", "'a.jpg' is there twice"),
        ("2\na.jpg 0 0 1\nb.jpg 0 0 0\n", "'b.jpg' has length 0"),
        ("3\na.jpg 0 0 1\nb.jpg 0 1 0\n", "says that it has 3 photographs, and has 2"),
        ("2\na.jpg 0 0 1\nb.jpg 0 nan 0\n", "a word that is no number"),
        ("a.jpg 0 0 1\n", "does not begin with the number"),
    ],
)
def test_a_bad_lp_file_is_a_sentence(tmp_path: Path, text: str, error: str) -> None:
    for name in ("a.jpg", "b.jpg"):
        (tmp_path / name).write_bytes(b"")
    (tmp_path / "dome.lp").write_text(text)
    with pytest.raises(PhotographsError, match=error):
        folder.read(tmp_path)


def test_a_description_is_kept_as_a_file(tmp_path: Path) -> None:
    said = Description(
        (Photograph("a.jpg", Kind.LIGHT, lamp=0, exposure=0.5),),
        (Lamp((0.0, 0.0, 1.0)),),
        white=(1, 2, 3, 4),
        ball=(1.0, 2.0, 3.0),
        curve="sRGB",
        view="down",
    )
    description_file.write(tmp_path, said)
    assert description_file.read(tmp_path / "photographs.json") == said
    with pytest.raises(PhotographsError, match=r"'photographs\[0\].file' cannot be '../out.jpg'"):
        bad = replace(said, photographs=(Photograph("../out.jpg", Kind.LIGHT, lamp=0),))
        description_file.from_json(bad.to_json(), tmp_path)
