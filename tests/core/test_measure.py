"""Light on a patch counts by solid angle: its uniform transport and its boxes, wherever it is."""

from __future__ import annotations

import numpy as np
import pytest
from arto.core.hemicube import Hemicube
from arto.core.measure import box_of, uniform_moments
from arto.core.patterns import UU, VV, U, V

# A corner patch of 4x4 and of 2x2, a middle one, a whole face, half a side.
EXTENTS = {
    "corner of 4x4": (-1.0, -0.5, -1.0, -0.5),
    "corner of 2x2": (-1.0, 0.0, -1.0, 0.0),
    "middle of 16x16": (0.0, 0.125, 0.0, 0.125),
    "face": (-1.0, 1.0, -1.0, 1.0),
    "half a side": (-1.0, 1.0, 0.0, 1.0),
}

# So small that area is solid angle.
FLAT = (-1e-6, 1e-6, -1e-6, 1e-6)


def seen(extent, boxes, side=400):
    """Means and variances of light uniform in solid angle over boxes, by many small cells."""
    t = (np.arange(side) + 0.5) / side
    found = []
    for u0, u1, v0, v1 in boxes:
        u, v = np.meshgrid(u0 + (u1 - u0) * t, v0 + (v1 - v0) * t)
        x, y = extent[0] + (extent[1] - extent[0]) * u, extent[2] + (extent[3] - extent[2]) * v
        d = np.stack([x, y, np.ones_like(x)], axis=-1)
        weight = 1 / np.linalg.norm(d, axis=-1) ** 3  # cosine over distance squared
        weight /= weight.sum()
        means = [(weight * w).sum() for w in (u, v)]
        found.append(
            [*means, *((weight * (w - m) ** 2).sum() for w, m in zip((u, v), means, strict=True))]
        )
    mu, mv, vu, vv = np.array(found).T
    return (mu, mv), (vu, vv)


@pytest.mark.parametrize("name", EXTENTS)
def test_uniform_transport(name):
    extent = EXTENTS[name]
    found = uniform_moments(extent)
    (mu, mv), (vu, vv) = seen(extent, [(0, 1, 0, 1)], 2000)
    np.testing.assert_allclose(found[[U, V]], [mu[0], mv[0]], atol=1e-7)
    np.testing.assert_allclose(found[[UU, VV]], [vu[0] + mu[0] ** 2, vv[0] + mv[0] ** 2], atol=1e-7)
    # more points change nothing
    nodes, weights = np.polynomial.legendre.leggauss(200)
    t, w = (nodes + 1) / 2, weights / 2
    x = extent[0] + (extent[1] - extent[0]) * t
    y = extent[2] + (extent[3] - extent[2]) * t
    weight = (1 + x[:, None] ** 2 + y**2) ** -1.5 * np.outer(w, w)
    assert found[U] == pytest.approx((weight * t[:, None]).sum() / weight.sum(), abs=1e-10)


def test_what_is_said_of_it():
    """0.544 is the mirror of 0.456: a corner patch is seen nearer to the face's middle."""
    assert 1 - uniform_moments(EXTENTS["corner of 4x4"])[U] == pytest.approx(0.456, abs=5e-4)
    assert 1 - uniform_moments(EXTENTS["corner of 2x2"])[U] == pytest.approx(0.426, abs=5e-4)
    np.testing.assert_allclose(uniform_moments(FLAT), [1, 1 / 2, 1 / 3, 1 / 2, 1 / 3, 1 / 4])
    cube = Hemicube(patches=4)
    np.testing.assert_allclose(cube.uniform_moments(0), uniform_moments(cube.extent(0)))


@pytest.mark.parametrize("name", EXTENTS)
def test_a_planted_box_comes_back(name):
    rng = np.random.default_rng(1)
    extent = EXTENTS[name]
    size = rng.uniform(0.01, 0.98, (60, 2))
    low = rng.uniform(0, 1 - size)
    boxes = np.stack([low[:, 0], low[:, 0] + size[:, 0], low[:, 1], low[:, 1] + size[:, 1]], -1)
    mean, variance = seen(extent, boxes)
    found = box_of(mean, variance, extent)
    np.testing.assert_allclose(found, boxes, atol=1e-4)
    # by area it would be off by much more, on all but small patches
    if name not in ("middle of 16x16",):
        assert np.abs(box_of(mean, variance, FLAT) - boxes).max() > 5e-3


def test_points_and_rims():
    """A point is a box without width; what is spread wider than any box is cut at the patch."""
    extent = EXTENTS["corner of 2x2"]
    point = box_of((np.array([0.3]), np.array([0.9])), (np.zeros(1), np.zeros(1)), extent)
    np.testing.assert_allclose(point, [[0.3, 0.3, 0.9, 0.9]], atol=1e-12)
    rims = box_of((np.array([0.5]), np.array([0.5])), (np.full(1, 0.25), np.full(1, 0.25)), extent)
    assert np.isfinite(rims).all() and rims.min() >= 0 and rims.max() <= 1
