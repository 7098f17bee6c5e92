"""From capture set to plate: the picture is sum R <S, L> + the scene's own light (paper 3, 6)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from arto.core.field.field import Field
from arto.core.fit.choice import BROAD, CENTRED
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from arto.core.patterns import ONE, U, V
from arto.core.region import Region
from arto.core.relight import over, relight, relights
from arto.core.supports import BOX, LINEAR, NOTHING, REST, WHOLE

CUBE = Hemicube(patches=2)
# coefficients are half floats, the rest is finer
HALF = 1e-3


@pytest.fixture(scope="module")
def made(scene):
    return scene(CUBE)


@pytest.fixture(scope="module")
def fields(tmp_path_factory, made, write_scene, fitted) -> dict[str, Field]:
    folder: Path = tmp_path_factory.mktemp("relight")
    write_scene(folder / "capture", made)
    choices = ("auto", "box", "linear", "whole")
    return {c: fitted(folder / "capture", folder / c, c) for c in choices}


def truth(made, light: PatchLight, own: float = 1.0) -> np.ndarray:
    """From the planted boxes themselves."""
    out = own * made.own.astype(np.float64)
    for k in range(len(CUBE)):
        average = light.box(k, *made.boxes[k].reshape(-1, 4).T)
        out += made.coefficient[k] * average.reshape(*made.alpha.shape, 3)
    return out


def means(box_moments, k: int, boxes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean places along u and v of boxes (..., 4), even in solid angle -> two of (..., 1)."""
    boxes = np.asarray(boxes, np.float64)
    m = box_moments(boxes.reshape(-1, 4), CUBE.extent(k)).reshape(6, *boxes.shape[:-1], 1)
    return m[U], m[V]


@pytest.mark.parametrize("choice", ["auto", "box", "linear", "whole"])
def test_a_white_world_gives_the_sum_of_the_coefficients(fields, made, choice: str) -> None:
    """Whatever the supports are."""
    plate = relight(fields[choice], PatchLight(Environment.uniform(1.0), CUBE))
    assert plate.dtype == np.float32 and plate.shape == (6, 8, 4)
    expected = made.coefficient.sum(axis=0) + made.own
    np.testing.assert_allclose(plate[..., :3], expected, rtol=HALF)
    np.testing.assert_allclose(plate[..., 3], made.alpha, atol=2**-11)


@pytest.mark.parametrize("choice", ["auto", "box", "linear", "whole"])
def test_a_coloured_world_colours_channel_by_channel(fields, made, choice: str) -> None:
    colour = np.array([0.0, 2.0, 30.0])
    plate = relight(fields[choice], PatchLight(Environment.uniform(tuple(colour)), CUBE), own=0)
    assert not plate[..., 0].any()
    expected = made.coefficient.sum(axis=0)
    np.testing.assert_allclose(plate[..., 1:3] / colour[1:], expected[..., 1:], rtol=HALF)


def test_boxes_pick_their_light_from_the_map(fields, made, noisy) -> None:
    """The coefficients' half floats, and edges that are a 65535th of a patch off."""
    light = PatchLight(noisy(0, 64), CUBE)
    found = relight(fields["box"], light)[..., :3]
    np.testing.assert_allclose(found, truth(made, light), rtol=2 * HALF)
    # that is not what the whole patches give
    whole = relight(fields["whole"], light)[..., :3]
    assert np.abs(whole / truth(made, light) - 1).max() > 0.2


def test_linear_and_whole_are_what_they_say(fields, made, noisy, box_moments) -> None:
    light = PatchLight(noisy(1), CUBE)
    plane = light.polynomial((ONE, U, V))
    linear, whole = (made.own.astype(np.float64) for _ in range(2))
    for k in range(len(CUBE)):
        b, r = made.boxes[k], made.coefficient[k]
        mu, mv = means(box_moments, k, b)
        linear = linear + r * (plane[k, 0] + mu * plane[k, 1] + mv * plane[k, 2])
        whole = whole + r * light.whole[k]
    np.testing.assert_allclose(relight(fields["linear"], light)[..., :3], linear, rtol=2 * HALF)
    np.testing.assert_allclose(relight(fields["whole"], light)[..., :3], whole, rtol=HALF)


def test_auto_is_the_box_where_it_is_narrow_both_ways_and_the_plane_elsewhere(
    fields, made, noisy, box_moments
) -> None:
    light = PatchLight(noisy(2), CUBE)
    size = made.boxes[..., 1::2] - made.boxes[..., ::2]
    broad = (size > 2 * BROAD).any(axis=-1)
    codes = fields["auto"].tiles[0].codes.reshape(broad.shape)
    lit = ~np.isin(codes, (NOTHING, REST))
    # a broad light whose mean is that of the whole patch is the whole patch
    off = np.empty(broad.shape)
    for k in range(len(CUBE)):
        mean, whole = (
            means(box_moments, k, made.boxes[k]),
            means(box_moments, k, np.array([0, 1, 0, 1])),
        )
        off[k] = np.hypot(*(m - w for m, w in zip(mean, whole, strict=True)))[..., 0]
    flat = np.where(off < CENTRED, WHOLE.code, LINEAR.code)
    np.testing.assert_array_equal(codes[lit], np.where(broad, flat, BOX.code)[lit])
    assert (lit & broad).sum() > 20 and (lit & ~broad).sum() > 20
    expected = made.own.astype(np.float64)
    plane = light.polynomial((ONE, U, V))
    for k in range(len(CUBE)):
        b = made.boxes[k]
        box = light.box(k, *b.reshape(-1, 4).T).reshape(6, 8, 3)
        mu, mv = means(box_moments, k, b)
        flat = plane[k, 0] + mu * plane[k, 1] + mv * plane[k, 2]
        flat = np.where((off[k] < CENTRED)[..., None], light.whole[k], flat)
        r = made.coefficient[k] * lit[k][..., None]
        expected = expected + r * np.where(broad[k][..., None], flat, box)
    np.testing.assert_allclose(relight(fields["auto"], light)[..., :3], expected, rtol=2 * HALF)


@pytest.mark.parametrize("choice", ["auto", "box"])
def test_light_adds_up(fields, noisy, choice: str) -> None:
    """Linear in the world: two lights together are the sum of each alone."""
    a, b = noisy(3), noisy(4)
    field = fields[choice]

    def lit(image: np.ndarray) -> np.ndarray:
        return relight(field, PatchLight(Environment(image), CUBE), own=0)[..., :3]

    np.testing.assert_allclose(
        lit(a.image + 2 * b.image), lit(a.image) + 2 * lit(b.image), rtol=1e-4
    )


def test_own_lamps_are_a_switch_and_a_dimmer(fields, made, noisy) -> None:
    light = PatchLight(noisy(5), CUBE)
    off, half, on = (relight(fields["box"], light, own=o) for o in (0.0, 0.5, 1.0))
    np.testing.assert_allclose(on[..., :3] - off[..., :3], made.own, atol=1e-4)
    np.testing.assert_allclose(half[..., :3], (on[..., :3] + off[..., :3]) / 2, rtol=1e-5)
    np.testing.assert_array_equal(off[..., 3], on[..., 3])
    dark = PatchLight(Environment.uniform(0.0), CUBE)
    np.testing.assert_allclose(relight(fields["box"], dark)[..., :3], made.own, atol=1e-5)
    assert not relight(fields["box"], dark, own=0)[..., :3].any()


def test_two_tiles_are_one(tmp_path: Path, made, write_scene, fitted, fields, noisy) -> None:
    regions = [Region(0, 0, 3, 6), Region(3, 0, 5, 6)]
    two = fitted(write_scene(tmp_path / "c", made, regions), tmp_path / "f", "auto")
    assert len(two.tiles) == 2
    light = PatchLight(noisy(6), CUBE)
    # scales are those of each tile's brightest, so the half floats differ in their last bit
    np.testing.assert_allclose(relight(two, light), relight(fields["auto"], light), rtol=2 * HALF)
    assert two.shares() == pytest.approx(fields["auto"].shares())
    assert sum(two.shares().values()) == pytest.approx(1)
    np.testing.assert_allclose(two.layer("own"), fields["auto"].layer("own"), atol=1e-5)
    np.testing.assert_array_equal(two.layer("alpha"), fields["auto"].layer("alpha"))


def test_outside_the_captured_region_the_plate_is_empty(
    tmp_path: Path, made, write_scene, fitted, noisy
) -> None:
    field = fitted(write_scene(tmp_path / "c", made, [Region(2, 1, 4, 3)]), tmp_path / "f")
    light = PatchLight(noisy(7, 64), CUBE)
    plate = relight(field, light)
    inside = np.zeros((6, 8), bool)
    inside[1:4, 2:6] = True
    assert not plate[~inside].any()
    np.testing.assert_allclose(plate[inside][:, :3], truth(made, light)[inside], rtol=2 * HALF)
    np.testing.assert_array_equal(field.layer("own")[~inside], 0)


@pytest.mark.parametrize("shape", [(1, 8), (6, 1), (1, 1)])
def test_a_tile_one_pixel_wide(tmp_path: Path, scene, write_scene, fitted, shape) -> None:
    small = scene(CUBE, shape)
    field = fitted(write_scene(tmp_path / "c", small), tmp_path / "f")
    plate = relight(field, PatchLight(Environment.uniform(1.0), CUBE))
    expected = small.coefficient.sum(axis=0) + small.own
    np.testing.assert_allclose(plate[..., :3], expected, rtol=HALF)


def test_a_sun_lights_only_the_boxes_that_see_it(fields, made) -> None:
    """A sun of 1e5 on black: pixels whose support misses it stay black."""
    k, (u, v) = 7, (0.4, 0.7)
    d = CUBE.directions(k, u, v)
    image = np.zeros((256, 512, 3), np.float32)
    row = int((0.5 - np.arcsin(d[2]) / np.pi) * 256)
    column = int((0.5 - np.arctan2(d[1], d[0]) / (2 * np.pi)) * 512)
    image[row, column] = 1e5
    light = PatchLight(Environment(image), CUBE)
    plate = relight(fields["box"], light, own=0)[..., 0]
    b, r = made.boxes[k], made.coefficient[k, ..., 0]
    far = 3 / light.resolution
    lit = r > 0
    sees = (b[..., 0] < u - far) & (b[..., 1] > u + far)
    sees &= (b[..., 2] < v - far) & (b[..., 3] > v + far)
    misses = (b[..., 0] > u + far) | (b[..., 1] < u - far)
    misses |= (b[..., 2] > v + far) | (b[..., 3] < v - far)
    assert (lit & sees).sum() > 3 and (lit & misses).sum() > 3
    assert (plate[lit & sees] > 1).all()
    np.testing.assert_allclose(plate[misses | ~lit], 0, atol=1e-6)


def test_over() -> None:
    """Premultiplied: what the plate covers is there once."""
    plate = np.array([[[0.5, 0.25, 0.0, 0.5], [1.0, 2.0, 3.0, 1.0], [0, 0, 0, 0]]], np.float32)
    kept = plate.copy()
    background = np.array([[[1.0, 1.0, 4.0]] * 3])
    found = over(plate, background)
    expected = [[[1.0, 0.75, 2.0, 1.0], [1.0, 2.0, 3.0, 1.0], [1.0, 1.0, 4.0, 1.0]]]
    np.testing.assert_allclose(found, expected)
    np.testing.assert_array_equal(plate, kept)
    assert found.dtype == np.float32


@pytest.mark.parametrize("choice", ["auto", "box", "linear", "whole"])
def test_many_lights_at_once_are_each_of_them(fields, noisy, choice: str) -> None:
    lights = [PatchLight(noisy(seed, 64), CUBE) for seed in range(3)]
    together = relights(fields[choice], lights)
    for light, picture in zip(lights, together, strict=True):
        np.testing.assert_allclose(picture, relight(fields[choice], light), rtol=2e-6, atol=1e-7)
    assert relights(fields[choice], []) == []


def test_cut_no_patch_takes_light_away(fields, noisy) -> None:
    """A plane through a spot in a patch's corner is below nothing on the other side: cut, each
    entry gives at least 0, so there is more light than uncut, and many lights are cut alike."""
    image = np.zeros((64, 128, 3), np.float32)
    image[5:7, 40:42] = 1000.0
    lights = [PatchLight(Environment(image), CUBE), PatchLight(noisy(1, 64), CUBE)]
    plain = relights(fields["linear"], lights)
    cut = relights(fields["linear"], lights, cut=True)
    for one, two in zip(plain, cut, strict=True):
        assert (two[..., :3] >= one[..., :3] - 1e-5 * one.max()).all()
        assert (two >= 0).all()
    assert cut[0].sum() > plain[0].sum()
    # of whole patches there is nothing to cut
    for one, two in zip(
        relights(fields["whole"], lights), relights(fields["whole"], lights, cut=True), strict=True
    ):
        np.testing.assert_allclose(one, two, rtol=1e-5, atol=1e-7)
