"""Previews: what is shown of a field at a size is the mean of what it shows whole."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from arto.core.field.field import Field
from arto.core.field.writer import replace_layers
from arto.core.hemicube import Hemicube
from arto.core.light.light import PatchLight
from arto.core.preview import Preview, own_light
from arto.core.relight import relight

CUBE = Hemicube(patches=2)
SHAPE = (24, 32)


@pytest.fixture
def field(tmp_path: Path, scene, write_scene, fitted) -> Field:
    return fitted(write_scene(tmp_path / "capture", scene(CUBE, SHAPE)), tmp_path / "f", "linear")


@pytest.fixture
def light(noisy) -> PatchLight:
    return PatchLight(noisy(3, 64), CUBE)


def _means(picture: np.ndarray, factor: int) -> np.ndarray:
    h, w = picture.shape[:2]
    return picture.reshape(h // factor, factor, w // factor, factor, -1).mean(axis=(1, 3))


def test_whole_is_the_picture(field: Field, light: PatchLight) -> None:
    preview = Preview([field])
    expected = relight(field, light, 0.7)
    np.testing.assert_allclose(
        preview.picture(light, 1, own=0.7), np.maximum(expected, 0), rtol=1e-5, atol=1e-6
    )


@pytest.mark.parametrize("factor", [2, 4, 8])
def test_a_size_is_the_mean_of_the_pixels(field: Field, light: PatchLight, factor: int) -> None:
    """Of moments exactly, but for eight bits of the coefficients."""
    preview = Preview([field])
    assert factor in preview.factors
    found = preview.picture(light, factor)
    expected = _means(relight(field, light), factor)
    assert found.shape == expected.shape
    error = np.abs(found - expected)[..., :3].mean() / expected[..., :3].mean()
    assert error < 0.01


def test_who_has_no_time_gets_a_small_one(field: Field, light: PatchLight) -> None:
    preview = Preview([field])
    assert preview.factor_for(1e9) == 1
    assert preview.factor_for(0.0) == max(preview.factors)
    for factor in preview.factors:
        preview.picture(light, factor)
    preview._seconds = {1: 1.0, 2: 0.2, 4: 0.05, 8: 0.02}
    assert preview.factor_for(0.3) == 2
    assert preview.factor_for(0.04) == 8


def test_gains_of_the_scenes_lamps(field: Field) -> None:
    """Light groups add up to the scene's own light: each is dimmed by itself."""
    rng = np.random.default_rng(1)
    key, fill = (rng.uniform(0, 1, (*SHAPE, 3)).astype(np.float32) for _ in range(2))
    own = key + fill + 0.25
    replace_layers(field, {"own": own, "own_key": key, "own_fill": fill})
    field = Field(field.folder)
    # layers are stored as halves
    near = {"rtol": 2e-3, "atol": 2e-3}
    np.testing.assert_allclose(own_light(field), own, **near)
    np.testing.assert_allclose(own_light(field, 1.0, {"key": 0.0}), fill + 0.25, **near)
    found = own_light(field, 2.0, {"key": 0.5, "fill": 3.0})
    np.testing.assert_allclose(found, 2 * (0.5 * key + 3 * fill + 0.25), **near)
    assert (own_light(field, 1.0, {"key": 0.0, "fill": 0.0}) >= 0).all()
