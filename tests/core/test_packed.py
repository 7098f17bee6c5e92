"""Patterns packed into colour channels: what was planted comes back in any colour that tells it."""

from __future__ import annotations

import numpy as np
import pytest
from arto.core.capture.moments import Moments
from arto.core.errors import PatternError
from arto.core.fit.choice import check
from arto.core.measure import uniform_moments
from arto.core.patterns import ONE, UU, UV, VV, U, V, monomials, pattern_set
from arto.core.supports import BOX, LINEAR
from hypothesis import given
from hypothesis import strategies as st

PACKED, ALL = pattern_set("packed"), pattern_set("moments_uv")
FLAT = (-1e-6, 1e-6, -1e-6, 1e-6)
EVEN = uniform_moments(FLAT)
seeds = st.integers(0, 2**31)
unit = st.floats(0, 1, allow_subnormal=False)
boxes = st.lists(st.tuples(unit, unit, unit, unit), min_size=1, max_size=20).map(
    lambda rows: np.array([[*sorted(r[:2]), *sorted(r[2:])] for r in rows])
)


def shown(u: np.ndarray, v: np.ndarray, lit: np.ndarray) -> np.ndarray:
    """What the packed patterns emit at (u, v), where a grain is lit or not -> (3, 3, ...)."""
    one, du, uu, dv, vv, uv = monomials(u, v)
    return np.stack([[one, one, one], [du, dv, lit], [uu, vv, uv]])


def images(u: np.ndarray, v: np.ndarray, weights: np.ndarray, lit: np.ndarray) -> np.ndarray:
    """Basis images (3, n, 3) of paths that end at (u, v), (m, n), with weights (m, n, 3)."""
    return np.einsum("pcmn,mnc->pnc", shown(u, v, lit), weights)


def paths(boxes: np.ndarray, colour: np.ndarray) -> np.ndarray:
    """Images of transports that see boxes evenly, by four places of a Gauss rule a side."""
    at, weight = np.polynomial.legendre.leggauss(4)
    at, weight = (at + 1) / 2, weight / 2
    u0, u1, v0, v1 = boxes.T
    u = (u0 + (u1 - u0) * at[:, None, None]) + 0 * at[:, None]
    v = (v0 + (v1 - v0) * at[:, None]) + 0 * at[:, None, None]
    w = (weight[:, None] * weight)[..., None] * np.ones(len(boxes))
    flat = [x.reshape(16, -1) for x in (u, v, w)]
    return images(flat[0], flat[1], flat[2][..., None] * colour, np.zeros(flat[0].shape))


def test_the_set_says_what_it_shows() -> None:
    assert PACKED.rank == 6 and all(PACKED.identified) and PACKED.condition >= 1
    assert not PACKED.grey and PACKED.shown_by == (0,) and len(PACKED) == 3
    rows = [PACKED.emission(name) for name in PACKED.patterns]
    assert rows[1][2] is None  # the grains
    u, v = np.random.default_rng(0).random((2, 9))
    expected = shown(u, v, np.zeros(9))
    for p, channels in enumerate(rows):
        for c, row in enumerate(channels):
            if row is not None:
                np.testing.assert_allclose(np.array(row) @ monomials(u, v), expected[p, c])


@given(box=boxes, seed=seeds, exposure=st.floats(-6, 6))
def test_a_planted_box_of_any_coloured_material_comes_back(box, seed: int, exposure) -> None:
    rng = np.random.default_rng(seed)
    colour = 10**exposure * rng.uniform(1e-3, 1, (len(box), 3))
    moments = Moments.from_basis(paths(box, colour), PACKED, FLAT)
    np.testing.assert_allclose(BOX.fit(moments), box, atol=1e-5)
    np.testing.assert_allclose(moments.coefficient, colour, rtol=1e-9)
    np.testing.assert_allclose(moments.covariance, 0, atol=1e-9)
    single = Moments.from_basis(paths(box, colour).astype(np.float32), PACKED, FLAT)
    np.testing.assert_allclose(BOX.fit(single), box, atol=2 * np.sqrt(3 * 2**-23))


@given(seed=seeds)
def test_moments_are_those_of_six_patterns_where_the_channels_share_a_transport(seed: int) -> None:
    rng = np.random.default_rng(seed)
    u, v = rng.random((2, 7, 4))
    weights = rng.exponential(size=(7, 4, 1)) * rng.uniform(0.01, 1, (4, 3))
    truth = np.einsum("kmn,mnc->knc", monomials(u, v), weights)
    found = PACKED.shared(images(u, v, weights, np.zeros(u.shape)), EVEN)
    np.testing.assert_allclose(found, truth.sum(axis=-1), rtol=1e-9)


@given(seed=seeds, scale=st.floats(1e-3, 1e3))
def test_images_of_one_transport_add_up(seed: int, scale: float) -> None:
    """Twice the light has twice the moments, and two lots of paths have the sum of both."""
    rng = np.random.default_rng(seed)
    u, v = rng.random((2, 6, 3))
    weights = rng.exponential(size=(6, 3, 1)) * rng.uniform(0.01, 1, (3, 3))
    lit = rng.integers(0, 2, u.shape)
    whole = images(u, v, weights, lit)
    halves = [images(u[s], v[s], weights[s], lit[s]) for s in (slice(0, 2), slice(2, 6))]
    apart = sum(PACKED.shared(h, EVEN) for h in halves)
    np.testing.assert_allclose(PACKED.shared(whole, EVEN), apart, rtol=1e-9)
    np.testing.assert_allclose(PACKED.shared(scale * whole, EVEN), scale * apart, rtol=1e-9)
    grains = sum(PACKED.grains(h) for h in halves)
    np.testing.assert_allclose(PACKED.grains(whole), grains, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    ("colour", "told"),
    [
        ((1, 0, 0), {U, UU}),
        ((0, 1, 0), {V, VV}),
        ((0, 0, 1), set()),
        ((1, 1, 0), {U, UU, V, VV}),
    ],
)
def test_a_channel_without_light_leaves_the_whole_patch(colour, told: set[int]) -> None:
    box = np.array([[0.1, 0.2, 0.7, 0.9]])
    moments = Moments.from_basis(paths(box, np.array([colour], float)), PACKED, FLAT).normalised
    plain = {U: 0.15, V: 0.8, UU: 0.15**2 + 0.01 / 12, VV: 0.8**2 + 0.04 / 12}
    for m, value in plain.items():
        expected = value if m in told else EVEN[m]
        assert moments[m, 0] == pytest.approx(expected, rel=1e-9), m
    # nothing tells the tilt, so there is none
    assert moments[UV, 0] == pytest.approx(moments[U, 0] * moments[V, 0])
    assert moments[ONE, 0] == 1


def test_darkness_is_the_whole_patch() -> None:
    moments = Moments.from_basis(np.zeros((3, 2, 3)), PACKED, FLAT)
    np.testing.assert_allclose(LINEAR.fit(moments), 0.5)
    assert np.isnan(PACKED.grains(np.zeros((3, 2, 3)))).all()


def test_grains_have_the_noise_of_the_light() -> None:
    """Their square is, on average, the sum of the squares of the paths' weights."""
    rng = np.random.default_rng(1)
    weights = rng.exponential(size=(5, 20000, 1)) * np.array([0.2, 0.7, 0.1])
    u, v = rng.random((2, 5, 20000))
    grains = PACKED.grains(images(u, v, weights, rng.integers(0, 2, u.shape)))
    squares = np.square(weights.sum(axis=-1)).sum(axis=0)
    assert np.square(grains).mean() == pytest.approx(squares.mean(), rel=0.03)
    assert abs(grains.mean()) < 0.03 * np.sqrt(squares.mean())


def test_what_packed_patterns_cannot_do_says_so() -> None:
    check("auto", PACKED)
    for name in ("box", "gaussian", "double", "stage_and_matte"):
        check(name, PACKED)
    with pytest.raises(PatternError, match="turn Per Channel off"):
        check("auto", PACKED, separate=True)
    with pytest.raises(PatternError, match="the same in all channels"):
        check("search", PACKED)
    with pytest.raises(PatternError, match="something else in each channel"):
        _ = PACKED.matrix
    with pytest.raises(PatternError, match="'packed' has 3 patterns, not 6"):
        PACKED.shared(np.ones((6, 2, 3)), EVEN)
    with pytest.raises(PatternError, match="of each channel's own"):
        PACKED.moments(np.ones((3, 2)))
    assert ALL.grains(np.ones((6, 2, 3))) is None
