"""A field in one piece shows what it shows in tiles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from arto.core.field.field import Field
from arto.core.field.merged import MergedTile, merged
from arto.core.hemicube import Hemicube
from arto.core.light.light import PatchLight
from arto.core.region import Region
from arto.core.relight import relight

CUBE = Hemicube(patches=2)
SHAPE = (30, 16)
STRIPS = [Region(0, y, 16, h) for y, h in ((0, 7), (7, 8), (15, 8), (23, 7))]


def _field(tmp_path: Path, scene, write_scene, fitted, regions, choice="box") -> Field:
    made = write_scene(tmp_path / "capture", scene(CUBE, SHAPE), regions)
    return fitted(made, tmp_path / "field", choice)


@pytest.mark.parametrize("choice", ["box", "linear", "whole"])
def test_a_picture_in_one_piece(tmp_path, scene, write_scene, fitted, noisy, choice) -> None:
    field = _field(tmp_path, scene, write_scene, fitted, STRIPS, choice)
    one = merged(field)
    assert len(field.tiles) == 4 and len(one.tiles) == 1
    assert isinstance(one.tiles[0], MergedTile)
    for seed in (1, 2):
        light = PatchLight(noisy(seed, 32), CUBE)
        np.testing.assert_array_equal(relight(one, light, 0.5), relight(field, light, 0.5))
    np.testing.assert_array_equal(one.layer("own"), field.layer("own"))


def test_what_is_too_small_to_be_an_entry_is_there_too(
    tmp_path, scene, write_scene, fitted, noisy
) -> None:
    """It is 2e-5 of the light here. All tiles weigh its patches alike in one piece, where each had
    weights of its own: next to none of it is off."""
    made = scene(CUBE, SHAPE)
    dim = np.random.default_rng(1).random(made.basis[:, :1].shape) < 0.5
    made = made._replace(basis=np.where(dim, np.float32(1e-4), np.float32(1)) * made.basis)
    field = fitted(write_scene(tmp_path / "capture", made, STRIPS), tmp_path / "field", "auto")
    light = PatchLight(noisy(1, 32), CUBE)
    expected, found = relight(field, light)[..., :3], relight(merged(field), light)[..., :3]
    assert np.abs(found - expected).mean() < 1e-6 * expected.mean()


def test_a_part_of_it(tmp_path, scene, write_scene, fitted, noisy) -> None:
    one = merged(_field(tmp_path, scene, write_scene, fitted, STRIPS))
    light = PatchLight(noisy(1, 32), CUBE)
    asked = Region(3, 5, 9, 20)
    whole = relight(one, light)
    np.testing.assert_allclose(relight(one, light, region=asked), whole[asked.slices], rtol=1e-5)


def test_tiles_that_are_not_below_each_other_stay(tmp_path, scene, write_scene, fitted) -> None:
    beside = [Region(0, 0, 8, 30), Region(8, 0, 8, 30)]
    field = _field(tmp_path, scene, write_scene, fitted, beside)
    assert merged(field) is field
    gap = [Region(0, 0, 16, 10), Region(0, 12, 16, 18)]
    field = _field(tmp_path / "gap", scene, write_scene, fitted, gap)
    assert merged(field) is field
