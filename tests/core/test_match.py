"""A light that was hidden is found again from its picture; what no light makes is told."""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path

import numpy as np
import pytest
from arto.core.errors import TargetError
from arto.core.field.field import Field
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from arto.core.match import ask, gains
from arto.core.match.answers import Answers
from arto.core.match.cells import Cells
from arto.core.match.match import Matched, free_light
from arto.core.match.solve import nonnegative
from arto.core.match.target import Target, fitting
from arto.core.preview import Preview
from arto.core.relight import relight
from numpy.typing import NDArray

CUBE = Hemicube(patches=2)
SHAPE = (24, 32)


def done(work: Generator[float, None, Matched]) -> Matched:
    last = 0.0
    while True:
        try:
            share = next(work)
            assert last <= share <= 1
            last = share
        except StopIteration as e:
            return e.value


def sky(seed: int) -> Environment:
    """A few soft lamps over a dim ground."""
    rng = np.random.default_rng(seed)
    cells = Cells(CUBE, np.full(len(CUBE), 2))
    radiance = np.full((cells.count, 3), 0.1)
    radiance[rng.integers(0, cells.count, 12)] = rng.uniform(1, 8, (12, 3))
    return cells.environment(radiance, 64)


@pytest.fixture(scope="module")
def field(tmp_path_factory: pytest.TempPathFactory, scene, write_scene, fitted) -> Field:
    folder: Path = tmp_path_factory.mktemp("match")
    made = scene(CUBE, SHAPE)._replace(alpha=np.ones(SHAPE, np.float32))
    return fitted(write_scene(folder / "capture", made), folder / "f", "box")


@pytest.fixture(scope="module")
def answers(field: Field) -> Answers:
    return Answers.of(Preview([field]), 150)


def shown(field: Field, light: Environment, own: float = 1.0) -> NDArray:
    return relight(field, PatchLight(light, CUBE), own)[..., :3].astype(float)


def asked(answers: Answers, picture: NDArray) -> Target:
    return Target(answers.columns(picture), answers.sizes * answers.solid)


def test_the_matrix_shows_what_a_relight_shows(field: Field, answers: Answers) -> None:
    light = sky(1)
    expected = answers.columns(shown(field, light, own=0.0))
    found = answers.under(light)
    assert np.abs(found - expected).mean() < 0.08 * expected.mean()


def test_a_hidden_light_comes_back(field: Field, answers: Answers) -> None:
    hidden, start = sky(1), sky(2)
    target = asked(answers, shown(field, hidden))
    found = done(free_light(answers, start, target, answers.layer("own")))
    assert found.error < 0.06
    assert found.before > 0.4
    assert not found.missing.told
    light = found.environment
    assert light is not None and light.image.min() >= 0
    across = np.maximum(answers.cells.middles @ answers.cells.middles.T, 0)
    true, got = (across @ answers.cells.radiance(e) for e in (hidden, light))
    assert np.abs(got - true).mean() < 0.1 * true.mean()


@pytest.mark.newest
def test_near_keeps_the_present_light(field: Field, answers: Answers) -> None:
    hidden, start = sky(1), sky(2)
    target = asked(answers, shown(field, hidden))
    own = answers.layer("own")
    have, want = (answers.cells.radiance(light) for light in (start, hidden))
    apart = []
    for near in (0.0, 0.5, 1.0):
        light = done(free_light(answers, start, target, own, near)).environment
        assert light is not None
        apart.append(float(np.abs(answers.cells.radiance(light) - have).mean()))
    assert apart[0] > apart[1] > apart[2]
    assert apart[2] < 0.02 * float(np.abs(want - have).mean())


@pytest.mark.newest
@pytest.mark.parametrize("balance", [False, True])
def test_a_cast_is_light_or_white_balance(field: Field, answers: Answers, balance: bool) -> None:
    light, cast = sky(1), np.array([1.5, 1.0, 0.6])
    # without the own lamps, whose light in the picture has the cast as well
    target = asked(answers, shown(field, light, own=0.0) * cast)
    nothing = np.zeros_like(target.picture)
    found = done(free_light(answers, light, target, nothing, balance=balance))
    assert found.environment is not None
    colour = answers.cells.radiance(found.environment).sum(axis=0)
    colour /= answers.cells.radiance(light).sum(axis=0)
    expected = np.ones(3) if balance else cast
    np.testing.assert_allclose(colour / colour.mean(), expected / expected.mean(), rtol=0.05)
    np.testing.assert_allclose(
        found.scale / found.scale.mean() * cast if balance else found.scale,
        np.full(3, (found.scale / found.scale.mean() * cast).mean()) if balance else 1.0,
        rtol=0.02,
    )


def test_a_painted_shadow_is_told() -> None:
    """Pixels that all see the same light, of which a part is to be dark."""
    from arto.core.match.missing import missing

    rng = np.random.default_rng(0)
    made = rng.uniform(0.5, 1, (60, 80, 1)) * np.ones(3)
    counts = np.ones((60, 80), bool)
    noise = made * rng.normal(1, 0.15, made.shape)
    assert not missing(made, noise, counts).told
    painted = made.copy()
    painted[35:55, 5:25] *= 0.3
    found = missing(made, painted, counts)
    assert found.told and "dark" in found.words and "left" in found.words
    assert 0.04 < found.share < 0.12
    counts[:, :40] = False
    assert not missing(made, painted, counts).told


def test_a_shadow_on_pixels_that_see_alike_cannot_be_matched(answers: Answers) -> None:
    """Every second pixel is to be as dark as a tenth, in light that they share."""
    light = sky(1)
    shade = answers.under(light)
    same = np.broadcast_to(shade.mean(axis=0), shade.shape)
    values = np.repeat(answers.values.mean(axis=-1, keepdims=True), shade.shape[0], axis=-1)
    alike = Answers(
        answers.cells, values, answers.small, answers.fine, answers.factors, answers.shiny,
        answers.alpha,
    )  # fmt: skip
    picture = same.reshape(*SHAPE, 3).copy()
    picture[4:14, 4:20] *= 0.1
    target = Target(picture.reshape(-1, 3), np.ones(len(shade)))
    found = done(free_light(alike, light, target, np.zeros_like(shade)))
    assert found.missing.told


def test_gains_of_lights_come_back(field: Field, answers: Answers) -> None:
    base, key = sky(1), sky(2)
    lights = {"base": answers.under(base), "key": answers.under(key)}
    own = answers.layer("own")
    warm = np.array([3.0, 2.0, 1.0])
    target = Target(0.5 * lights["base"] + warm * lights["key"] + own, answers.sizes)
    found = gains.gains(answers, lights, own, target, gains.Wish(colours=True))
    np.testing.assert_allclose(found.gains["base"], 0.5, rtol=0.02)
    np.testing.assert_allclose(found.gains["key"], warm, rtol=0.02)
    # a light that stays tells the exposure
    brighter = Target(target.picture * 2, target.weights)
    wish = gains.Wish(colours=True, exposure=True)
    found = gains.gains(answers, lights, own, brighter, wish)
    np.testing.assert_allclose(found.scale, 0.5, rtol=0.02)
    np.testing.assert_allclose(found.gains["key"], warm, rtol=0.03)
    # strengths alone: each stays white
    found = gains.gains(answers, lights, own, target)
    assert np.ptp(found.gains["key"]) == 0


def test_a_turned_base_is_found(answers: Answers) -> None:
    base = sky(3)
    degrees = 75.0
    turned = Environment(base.image, base.turn + np.radians(degrees))
    target = Target(1.5 * answers.under(turned), answers.sizes)
    nothing = np.zeros_like(target.picture)
    found = done(gains.turned(answers, base, {}, nothing, target))
    assert abs(np.degrees(found.turn) - degrees) < 2
    np.testing.assert_allclose(found.gains["base"], 1.5, rtol=0.05)


def test_a_region_is_asked_where_its_light_is_from(field: Field, answers: Answers) -> None:
    one, two = sky(1), sky(2)
    region = np.zeros(len(answers.alpha))
    region[40:60] = 1
    lights = {"one": answers.under(one), "two": 3 * answers.under(two)}
    parts = ask.by_lights(lights, region)
    assert sum(p.share for p in parts) == pytest.approx(1)
    assert [p.share for p in parts] == sorted((p.share for p in parts), reverse=True)
    # a single cell that shines is where all light is from
    radiance = np.zeros((answers.cells.count, 3))
    j = int(np.argmax(answers.values[0] @ region))
    radiance[j] = 1
    found = ask.by_directions(answers, radiance, region)
    assert found[0].share == pytest.approx(1)
    np.testing.assert_allclose(found[0].direction, answers.cells.middles[j])
    every = ask.by_directions(answers, answers.cells.radiance(one), region)
    assert sum(f.share for f in every) == pytest.approx(1)
    with pytest.raises(TargetError, match="region is empty"):
        ask.by_lights(lights, 0 * region)


def test_a_region_is_made_even(answers: Answers) -> None:
    light = sky(1)
    n = len(answers.alpha)
    albedo = np.ones((n, 3))
    region, keep = np.zeros(n), np.zeros(n)
    region[100:112] = 1
    now = answers.under(light)
    target = ask.evened(now, albedo, region, keep)
    found = done(free_light(answers, light, target, np.zeros_like(now)))
    assert found.environment is not None
    after = answers.under(found.environment)
    before = ask.unevenness(now, albedo, region)
    assert ask.unevenness(after, albedo, region) < 0.5 * before


@pytest.mark.newest
def test_what_is_kept_stays(answers: Answers) -> None:
    light = sky(1)
    n = len(answers.alpha)
    now = answers.under(light)
    region, keep = np.zeros(n), np.zeros(n)
    region[100:112], keep[300:600] = 1, 1
    albedo = np.ones((n, 3))
    moved = []
    for weight in (0.0, 10.0):
        target = ask.evened(now, albedo, region, weight * keep)
        found = done(free_light(answers, light, target, np.zeros_like(now)))
        assert found.environment is not None
        off = np.abs(answers.under(found.environment) - now)[keep > 0]
        moved.append(float(off.mean() / now[keep > 0].mean()))
    assert moved[1] < 0.5 * moved[0]


def test_cells_keep_the_light_that_they_are_given() -> None:
    cells = Cells(CUBE, np.array([1, 2] * 12))
    radiance = np.random.default_rng(0).uniform(0, 5, (cells.count, 3))
    found = cells.radiance(cells.environment(radiance, 128))
    np.testing.assert_allclose(found, radiance, rtol=0.05)
    assert cells.solid_angles.sum() == pytest.approx(4 * np.pi)
    pairs, weights = cells.borders
    assert (pairs[:, 0] < pairs[:, 1]).all() and (weights > 0).all()
    # each cell has neighbours on all sides
    assert np.bincount(pairs.ravel(), minlength=cells.count).min() >= 4


def test_least_squares_are_those_of_a_search() -> None:
    """Against every choice of which unknowns are 0."""
    rng = np.random.default_rng(5)
    for _ in range(10):
        a = rng.normal(size=(8, 5))
        gram, right = a.T @ a + 0.01 * np.eye(5), rng.normal(size=5)
        best = np.inf
        for bits in range(32):
            free = np.array([bits >> i & 1 for i in range(5)], bool)
            x = np.zeros(5)
            x[free] = np.linalg.solve(gram[np.ix_(free, free)], right[free])
            if (x >= 0).all():
                best = min(best, x @ gram @ x / 2 - right @ x)
        x = nonnegative(gram, right)
        assert (x >= 0).all()
        assert x @ gram @ x / 2 - right @ x <= best + 1e-5 * abs(best)


def test_a_target_of_another_size_is_brought_or_refused() -> None:
    ramp = np.linspace(0, 1, 40)[None, :, None] * np.ones((30, 1, 3))
    small = fitting(ramp, (15, 20))
    np.testing.assert_allclose(small[0, :, 0], ramp[0, :, 0].reshape(20, 2).mean(axis=1))
    assert fitting(small, (30, 40)).mean() == pytest.approx(ramp.mean())
    with pytest.raises(TargetError, match="other proportions"):
        fitting(ramp, (30, 30))
    with pytest.raises(TargetError, match="no pixel"):
        Target(np.ones((4, 3)), np.zeros(4))
    with pytest.raises(TargetError, match="not a number"):
        Target(np.full((4, 3), np.nan), np.ones(4))


def test_a_black_target_is_refused() -> None:
    """Before work: every light is infinitely far off from none."""
    with pytest.raises(TargetError, match="black"):
        Target(
            np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]), np.array([1.0, 1, 0])
        )
