"""Bins of a map on the patches: where they lie, and that they are worked out once (paper 6)."""

from __future__ import annotations

import numpy as np
import pytest
from arto.core.hemicube import Hemicube
from arto.core.light.bins import bin_coordinate, default_resolution
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from hypothesis import strategies as st

seeds = st.integers(0, 2**31)


def test_bins_lie_where_their_centres_say() -> None:
    cube = Hemicube(patches=3, half_sides=True)
    light = PatchLight(Environment.uniform(), cube, resolution=7)
    for k in range(len(cube)):
        u, v = light.bin_centres(k)
        for axis, t in enumerate((u, v)):
            np.testing.assert_allclose(
                bin_coordinate(cube, k, t, axis, 7), np.arange(7) + 0.5, atol=1e-12
            )
        # equal in angle: steps between neighbours' directions along the face's middle line
        x = cube.extents[k]
        angle = np.arctan(x[0] + (x[1] - x[0]) * u)
        np.testing.assert_allclose(np.diff(angle), np.diff(angle)[0])


def test_a_map_of_another_size_or_cube_is_not_mistaken(noisy, monkeypatch) -> None:
    """The samples' bins are kept between maps of one size; those of another must not be used."""
    cubes = [Hemicube(patches=2), Hemicube(patches=2, half_sides=True), Hemicube(patches=3)]
    maps = [noisy(0, 16), noisy(1, 16), noisy(2, 32), Environment(noisy(2, 32).image[::2])]
    found = [[PatchLight(e, cube, r).binned for r in (4, 8)] for cube in cubes for e in maps]
    again = iter(found)
    for cube in cubes:
        for e in maps:
            for binned, r in zip(next(again), (4, 8), strict=True):
                monkeypatch.setattr("arto.core.light.bins._KEPT", {})
                np.testing.assert_array_equal(binned, PatchLight(e, cube, r).binned)


@pytest.mark.parametrize("texels", [1, 5.5, -3, 17.25])
def test_a_turned_map_is_the_map_with_its_columns_moved(noisy, texels: float) -> None:
    """To the digit where columns move as a whole; else what the light is that the map shows."""
    cube, width = Hemicube(patches=3), 128
    turn = texels / width * 2 * np.pi
    if texels % 1 == 0:
        image = noisy(4, 64).image
        found = PatchLight(Environment(image, turn), cube)
        expected = PatchLight(Environment(np.roll(image, int(texels), axis=1)), cube)
        np.testing.assert_allclose(found.binned, expected.binned, rtol=1e-6)
        return

    def light(columns: np.ndarray) -> np.ndarray:
        row = 2 + np.cos(columns / width * 2 * np.pi) + np.sin(columns / width * 6 * np.pi)
        return np.tile(row[:, None].astype(np.float32), (64, 1, 3))

    columns = np.arange(width) + 0.5
    found = PatchLight(Environment(light(columns), turn), cube)
    expected = PatchLight(Environment(light(columns - texels)), cube)
    np.testing.assert_allclose(found.whole, expected.whole, rtol=0.01)


def test_the_bins_of_a_large_map_are_worked_out_in_blocks(noisy, monkeypatch) -> None:
    """They are not kept, and no array of all its samples is made: the light is the same to the
    order of a sum, which is that of the rows in both."""
    from arto.core.light import bins

    cube, environment = Hemicube(patches=3), noisy(4, 64)
    whole = PatchLight(environment, cube)
    assert len(bins._KEPT) == 1
    sizes = []
    real = PatchLight._collect
    monkeypatch.setattr(
        PatchLight,
        "_collect",
        lambda s, t, some, turn: sizes.append(some.bins.size) or real(s, t, some, turn),
    )
    monkeypatch.setattr(bins, "BLOCK", 3000)
    monkeypatch.setattr(bins, "KEPT", 0)
    monkeypatch.setattr(bins, "_KEPT", {})
    found = PatchLight(environment, cube).binned
    np.testing.assert_allclose(found, whole.binned, rtol=1e-12)
    assert max(sizes) <= 3000 and sum(sizes) == 64 * 128 * 4 and not bins._KEPT


def test_default_resolution_is_about_a_texel_a_bin() -> None:
    assert set(default_resolution(Hemicube(patches=4), Environment.uniform(1, 512))) == {64}
    assert set(default_resolution(Hemicube(patches=16), Environment.uniform(1, 8))) == {4}
