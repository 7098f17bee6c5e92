"""A slanted reflection shows what is along its slant, and nothing of what is beside it."""

from __future__ import annotations

import numpy as np
import pytest
from arto.core.fit.evidence import evidence
from arto.core.fit.lobes import choose_lobes
from arto.core.patterns import LobedSet, pattern_set
from arto.core.supports import BELL, LEANING
from arto.core.supports.leaning import MOST, row_of

FLAT = (-1e-6, 1e-6, -1e-6, 1e-6)
LOBES = pattern_set("lobes")
assert isinstance(LOBES, LobedSet)


def test_a_row_has_the_spread_that_it_was_asked_for() -> None:
    """Mean, variances and covariance, wherever its middles find room on the patch."""
    rng = np.random.default_rng(0)
    half = rng.uniform(0.01, 0.15, (2, 500))
    u, v = rng.uniform(0.4, 0.6, (2, 500))
    slant = rng.uniform(-MOST, MOST, 500)
    row = row_of(np.stack([u, half[0], v, half[1], (slant + 1) / 2], axis=-1))
    middles, halves = row[..., [0, 2]], row[..., [1, 3]]
    np.testing.assert_allclose(middles.mean(axis=1), np.stack([u, v], axis=-1), rtol=1e-9)
    variances = middles.var(axis=1) + (halves**2).mean(axis=1) / 3
    np.testing.assert_allclose(variances, (half**2 / 3).T, rtol=1e-9)
    off = middles - middles.mean(axis=1, keepdims=True)
    covariance = (off[..., 0] * off[..., 1]).mean(axis=1)
    np.testing.assert_allclose(covariance, slant * half[0] * half[1] / 3, atol=1e-12)


def test_a_row_stays_on_the_patch() -> None:
    rng = np.random.default_rng(1)
    row = row_of(rng.random((2000, 5)))
    assert row[..., [0, 2]].min() >= -1e-12 and row[..., [0, 2]].max() <= 1 + 1e-12
    assert (row[..., [1, 3]] >= 0).all()


class Product:
    """Light that is u v, of which the average over a box is the product of its middles."""

    resolutions = (1000,)

    def point(self, k, u, v):
        assert not len(u)
        return np.empty((0, 3))

    def box(self, k, u0, u1, v0, v1):
        return ((u0 + u1) * (v0 + v1) / 4)[:, None].repeat(3, axis=1)


@pytest.mark.parametrize("slant", [-0.9, -0.4, 0.4, 0.9])
def test_light_that_grows_along_the_slant_is_seen_with_the_covariance(slant: float) -> None:
    parameters = np.array([[0.5, 0.2, 0.4, 0.1, (slant + 1) / 2]])
    found = LEANING.average(Product(), 0, parameters)
    np.testing.assert_allclose(found, 0.5 * 0.4 + slant * 0.2 * 0.1 / 3, rtol=1e-9)
    upright = BELL.average(Product(), 0, parameters[:, :4])
    np.testing.assert_allclose(upright, 0.5 * 0.4, rtol=1e-9)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_slanted_line_on_the_patch_is_a_leaning_bell(planted, sign: int) -> None:
    """Of little boxes in a row; a row along u leans nowhere."""
    steps = np.linspace(-0.15, 0.15, 31)
    for slope, code in ((sign, LEANING.code), (0, BELL.code)):
        u, v = 0.5 + steps, 0.5 + slope * steps
        boxes = np.stack([u - 0.01, u + 0.01, v - 0.01, v + 0.01], axis=-1)
        sharp = planted(LOBES.lobes[1], boxes, np.full((31, 3), 0.01), FLAT)
        basis = np.concatenate([np.full((2, 1, 3), 1e-3), sharp.sum(axis=1, keepdims=True)])
        known = evidence(np.full((1, 1), 0.93, np.float32), (1, 1), np.full(1, 4 * np.pi))
        (found,) = choose_lobes(basis, LOBES, known, 0, np.arange(1), FLAT).sharp
        assert found.code == code
        if slope:
            assert 2 * found.parameters[4, 0] - 1 == pytest.approx(sign, abs=0.01)
