"""Pooled evidence: what few light paths a pixel show together, and what they must not."""

from __future__ import annotations

import numpy as np
import pytest
from arto.core.capture.moments import Moments
from arto.core.fit.choice import choose
from arto.core.fit.evidence import evidence
from arto.core.fit.pooled import pooled
from arto.core.patterns import monomials, pattern_set
from arto.core.supports import BOX, LINEAR, WHOLE

PATTERNS = pattern_set("moments_uv")
FLAT = (-1e-6, 1e-6, -1e-6, 1e-6)
SHAPE = (40, 40)
PIXELS = SHAPE[0] * SHAPE[1]
COLOUR = np.array([0.3, 0.5, 0.2])


class Seen:
    """Pixels whose patch is met by a random number of paths, each of them in a square of its
    pixel's own middle (2, n) and half width (n,), the correlation of both places being `lean`."""

    def __init__(self, seed: int, paths, middle, half, weight=1.0, lean=0.0) -> None:
        rng = np.random.default_rng(seed)
        count = rng.poisson(np.broadcast_to(paths, PIXELS))
        most = max(1, count.max())
        there = np.arange(most)[:, None] < count
        weights = there * weight * rng.uniform(0.5, 1.5, (most, PIXELS))
        places = rng.uniform(-1, 1, (2, most, PIXELS))
        places[1] = lean * places[0] + np.sqrt(1 - lean * lean) * places[1]
        u, v = middle[:, None] + half * places
        self.basis = np.einsum("kmn,mn->kn", monomials(u, v), weights)[..., None] * COLOUR
        self.sizes = weights.sum(axis=0)
        self.grain = (weights * rng.choice([-1.0, 1.0], weights.shape)).sum(axis=0)

    def moments(self) -> Moments:
        return Moments.from_basis(self.basis, PATTERNS, FLAT)

    def codes(self, samples: float = 64) -> tuple[np.ndarray, dict]:
        """The codes, beside other light that makes up the samples."""
        sizes = np.stack([self.sizes, np.maximum(samples - self.sizes, 0)]).astype(np.float32)
        grain = self.grain.reshape(SHAPE)
        known = evidence(sizes, SHAPE, np.full(2, 4 * np.pi), samples, lambda k: grain)
        coefficient = PATTERNS.coefficient(self.basis)
        return choose("auto", self.basis, coefficient, PATTERNS, known, 0, FLAT)


def anywhere(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0.2, 0.8, (2, PIXELS))


@pytest.mark.parametrize("paths", [2, 20])
@pytest.mark.parametrize("half", [0.02, 0.2])
@pytest.mark.parametrize("lean", [0.0, 0.8])
def test_the_pool_has_no_bias_at_any_number_of_paths(
    paths: float, half: float, lean: float
) -> None:
    """However far the pixels' middles are apart."""
    seen = Seen(1, paths, anywhere(2), np.full(PIXELS, half), lean=lean)
    lit = np.flatnonzero(seen.sizes > 0)
    found = pooled(seen.moments().select(lit), seen.sizes[lit], seen.grain[lit], lit, SHAPE)
    pairs = np.isfinite(found.spread[0])
    # windows that have pairs: their sums scatter about the truth
    weight = found.paths[pairs]
    for variance in found.spread[:2, pairs]:
        assert np.average(variance, weights=weight) == pytest.approx(half**2 / 3, rel=0.15)
    covariance = np.average(found.spread[2, pairs], weights=weight)
    assert covariance / (half**2 / 3) == pytest.approx(lean, abs=0.15)


@pytest.mark.parametrize("paths", [0.2, 1, 3])
def test_few_paths_all_over_a_patch_are_no_box(paths: float) -> None:
    seen = Seen(3, paths, np.full((2, PIXELS), 0.5), np.full(PIXELS, 0.5))
    codes, _ = seen.codes()
    lit = seen.sizes > 0
    assert set(np.unique(codes[lit])) <= {LINEAR.code, WHOLE.code, BOX.code}
    assert (codes[lit] == BOX.code).mean() < 1e-2


def test_a_weak_mirror_image_is_a_box_about_its_own_middle() -> None:
    """Three paths of 64, as a reflection on glass has."""
    middle = anywhere(5)
    seen = Seen(4, 3, middle, np.full(PIXELS, 0.01))
    codes, parameters = seen.codes()
    lit = seen.sizes > 0
    assert (codes[lit] == BOX.code).mean() > 0.99
    here = codes == BOX.code
    u0, u1, v0, v1 = parameters[BOX.code].T
    for (low, high), own in zip(((u0, u1), (v0, v1)), middle[:, here], strict=True):
        assert np.abs((low + high) / 2 - own).max() <= 0.0101
        assert np.median((high - low) / 2) == pytest.approx(0.01, rel=0.3)


def test_a_mirror_does_not_make_mirrors_of_what_lies_beside_it() -> None:
    """Left a mirror, right something matt that the patch gives a twentieth of its light."""
    left = np.arange(PIXELS) % SHAPE[1] < SHAPE[1] // 2
    half = np.where(left, 0.005, 0.5)
    middle = np.where(left, 0.3, 0.5) * np.ones((2, 1))
    seen = Seen(6, np.where(left, 60, 3), middle, half)
    codes, _ = seen.codes()
    assert (codes[left] == BOX.code).all()
    right = ~left & (seen.sizes > 0)
    assert (codes[right] == BOX.code).mean() < 0.01


def test_grain_that_tells_nothing_leaves_a_pixel_to_itself() -> None:
    seen = Seen(7, 3, anywhere(8), np.full(PIXELS, 0.01))
    seen.grain[:] = np.nan
    codes, parameters = seen.codes()
    lit = seen.sizes > 0
    assert (codes[lit] == LINEAR.code).mean() > 0.9
    assert all(np.isfinite(p).all() for p in parameters.values())
