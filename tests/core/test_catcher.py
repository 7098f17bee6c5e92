"""The shadow catcher's arithmetic, on pictures whose parts are known."""

from __future__ import annotations

import numpy as np
import pytest
from arto.core.catcher import MOST, catch, catch_seen, held_out, of_ground, spread

SIZE = (48, 64)


def ground_of(rng, low=0.2):
    """A smooth ground (H, W, 3) and a smooth shadow on it."""
    y, x = np.mgrid[: SIZE[0], : SIZE[1]] / SIZE[1]
    ground = low + 0.5 * np.dstack([x, y, x * y])
    shadow = 1 - 0.7 * np.exp(-(((x - 0.5) ** 2 + (y - 0.4) ** 2)[..., None]) / (0.02, 0.03, 0.05))
    return ground, shadow


def disc(radius=0.12, soft=0.05):
    y, x = np.mgrid[: SIZE[0], : SIZE[1]] / SIZE[1]
    r = np.hypot(x - 0.5, y - 0.4)
    return np.clip((radius + soft - r) / soft, 0, 1)


def plate(alpha, colour=(0, 0, 0)):
    """Things of one colour, premultiplied, (H, W, 4)."""
    return np.dstack([alpha[..., None] * np.array(colour), alpha])


NOTHING = np.zeros((*SIZE, 4))


@pytest.fixture
def rng():
    return np.random.default_rng(3)


def test_shadows_come_back(rng):
    """Of a thing with a soft outline on a shadowed ground: the footage gets the shadow that it
    would get if it were the ground."""
    ground, shadow = ground_of(rng)
    things, colour = disc(), np.array([0.9, 0.4, 0.1])
    whole = things[..., None] * colour + (1 - things)[..., None] * shadow * ground
    found = catch(whole, ground, plate(things, colour))
    bare = things == 0
    np.testing.assert_allclose(found.share[bare], shadow[bare], rtol=5e-3)
    np.testing.assert_allclose(found.colour, things[..., None] * colour, rtol=1e-6)
    footage = rng.uniform(0.1, 1, (*SIZE, 3))
    truth = things[..., None] * colour + (1 - things)[..., None] * shadow * footage
    np.testing.assert_allclose(found.over(footage)[bare], truth[bare], atol=5e-3)
    # under the outline the shadow is a guess from around it, and what it is off by is small
    assert np.abs(found.over(footage) - truth).max() < 0.15
    assert np.abs(found.over(footage) - truth).mean() < 0.003


def test_nothing_stands_there(rng):
    """Footage passes unchanged, whatever light the ground has, dark and noisy too."""
    ground = rng.exponential(size=(*SIZE, 3)) * rng.choice([0, 1e-6, 1, 50], size=(*SIZE, 1))
    found = catch(ground, ground, NOTHING)
    assert (found.share == 1).all() and (found.colour == 0).all()
    assert (found.plate == 0).all()
    footage = rng.uniform(size=(*SIZE, 3)).astype(np.float32)
    np.testing.assert_array_equal(found.over(footage), footage)


def test_where_the_ground_ends(rng):
    """Half covered by the ground, a pixel has half of its shadow; beyond it none."""
    ground, shadow = ground_of(rng)
    there = np.repeat(np.linspace(-0.5, 1.5, SIZE[0]).clip(0, 1)[:, None], SIZE[1], axis=1)
    found = catch(ground * shadow * there[..., None], ground * there[..., None], NOTHING, there)
    expected = 1 + there[..., None] * (shadow - 1)
    np.testing.assert_allclose(found.share, expected, atol=0.02)
    np.testing.assert_array_equal(found.share[there == 0], 1)


def test_darkness_is_no_noise(rng):
    """In a ground that is black in places, or everywhere, no pixel comes out white or black."""
    ground, _ = ground_of(rng)
    ground[:, : SIZE[1] // 2] *= 1e-7
    noisy = [np.maximum(ground * rng.normal(1, 0.3, ground.shape), 0) for _ in range(2)]
    found = catch(*noisy, NOTHING)
    assert np.abs(found.share[:, : SIZE[1] // 2 - 1] - 1).max() < 1e-2
    black = catch(0 * ground, 0 * ground, plate(disc()))
    assert (black.share[disc() == 0] == 1).all() and np.isfinite(black.share).all()
    bright = catch(ground + 1e9, ground, NOTHING)
    assert bright.share.max() <= MOST


def test_light_and_shadow_have_no_unit(rng):
    """A hundred times the light, the same share; the things are a hundred times as bright."""
    ground, shadow = ground_of(rng)
    things = disc()
    whole = things[..., None] * 0.5 + (1 - things)[..., None] * shadow * ground
    one = catch(whole, ground, plate(things, (0.5, 0.5, 0.5)))
    many = catch(100 * whole, 100 * ground, plate(things, (50, 50, 50)))
    np.testing.assert_allclose(many.share, one.share, rtol=1e-5)
    np.testing.assert_allclose(many.colour, 100 * one.colour, rtol=1e-4, atol=1e-4)


def test_plate_is_as_cycles_has_it(rng):
    """Premultiplied; its alpha is the things' and, over the rest, how grey the shadow is."""
    ground, shadow = ground_of(rng)
    things = disc()
    whole = things[..., None] * 0.5 + (1 - things)[..., None] * shadow * ground
    found = catch(whole, ground, plate(things, (0.5, 0.5, 0.5)))
    expected = things + (1 - things) * (1 - shadow.mean(axis=-1))
    np.testing.assert_allclose(found.plate[..., 3][things == 0], expected[things == 0], atol=5e-3)
    # the shadow under an outline is a guess
    assert np.abs(found.plate[..., 3] - expected).mean() < 0.005


def test_spread_is_smooth_and_keeps_what_is_known(rng):
    """A plane with a hole is filled near to the plane; what is known is not touched."""
    y, x = np.mgrid[: SIZE[0], : SIZE[1]] / SIZE[1]
    plane = np.dstack([x, y, 1 - x])
    known = disc(0.1, 0.01) == 0
    found = spread(np.where(known[..., None], plane, 99.0), known[..., None])
    np.testing.assert_allclose(found[known], plane[known], rtol=1e-6)
    assert np.abs(found - plane)[~known].max() < 0.1
    assert (spread(plane, np.zeros((*SIZE, 1))) == 1).all()
    one = np.zeros(SIZE, bool)
    one[5, 7] = True
    np.testing.assert_allclose(
        spread(plane, one[..., None]), np.broadcast_to(plane[5, 7], plane.shape)
    )


def test_over_the_ground_itself_both_ways_are_the_whole_picture(rng):
    """Footage that is the ground as it was modelled gives the picture of both: exactly where the
    things' light on it is added; without things it passes."""
    ground, shadow = ground_of(rng)
    things = disc()
    apart = plate(things, (0.5, 0.2, 0.9))
    whole = apart[..., :3] + (1 - things)[..., None] * shadow * ground
    found = catch(whole, ground, apart)
    np.testing.assert_allclose(found.added_to(ground), whole, atol=1e-6)
    bare = things == 0
    np.testing.assert_allclose(found.over(ground)[bare], whole[bare], atol=2e-3)
    nothing = catch(ground, ground, NOTHING)
    footage = rng.uniform(size=(*SIZE, 3)).astype(np.float32)
    np.testing.assert_array_equal(nothing.added_to(footage), footage)


def smeared(image):
    """As a denoiser smears an outline: over a pixel to each side."""
    padded = np.pad(image, ((1, 1), (1, 1), (0, 0)), mode="edge")
    height, width = image.shape[:2]
    return np.mean([padded[y : y + height, x : x + width] for y in range(3) for x in range(3)], 0)


def test_what_glows_over_an_outline_is_no_light_on_the_ground(rng):
    """Ten times as bright as the ground, a thing beside it: what is divided is smeared alike, and
    the shadow beside the outline is what it was. Smeared itself, the picture has specks there."""
    ground, shadow = ground_of(rng)
    things = disc(soft=0.01)
    apart = plate(things, (5, 5, 5))
    whole = apart[..., :3] + (1 - things)[..., None] * shadow * ground
    bare = things == 0
    left, seen = (smeared(part) for part in of_ground(whole, ground, apart))
    alike = np.abs(catch_seen(left, seen, apart).share - shadow)[bare]
    before = np.abs(catch(smeared(whole), smeared(ground), apart).share - shadow)[bare]
    assert alike.max() < 0.05 < 1 < before.max()


def test_footage_passes_a_hole(rng):
    """Before a ground with a shadow something holds out: the footage is seen through it as it is,
    beside it in the shadow, and at its outline in part, half way over a thing's too."""
    ground, shadow = ground_of(rng)
    covers, cut, colour = disc(0.06, 0.04), disc(0.2, 0.08), np.array([0.9, 0.4, 0.1])
    # the thing stands behind what holds out
    things = covers * (1 - cut)
    there = (1 - cut) * (1 - covers)
    whole = things[..., None] * colour + there[..., None] * shadow * ground
    held = held_out(things + there, np.ones(SIZE), things)
    np.testing.assert_allclose(held, cut * (held > 0), atol=1e-6)
    assert cut[held == 0].max() < 5e-3
    found = catch(whole, ground, plate(things, colour), held=held)
    truth = cut[..., None] + there[..., None] * shadow
    assert np.abs(found.share - truth).max() < 0.03
    np.testing.assert_allclose(found.share[cut == 1], 1, atol=1e-6)
    np.testing.assert_allclose(found.share[cut == 0], truth[cut == 0], atol=5e-3)


def test_without_holes_nothing_is_held_out(rng):
    """Half floats round: what they round by is no hole."""
    things, ground = rng.uniform(size=SIZE), rng.uniform(0.5, 1, size=SIZE)
    whole = things + (1 - things) * ground
    kept = (part.astype(np.float16).astype(np.float32) for part in (whole, ground, things))
    assert not held_out(*kept).any()
