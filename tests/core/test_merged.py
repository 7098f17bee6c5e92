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
        expected, found = relight(field, light, 0.5), relight(one, light, 0.5)
        # but for what was too small to be an entry, which all tiles weigh alike now
        error = np.abs(found - expected)[..., :3].mean() / expected[..., :3].mean()
        assert error < 1e-3
        np.testing.assert_array_equal(found[..., 3], expected[..., 3])
    np.testing.assert_array_equal(one.layer("own"), field.layer("own"))


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
