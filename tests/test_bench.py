"""What the accuracy report makes of its measurements."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bench.made_worlds import MADE
from bench.seconds import (
    ARTO,
    RAW,
    RENDER,
    RENDER_DENOISED,
    STAGE_DENOISED,
    Times,
    Work,
    break_even,
    price,
)
from bench.specks import WORLDS, specks_of

TIMES = Times(
    own=Work(capture=17.8, fit=2.0, relight=0.6, denoised=1.0),
    grid=Work(capture=30.0, fit=3.0, relight=0.4, denoised=0.8),
    stage=Work(capture=20.0, fit=4.0, relight=1.5, denoised=1.9),
    lamps=0.5,
    lamps_a_sample=0.1,
    render=1.0,
    render_a_sample=0.1,
    denoise=0.4,
)
# the denoised render's error falls with the square root of its samples
RIVAL = {8: 0.2, 32: 0.1, 128: 0.05}


def test_break_even_is_where_the_sums_meet() -> None:
    once = TIMES.own.capture + TIMES.own.fit
    # as good as 64 samples: a render takes 7.4 s, a relight 1 s
    error = 0.1 / 2**0.5
    n = break_even(TIMES, once, error, TIMES.own.denoised, RIVAL)
    assert n == 4
    assert once + n * 1.0 <= n * TIMES.render_of(64)
    assert once + (n - 1) * 1.0 > (n - 1) * TIMES.render_of(64)


def test_a_relight_that_costs_more_than_the_render_never_pays() -> None:
    assert break_even(TIMES, 19.8, 0.2, 1.5 + 6.4, RIVAL) is None


def test_a_better_picture_than_any_render_counts_as_the_last() -> None:
    best, last = (break_even(TIMES, 19.8, e, 1.0, RIVAL) for e in (0.01, 0.05))
    assert best == last == 2
    # a render that got worse with more samples needs the fewer of them
    worse = {**RIVAL, 128: 0.15}
    assert break_even(TIMES, 19.8, 0.1, 1.0, worse) == break_even(TIMES, 19.8, 0.1, 1.0, RIVAL)


def test_every_method_is_priced_by_what_it_does() -> None:
    """Its own capture, fit and relight, denoising where it denoises, lamps where it has them."""

    def seconds(*method: object) -> list[float | None]:
        return list(TIMES.cost(*method).values())  # type: ignore[arg-type]

    assert seconds(ARTO, 128, 0) == [17.8, 2.0, 1.0]
    assert seconds(ARTO, 128, 10) == [17.8, 2.0, pytest.approx(2.5)]
    assert seconds(RAW, 128, 0) == [17.8, 2.0, 0.6]
    assert seconds("linear", 128, 0) == [30.0, 3.0, 0.4]
    assert seconds("search", 128, 0) == [30.0, None, 0.4]
    assert seconds("matte", 128, 0) == [30.0, None, None]
    assert seconds(STAGE_DENOISED, 128, 0) == [20.0, 4.0, 1.9]
    assert seconds(RENDER_DENOISED, 32, 0) == [0, 0, pytest.approx(4.2)]
    assert seconds(RENDER, 32, 0) == [0, 0, pytest.approx(3.8)]


def test_rows_get_their_seconds_and_their_break_even() -> None:
    case = {"scene": "a", "hdri": "b", "lamp_samples": 0}
    rows = [
        {**case, "method": RENDER_DENOISED, "samples": n, "mean_relative_error": e}
        for n, e in RIVAL.items()
    ]
    rows.append({**case, "method": ARTO, "samples": 128, "mean_relative_error": 0.1 / 2**0.5})
    price(rows, {"a": TIMES}, 128)
    assert rows[-1]["break_even"] == 4 and "break_even" not in rows[0]
    assert {r["plain_render_seconds"] for r in rows} == {TIMES.render_of(128)}


def test_slopes_are_exponents() -> None:
    """Of pixels and patches; the gain of a second thread in powers of two."""
    from bench.speed import slopes

    at = {"where": "module", "patches": 192}
    rows = [
        {"stage": "fit", "width": w, "height": w, "seconds": 3e-6 * (w * w) ** 1.25} | at
        for w in (64, 128, 512)
    ]
    few = {"stage": "fit", "width": 64, "height": 64, "where": "module", "patches": 48}
    rows.append(few | {"seconds": rows[0]["seconds"] / 4})
    for threads, seconds in ((1, 3.0), (2, 1.5)):
        said = {"stage": "relight sum", "threads": threads, "seconds": seconds}
        rows.append(said | {"width": 64, "height": 64, "where": "module"})
    found = {(r["stage"], r["grows_with"]): r["slope"] for r in slopes(rows)}
    assert found["fit", "pixels"] == pytest.approx(1.25)
    assert found["fit", "patches"] == pytest.approx(1.0)
    assert found["relight sum", "threads"] == pytest.approx(1.0)


def test_a_stage_is_timed_in_a_process_of_its_own(tmp_path: Path) -> None:
    from bench.speed import _run, table
    from bench.speed_stages import Size

    rows = _run("synthetic", Size(48, 27, 16, patches=24), tmp_path)
    stages = {r["stage"] for r in rows}
    assert {"synthetic fit", "field write", "relight sum"} <= stages
    assert all(r["peak_bytes"] > 1 << 26 and r["seconds"] > 0 for r in rows)
    assert "| synthetic fit, 24 patches | 48x27 | module |" in table(rows)
    with pytest.raises(RuntimeError, match="the stage nothing"):
        _run("nothing", Size(48, 27, 16), tmp_path)


def test_a_speck_is_what_the_truth_has_not() -> None:
    """A planted one is found, with its size; an edge that the truth has too is none, and what is
    covered does not count."""
    truth = np.ones((20, 30, 3))
    truth[:, 15:] = 0.4
    bare = np.ones((20, 30), bool)
    found = truth.copy()
    found[8, 5, 1] += 0.3
    assert specks_of(truth, truth, bare) == (0.0, 0)
    over, seen = specks_of(found, truth, bare)
    assert over == pytest.approx(0.3) and seen == 1
    bare[8, 5] = False
    assert specks_of(found, truth, bare) == (0.0, 0)


def test_specks_are_looked_for_in_sixteen_worlds() -> None:
    assert len(set(WORLDS)) == 16
    maps = {name: make() for name, make in MADE.items()}
    assert set(maps) <= set(WORLDS)
    for image in maps.values():
        assert image.shape == (512, 1024, 3) and image.dtype == np.float32
        assert np.isfinite(image).all() and (image >= 0).all() and image.any()
