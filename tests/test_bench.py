"""What the accuracy report makes of its measurements."""

from __future__ import annotations

import pytest

from bench.accuracy import Times, break_even

TIMES = Times(
    capture=17.8,
    fit=2.0,
    relight=1.0,
    lamps=0.5,
    lamps_a_sample=0.1,
    render=1.0,
    render_a_sample=0.1,
    stage=20.0,
)
# the denoised render's error falls with the square root of its samples
RIVAL = {8: 0.2, 32: 0.1, 128: 0.05}


def test_break_even_is_where_the_sums_meet() -> None:
    once = TIMES.capture + TIMES.fit
    assert once == pytest.approx(19.8)
    # as good as 64 samples: a render takes 7.4 s, a relight 1 s
    error = 0.1 / 2**0.5
    n = break_even(TIMES, once, error, TIMES.relight_of(0), RIVAL)
    assert n == 4
    assert once + n * 1.0 <= n * TIMES.render_of(64)
    assert once + (n - 1) * 1.0 > (n - 1) * TIMES.render_of(64)


def test_a_relight_that_costs_more_than_the_render_never_pays() -> None:
    assert break_even(TIMES, 19.8, 0.2, TIMES.relight_of(64), RIVAL) is None


def test_a_better_picture_than_any_render_counts_as_the_last() -> None:
    best, last = (break_even(TIMES, 19.8, e, 1.0, RIVAL) for e in (0.01, 0.05))
    assert best == last == 2
    # a render that got worse with more samples needs the fewer of them
    worse = {**RIVAL, 128: 0.15}
    assert break_even(TIMES, 19.8, 0.1, 1.0, worse) == break_even(TIMES, 19.8, 0.1, 1.0, RIVAL)


def test_lamps_are_paid_for_by_the_relights_that_have_them() -> None:
    assert TIMES.relight_of(0) == 1.0
    assert TIMES.relight_of(10) == pytest.approx(2.5)
