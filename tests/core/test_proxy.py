"""Blocks, crops and proxies: parts of a field are what the whole says of them."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from arto.core.errors import FieldError
from arto.core.field import tile as field_tile
from arto.core.field.field import Field
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from arto.core.region import Region
from arto.core.relight import relight

CUBE = Hemicube(patches=2)
SHAPE = (22, 17)


@pytest.fixture
def captured(tmp_path: Path, scene, write_scene) -> Path:
    return write_scene(tmp_path / "capture", scene(CUBE, SHAPE))


@pytest.fixture
def light(noisy) -> PatchLight:
    return PatchLight(noisy(3, 64), CUBE)


@pytest.mark.parametrize("choice", ["auto", "linear", "box", "quadratic"])
def test_blocks_change_nothing(
    tmp_path: Path, captured: Path, fitted, light, monkeypatch, choice: str
) -> None:
    """Bit for bit, whatever the number of pixels that a thread adds up at a time."""
    whole = relight(fitted(captured, tmp_path / "one", choice), light)
    monkeypatch.setattr(field_tile, "BLOCK", 40)
    field = fitted(captured, tmp_path / "many", choice)
    assert len(field.tiles[0].blocks) == 10
    np.testing.assert_array_equal(relight(field, light), whole)
    for k in (0, 7, 23):
        pixels = [e.pixels for e in field.tiles[0].entries(k)]
        assert all((np.diff(p) > 0).all() for p in pixels)


@pytest.mark.parametrize("asked", [(0, 0, 17, 22), (3, 5, 6, 4), (16, 21, 1, 1), (0, 10, 17, 2)])
def test_a_crop_is_that_part_of_the_picture(
    tmp_path: Path, scene, write_scene, fitted, light, monkeypatch, asked: tuple[int, ...]
) -> None:
    """Of two tiles, of several blocks each; outside of them it is transparent."""
    monkeypatch.setattr(field_tile, "BLOCK", 40)
    regions = [Region(1, 2, 15, 9), Region(1, 11, 15, 11)]
    folder = write_scene(tmp_path / "c", scene(CUBE, SHAPE), regions)
    field = fitted(folder, tmp_path / "f")
    whole, region = relight(field, light), Region(*asked)
    np.testing.assert_array_equal(relight(field, light, region=region), whole[region.slices])
    assert whole[5:, 3, 3].all() and not whole[0].any()


def test_a_crop_reads_its_blocks_alone(
    tmp_path: Path, captured: Path, fitted, light, monkeypatch
) -> None:
    monkeypatch.setattr(field_tile, "BLOCK", 40)
    field = fitted(captured, tmp_path / "f", "linear")
    read = set()
    real = field_tile.Model.pixels
    monkeypatch.setattr(field_tile.Model, "pixels", lambda m, b, k: read.add(b) or real(m, b, k))
    relight(field, light, region=Region(2, 10, 3, 2))
    assert read == {(10 * 17) // 40, (12 * 17 - 1) // 40} | {5}


def mean_of(picture: np.ndarray, factor: int) -> np.ndarray:
    """Means over squares, cut at the rim."""
    h, w = (-(-side // factor) for side in picture.shape[:2])
    out = np.empty((h, w, *picture.shape[2:]))
    for y in range(h):
        for x in range(w):
            out[y, x] = picture[y * factor :, x * factor :][:factor, :factor].mean(axis=(0, 1))
    return out


@pytest.mark.parametrize("factor", [2, 4, 8])
@pytest.mark.parametrize("choice", ["linear", "whole"])
def test_a_proxy_is_the_mean_of_its_pixels(
    tmp_path: Path, captured: Path, fitted, light, factor: int, choice: str
) -> None:
    """For supports that are moments: to the codes of the field and of the proxy."""
    field = fitted(captured, tmp_path / "f", choice)
    got = relight(field.proxy(factor), light)
    expected = mean_of(relight(field, light), factor)
    # at the rim a pixel of 1/4 is the mean of the two that are there, however much each covers
    inside = tuple(slice(0, side // factor) for side in SHAPE)
    np.testing.assert_allclose(got[inside], expected[inside], rtol=0.03)
    assert np.abs(got[inside] / expected[inside] - 1).mean() < 0.005
    assert field.proxy(factor).about.proxy == factor


def test_a_proxy_of_boxes_is_near(tmp_path: Path, scene, write_scene, fitted, noisy) -> None:
    """What nearly all of its pixels see alike is seen so by the proxy."""
    made = scene(CUBE, SHAPE)
    same = made.basis[..., :1, :1, :] * np.ones((*SHAPE, 1), np.float32)
    folder = write_scene(tmp_path / "c", made._replace(basis=same))
    field = fitted(folder, tmp_path / "f", "box")
    light = PatchLight(noisy(5, 64), CUBE)
    whole, half = relight(field, light, 0)[..., :3], relight(field.proxy(2), light, 0)[..., :3]
    np.testing.assert_allclose(half[:, :-1], mean_of(whole, 2)[:, :-1], rtol=5e-3)
    assert set(field.proxy(2).tiles[0].used) == {"box"}


def test_even_light_gives_a_proxy_all_of_its_pixels(tmp_path: Path, captured: Path, fitted) -> None:
    field = fitted(captured, tmp_path / "f")
    white = PatchLight(Environment.uniform(1.0), CUBE)
    expected = mean_of(relight(field, white), 2)
    np.testing.assert_allclose(relight(field.proxy(2), white), expected, rtol=2e-3)


def test_proxies_of_tiles_and_of_a_region(
    tmp_path: Path, scene, write_scene, fitted, light
) -> None:
    """Tiles that begin with a proxy's pixel have one; others have none of that size."""
    made = scene(CUBE, SHAPE)
    regions = [Region(1, 1, 16, 7), Region(1, 8, 16, 12)]
    field = fitted(write_scene(tmp_path / "c", made, regions), tmp_path / "f", "linear")
    whole, half = relight(field, light), relight(field.proxy(2), light)
    assert half.shape == (11, 9, 4)
    # whole squares of the region
    np.testing.assert_allclose(half[1:10, 1:8], mean_of(whole, 2)[1:10, 1:8], rtol=0.03)
    odd = [Region(0, 0, 17, 6), Region(0, 6, 17, 16)]
    field = fitted(write_scene(tmp_path / "d", made, odd), tmp_path / "g", "linear")
    field.proxy(2)
    with pytest.raises(FieldError, match=r"no proxy of 1/4.*take the field itself"):
        field.proxy(4)


def test_a_field_of_other_models_has_no_proxy(tmp_path: Path, captured: Path, fitted) -> None:
    with pytest.raises(FieldError, match="no proxy"):
        fitted(captured, tmp_path / "f", "quadratic").proxy(2)


def test_a_proxy_is_a_field_of_its_own(tmp_path: Path, captured: Path, fitted, light) -> None:
    field = fitted(captured, tmp_path / "f")
    expected = relight(field.proxy(4), light)
    shutil.copytree(tmp_path / "f" / "proxy_4", tmp_path / "small")
    np.testing.assert_array_equal(relight(Field(tmp_path / "small"), light), expected)
