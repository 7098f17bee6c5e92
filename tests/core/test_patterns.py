"""Patterns: what a patch can show, and what the basis images can tell (paper 4.3)."""

from __future__ import annotations

import numpy as np
import pytest
from arto.core.errors import PatternError
from arto.core.patterns import (
    MONOMIALS,
    ONE,
    PATTERN_SETS,
    UU,
    UV,
    VV,
    PatternSet,
    U,
    V,
    monomials,
    pattern_set,
)
from hypothesis import given
from hypothesis import strategies as st

# those of which each channel shows the same; the others are in test_packed
SETS = [s for s in PATTERN_SETS.values() if s.grey]
seeds = st.integers(0, 2**31)


def test_monomials_are_what_their_names_say() -> None:
    values = dict(zip(MONOMIALS, monomials(np.float64(2), np.float64(3)), strict=True))
    assert values == {"1": 1, "u": 2, "u2": 4, "v": 3, "v2": 9, "uv": 6}
    assert monomials(np.zeros((1, 4)), np.zeros((5, 1))).shape == (6, 5, 4)


@pytest.mark.parametrize("patterns", SETS, ids=lambda s: s.name)
def test_a_pattern_can_be_shown_and_uses_the_whole_range(patterns: PatternSet) -> None:
    t = np.linspace(0, 1, 101)
    shown = patterns.radiance(*np.meshgrid(t, t))
    assert shown.shape == (len(patterns), 101, 101)
    assert shown.min() >= -1e-15 and shown.max() <= 1 + 1e-15
    assert len(set(patterns.patterns)) == len(patterns)
    for name, picture in zip(patterns.patterns, shown, strict=True):
        assert picture.max() == pytest.approx(1)
        assert picture.min() == pytest.approx(1 if name == "white" else 0)


def test_the_papers_gradients_are_squared_ramps_along_the_diagonals() -> None:
    """Figure 2: 4 quadratic gradients at 45 + 90 n degrees, bright end there, and inverses."""
    paper = pattern_set("paper")
    assert len(paper) == 9
    bright = {45: (1, 1), 135: (0, 1), 225: (0, 0), 315: (1, 0)}
    t = np.linspace(0, 1, 11)
    u, v = np.meshgrid(t, t)
    shown = dict(zip(paper.patterns, paper.radiance(u, v), strict=True))
    for degrees, (bu, bv) in bright.items():
        ramp = ((u if bu else 1 - u) + (v if bv else 1 - v)) / 2
        np.testing.assert_allclose(shown[f"gradient{degrees}"], ramp**2, atol=1e-15)
        np.testing.assert_allclose(shown[f"inverse{degrees}"], 1 - ramp**2, atol=1e-15)


@pytest.mark.parametrize(
    ("name", "rank", "identified"),
    [
        ("moments", 5, {ONE, U, UU, V, VV}),
        ("moments_uv", 6, {ONE, U, UU, V, VV, UV}),
        ("paper", 5, {ONE, U, V, UV}),
        ("white", 1, {ONE}),
    ],
)
def test_what_a_set_identifies(name: str, rank: int, identified: set[int]) -> None:
    patterns = pattern_set(name)
    assert patterns.rank == rank
    assert {m for m in range(6) if patterns.identified[m]} == identified
    assert patterns.condition >= 1


def test_the_papers_set_sees_the_sum_of_the_spreads_and_never_their_difference() -> None:
    paper, ours = pattern_set("paper"), pattern_set("moments")
    spread_sum, difference = (0, 0, 1, 0, 1, 0), (0, 0, 1, 0, -1, 0)
    assert paper.sees(spread_sum) and not paper.sees(difference)
    assert ours.sees(spread_sum) and ours.sees(difference)


@given(
    half=st.tuples(st.floats(0.01, 0.25), st.floats(0.01, 0.25)),
    centre=st.tuples(st.floats(0.25, 0.75), st.floats(0.25, 0.75)),
)
def test_the_papers_set_cannot_tell_a_box_from_its_quarter_turn(planted, half, centre) -> None:
    """docs/identifiability.md: the Jacobian has rank 4 of 5."""
    (a, b), (mu, mv) = half, centre
    boxes = np.array([[mu - a, mu + a, mv - b, mv + b], [mu - b, mu + b, mv - a, mv + a]])
    paper = planted(pattern_set("paper"), boxes, np.ones((2, 3)))
    np.testing.assert_allclose(paper[:, 0], paper[:, 1], atol=1e-14)
    ours = planted(pattern_set("moments"), boxes, np.ones((2, 3)))
    assert np.abs(ours[:, 0] - ours[:, 1]).max() == pytest.approx(abs(a * a - b * b) / 3, abs=1e-14)


def test_the_papers_jacobian_has_rank_four_of_five(planted) -> None:
    """By differences about a box that is no square: R, centre and two half widths."""

    def jacobian(name: str) -> np.ndarray:
        at, e = np.array([1.3, 0.45, 0.55, 0.3, 0.1]), 1e-6

        def basis(x: np.ndarray) -> np.ndarray:
            r, mu, mv, a, b = x
            box = np.array([[mu - a, mu + a, mv - b, mv + b]])
            return planted(pattern_set(name), box, np.full((1, 3), r))[:, 0, 0]

        steps = np.eye(5) * e
        return np.stack([(basis(at + s) - basis(at - s)) / (2 * e) for s in steps], axis=-1)

    assert np.linalg.matrix_rank(jacobian("paper"), tol=1e-6) == 4
    assert np.linalg.matrix_rank(jacobian("moments"), tol=1e-6) == 5


def test_inverses_add_nothing() -> None:
    paper = pattern_set("paper")
    keep = [i for i, name in enumerate(paper.patterns) if not name.startswith("inverse")]
    assert len(keep) == 5
    without = PatternSet(
        "without",
        tuple(paper.patterns[i] for i in keep),
        tuple(paper.coefficients[i] for i in keep),
    )
    assert without.rank == paper.rank
    assert without.identified == paper.identified
    for row in paper.matrix:
        assert without.sees(row)


@pytest.mark.parametrize("patterns", SETS, ids=lambda s: s.name)
@given(seed=seeds)
def test_moments_of_any_transport_come_back(hits, patterns: PatternSet, seed: int) -> None:
    rng = np.random.default_rng(seed)
    u, v = rng.random((2, 7, 4))
    weights = rng.exponential(size=(7, 4, 3))
    basis = hits(patterns, u, v, weights)
    truth = np.einsum("kmn,mnc->knc", monomials(u, v), weights)
    found = patterns.moments(basis)
    assert found.shape == (6, 4, 3)
    for m in range(6):
        if patterns.identified[m]:
            np.testing.assert_allclose(found[m], truth[m], rtol=1e-9, atol=1e-9)
        else:
            assert np.isnan(found[m]).all()
    np.testing.assert_allclose(patterns.coefficient(basis), weights.sum(axis=0), rtol=1e-9)


@pytest.mark.parametrize("name", ["moments", "paper"])
def test_single_precision_stays_so(name: str) -> None:
    basis = np.ones((len(pattern_set(name)), 2, 3), np.float32)
    assert pattern_set(name).moments(basis).dtype == np.float32
    assert pattern_set(name).coefficient(basis).dtype == np.float32


def test_a_set_that_cannot_tell_says_what_to_do() -> None:
    with pytest.raises(PatternError) as e:
        pattern_set("paper").require((ONE, U, UU, V, VV), "the box")
    says = str(e.value)
    assert "the box needs the moments u2, v2" in says and "'paper' cannot tell" in says
    assert "Capture with the pattern set 'moments' or 'moments_uv' or 'packed', or" in says
    with pytest.raises(PatternError, match="the pattern set 'moments_uv' or 'packed', or choose"):
        pattern_set("moments").require((ONE, UU, UV), "a tilted box")
    pattern_set("moments").require((ONE, U, UU, V, VV), "the box")


def test_wrong_names_and_counts() -> None:
    with pytest.raises(PatternError, match="no pattern set 'stripes': choose one of moments,"):
        pattern_set("stripes")
    with pytest.raises(PatternError, match="'moments' has 5 patterns, not 9"):
        pattern_set("moments").moments(np.ones((9, 2, 3)))
    blind = PatternSet("blind", ("u",), ((0.0, 1.0, 0.0, 0.0, 0.0, 0.0),))
    with pytest.raises(PatternError, match="a reflection coefficient needs the moments 1"):
        blind.coefficient(np.ones((1, 2, 3)))
