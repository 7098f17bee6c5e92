"""Layers: parts of a light that sum to it, and pictures that sum to a picture."""

from __future__ import annotations

import numpy as np
import pytest
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment
from arto.core.light.layers import REST, by_faces, disc, part_of, residual, share_out, shares
from hypothesis import given, settings
from hypothesis import strategies as st


@pytest.fixture
def rng():
    return np.random.default_rng(5)


@pytest.fixture
def world(rng):
    return Environment(rng.exponential(size=(32, 64, 3)).astype(np.float32), turn=0.7)


@pytest.mark.parametrize("faces", [("top",), ("top", "left", "right"), None])
def test_faces_sum_to_what_lights(world, faces):
    cube = Hemicube(faces=faces) if faces else Hemicube()
    masks = by_faces(world, cube)
    assert set(masks) == set(cube.faces)
    total = sum(masks.values())
    assert set(np.unique(total)) <= {0, 1}
    # a face of a cube is a sixth of all directions
    weights = world.row_solid_angles[:, None] / (4 * np.pi)
    for mask in masks.values():
        assert abs(float((mask * weights).sum()) - 1 / 6) < 0.01
    assert abs(float((total * weights).sum()) - len(cube.faces) / 6) < 0.02


def test_disc_is_where_it_is_said_to_be(world):
    """Its middle, its edge, and its solid angle, 2 pi (1 - cos radius); a turned world too."""
    azimuth, elevation, radius = 1.2, 0.4, 0.6
    fine = Environment(np.ones((256, 512, 3), np.float32), world.turn)
    mask = disc(fine, azimuth, elevation, radius, soft=0.2)
    solid = float((mask * fine.row_solid_angles[:, None]).sum())
    assert abs(solid / (2 * np.pi * (1 - np.cos(radius))) - 1) < 0.02
    marked = Environment(np.repeat(mask[..., None], 3, axis=-1), world.turn)
    across = np.cos(elevation)
    middle = (across * np.cos(azimuth), across * np.sin(azimuth), np.sin(elevation))
    assert marked.at(np.array(middle))[0] == 1
    assert marked.at(-np.array(middle))[0] == 0


def test_groups_overlap_and_sum(world, rng):
    """Each takes what those before it left: the parts are the whole, texel by texel."""
    masks = {name: rng.uniform(size=(32, 64)).astype(np.float32) for name in "abc"}
    found = shares(masks)
    assert list(found) == ["a", "b", "c", REST]
    np.testing.assert_allclose(sum(found.values()), 1, atol=1e-6)
    total = sum(part_of(world, share).image for share in found.values())
    np.testing.assert_allclose(total, world.image, rtol=1e-5)
    everything = shares({"all": np.ones((32, 64)), "none": np.ones((32, 64))})
    assert (everything["none"] == 0).all() and (everything[REST] == 0).all()


@settings(max_examples=50)
@given(st.integers(1, 6), st.integers(0, 1000))
def test_shared_out_they_sum_and_none_is_negative(count, seed):
    """Whatever a denoiser made of them: black where light is, light where it is black."""
    rng = np.random.default_rng(seed)
    shape = (7, 5, 3)
    layers = [rng.exponential(size=shape) * (rng.random(shape) > 0.4) - 0.05 for _ in range(count)]
    whole = rng.exponential(size=shape) * (rng.random(shape) > 0.2)
    found = share_out(layers, whole)
    assert residual(found, whole) < 1e-6
    assert all((part >= 0).all() for part in found)
    # what already sums is left alone
    exact = [np.maximum(layer, 0) for layer in layers]
    for one, two in zip(share_out(exact, np.sum(exact, axis=0)), exact, strict=True):
        np.testing.assert_allclose(one, two, rtol=1e-5)


def test_residual_says_how_far_they_are_off():
    one = np.full((2, 2, 3), 0.25)
    assert residual([one, one], np.full((2, 2, 3), 0.5)) == 0
    assert residual([one], np.full((2, 2, 3), 0.5)) == pytest.approx(0.5)
