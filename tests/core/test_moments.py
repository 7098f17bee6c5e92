"""Moments: boxes that were planted come back, noise does no harm (paper 5)."""

from __future__ import annotations

import numpy as np
import pytest
from arto.core.capture.moments import Moments
from arto.core.hemicube import Hemicube
from arto.core.patterns import UU, VV, U, V, pattern_set
from arto.core.supports import BOX, LINEAR
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

MOMENTS = pattern_set("moments")
seeds = st.integers(0, 2**31)
unit = st.floats(0, 1, allow_subnormal=False)
boxes = st.lists(st.tuples(unit, unit, unit, unit), min_size=1, max_size=20).map(
    lambda rows: np.array([[*sorted(r[:2]), *sorted(r[2:])] for r in rows])
)


@pytest.mark.parametrize("name", ["moments", "moments_uv"])
@given(box=boxes, seed=seeds, exposure=st.floats(-6, 6))
def test_planted_boxes_come_back(planted, flat, name: str, box, seed: int, exposure: float) -> None:
    """In closed form, at any exposure and any colour, points included."""
    r = 10**exposure * np.random.default_rng(seed).uniform(0.01, 1, (len(box), 3))
    moments = Moments.from_basis(planted(pattern_set(name), box, r), pattern_set(name), flat)
    np.testing.assert_allclose(BOX.fit(moments), box, atol=1e-5)
    np.testing.assert_allclose(moments.coefficient, r, rtol=1e-12)
    np.testing.assert_allclose(LINEAR.fit(moments)[:, 0], (box[:, 0] + box[:, 1]) / 2, atol=1e-12)
    np.testing.assert_allclose(LINEAR.fit(moments)[:, 1], (box[:, 2] + box[:, 3]) / 2, atol=1e-12)
    if name == "moments_uv":
        np.testing.assert_allclose(moments.covariance, 0, atol=1e-12)


@given(box=boxes)
def test_boxes_come_back_from_single_precision_images(planted, flat, box) -> None:
    """A render gives float32: a narrow box is then good to the root of its rounding."""
    basis = planted(MOMENTS, box, np.ones((len(box), 3))).astype(np.float32)
    found = BOX.fit(Moments.from_basis(basis, MOMENTS, flat))
    np.testing.assert_allclose(found, box, atol=2 * np.sqrt(3 * 2**-24))


def test_mean_and_variance_are_those_of_the_transport(hits, flat) -> None:
    rng = np.random.default_rng(1)
    u, v = rng.random((2, 50, 9))
    weights = rng.exponential(size=(50, 9, 3))
    moments = Moments.from_basis(
        hits(pattern_set("moments_uv"), u, v, weights), pattern_set("moments_uv"), flat
    )
    w = weights.sum(axis=-1)  # the channels share a support
    for n in range(9):
        covariance = np.cov(u[:, n], v[:, n], aweights=w[:, n], ddof=0)
        assert moments.mean[0][n] == pytest.approx(np.average(u[:, n], weights=w[:, n]))
        assert moments.mean[1][n] == pytest.approx(np.average(v[:, n], weights=w[:, n]))
        assert moments.variance[0][n] == pytest.approx(covariance[0, 0])
        assert moments.variance[1][n] == pytest.approx(covariance[1, 1])
        assert moments.covariance[n] == pytest.approx(covariance[0, 1])


@given(u=st.tuples(unit, unit), v=st.tuples(unit, unit), share=st.floats(0.001, 0.999))
def test_two_hits_never_leave_the_patch(hits, flat, u, v, share: float) -> None:
    """The support of a diffuse pixel that a patch hit twice (docs/measurements.md): its box holds
    the mean of the two, and is cut at the patch and nowhere else."""
    weights = np.array([share, 1 - share])[:, None, None] * np.ones((2, 1, 3))
    basis = hits(MOMENTS, np.array(u)[:, None], np.array(v)[:, None], weights)
    box = BOX.fit(Moments.from_basis(basis, MOMENTS, flat))[0]
    assert (box >= 0).all() and (box <= 1).all()
    for (a, b), (low, high) in zip((u, v), (box[:2], box[2:]), strict=True):
        mean = share * a + (1 - share) * b
        half = np.sqrt(3 * share * (1 - share)) * abs(a - b)
        assert low == pytest.approx(max(mean - half, 0), abs=1e-7)
        assert high == pytest.approx(min(mean + half, 1), abs=1e-7)


@pytest.mark.parametrize("patches", [1, 4, 16])
def test_no_light_means_the_whole_patch(box_moments, patches: int) -> None:
    extent = Hemicube(patches=patches).extent(0)
    moments = Moments.from_basis(np.zeros((5, 3, 3), np.float32), MOMENTS, extent)
    whole = box_moments([[0, 1, 0, 1]], extent)
    np.testing.assert_allclose(moments.normalised[:5], np.tile(whole, 3)[:5], rtol=1e-10)
    np.testing.assert_allclose(BOX.fit(moments), [[0, 1, 0, 1]] * 3, atol=1e-6)


def test_no_light_means_the_whole_patch_where_it_is_flat(flat) -> None:
    moments = Moments.from_basis(np.zeros((5, 3, 3), np.float32), MOMENTS, flat)
    np.testing.assert_allclose(moments.mean, 0.5)
    np.testing.assert_allclose(moments.variance, 1 / 12)
    np.testing.assert_allclose(BOX.fit(moments), [[0, 1, 0, 1]] * 3, atol=1e-12)


@given(seed=seeds, few=st.integers(1, 4))
def test_noise_that_the_patterns_share_gives_no_negative_variance(hits, seed, few: int) -> None:
    """Patterns of one render see the same few paths: their moments are those of the sampled light,
    so the variances need no clipping. With paths of their own they would."""
    rng = np.random.default_rng(seed)
    u, v = rng.random((2, few, 200))
    weights = 10 ** rng.uniform(-3, 3, (few, 200, 3))
    shared = hits(MOMENTS, u, v, weights)

    def raw_variance(basis: np.ndarray) -> np.ndarray:
        m = MOMENTS.moments(basis.sum(axis=-1))
        return np.stack([m[UU] / m[0] - (m[U] / m[0]) ** 2, m[VV] / m[0] - (m[V] / m[0]) ** 2])

    assert raw_variance(shared).min() > -1e-12
    apart = np.stack(
        [
            hits(MOMENTS, *rng.random((2, few, 200)), 10 ** rng.uniform(-3, 3, (few, 200, 3)))[p]
            for p in range(5)
        ]
    )
    assert raw_variance(apart).min() < -0.01


@given(
    basis=hnp.arrays(
        np.float32, (5, 6, 3), elements=st.floats(0, 1e6, width=32, allow_subnormal=False)
    )
)
def test_whatever_the_images_hold_the_support_stays_in_the_patch(basis) -> None:
    """Denoised or photographed patterns need not fit together: the moments are held inside what
    a transport on the patch can have."""
    moments = Moments.from_basis(basis, MOMENTS, Hemicube(patches=1).extent(0))
    for mean, variance in zip(moments.mean, moments.variance, strict=True):
        assert (mean >= 0).all() and (mean <= 1).all()
        assert (variance >= 0).all()
        assert (variance <= mean * (1 - mean) + 1e-12).all()
    box = BOX.fit(moments)
    assert (box >= 0).all() and (box <= 1).all()
    assert (box[:, 0] <= box[:, 1]).all() and (box[:, 2] <= box[:, 3]).all()


def test_the_papers_set_tells_the_mean_and_marks_the_rest(planted, flat) -> None:
    paper = pattern_set("paper")
    box = np.array([[0.1, 0.5, 0.3, 0.4]])
    moments = Moments.from_basis(planted(paper, box, np.ones((1, 3))), paper, flat)
    np.testing.assert_allclose(np.ravel(moments.mean), (0.3, 0.35), atol=1e-9)
    np.testing.assert_allclose(moments.coefficient, 1, atol=1e-9)
    assert np.isnan(moments.normalised[[UU, VV]]).all()
