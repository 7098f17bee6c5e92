"""Two lobes in a patch come apart, and bells show them: what was planted is what is relit."""

from __future__ import annotations

import numpy as np
import pytest
from arto.core.capture.tile_data import TileData
from arto.core.errors import PatternError
from arto.core.field.field import Field
from arto.core.field.tile_writer import TileWriter
from arto.core.field.writer import FieldWriter
from arto.core.fit.choice import check
from arto.core.fit.evidence import evidence
from arto.core.fit.fit import fit_tile
from arto.core.fit.lobes import choose_lobes
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from arto.core.measure import box_averages, uniform_moments
from arto.core.patterns import BASE, ONE, PATHS, SHARP, UU, VV, LobedSet, U, V, pattern_set
from arto.core.region import Region
from arto.core.relight import relight
from arto.core.supports import BELL, BOX, LINEAR, NOTHING, WHOLE
from arto.core.supports.bell import bells_of, moments_of, stacked

LOBES = pattern_set("lobes")
assert isinstance(LOBES, LobedSet)
CUBE = Hemicube(patches=2)
FLAT = (-1e-6, 1e-6, -1e-6, 1e-6)


def both(planted, base, base_light, sharp, sharp_light, extent=FLAT) -> np.ndarray:
    """Basis images (5, n, 3) of two boxes a pixel: a base's and a sharp one."""
    first, second = LOBES.lobes
    return np.concatenate(
        [
            planted(first, np.asarray(base), np.asarray(base_light), extent),
            planted(second, np.asarray(sharp), np.asarray(sharp_light), extent),
        ]
    )


def chosen(basis: np.ndarray, samples: float | None = None, extent=FLAT, sharp_share=None):
    """The entries of a patch that is the only one. Of samples grains tell nothing here: planted
    light has no noise."""
    n = basis.shape[1]
    sizes = LOBES.coefficient(basis).sum(axis=-1)[None].astype(np.float32)
    known = evidence(sizes, (1, n), np.full(1, 4 * np.pi), samples)
    return choose_lobes(basis, LOBES, known, 0, np.arange(n), extent, samples is None, sharp_share)


def test_the_set_is_of_two_sets_that_other_paths_see() -> None:
    assert len(LOBES) == 5 and LOBES.shown_by == (0, 2)
    assert [LOBES.paths(name) for name in LOBES.patterns] == [BASE, BASE, SHARP, SHARP, SHARP]
    assert {pattern_set("linear").paths("u"), BASE, SHARP} == set(PATHS)
    first, second = LOBES.lobes
    shown = [*map(first.emission, first.patterns), *map(second.emission, second.patterns)]
    assert [LOBES.emission(name) for name in LOBES.patterns] == shown
    # the grains of both
    assert LOBES.emission("places")[2] is None and LOBES.emission("sharp_places")[2] is None


def test_what_it_can_tell_of_both_together() -> None:
    check("auto", LOBES)
    check("linear", LOBES)
    with pytest.raises(PatternError, match="needs the moments u2, v2"):
        check("box", LOBES)
    with pytest.raises(PatternError, match="turn Per Channel off"):
        check("auto", LOBES, separate=True)


def test_moments_of_the_sum_are_those_of_both(planted) -> None:
    rng = np.random.default_rng(0)
    base, sharp = ([[0.1, 0.9, 0.0, 1.0]], [[0.7, 0.8, 0.2, 0.3]])
    lights = rng.uniform(0.1, 1, (2, 1, 3))
    found = LOBES.shared(both(planted, base, lights[0], sharp, lights[1]), np.full(6, np.nan))
    sums = lights.sum(axis=-1)[:, 0]
    assert found[ONE, 0] == pytest.approx(sums.sum())
    assert found[U, 0] == pytest.approx(sums @ [0.5, 0.75])
    assert found[V, 0] == pytest.approx(sums @ [0.5, 0.25])
    assert np.isnan(found[[UU, VV]]).all()


@pytest.mark.parametrize("extent", [FLAT, (0.0, 1.0, 0.0, 1.0), (0.5, 1.0, -0.5, 0.0)])
def test_a_coat_on_paint_is_two_entries(planted, extent) -> None:
    """Of other colours, one of them pure; in the very same patch."""
    base, sharp = [[0.0, 1.0, 0.0, 1.0]] * 2, [[0.62, 0.66, 0.3, 0.32], [0.1, 0.15, 0.8, 0.9]]
    paint = np.array([[0.5, 0.02, 0.0], [0.4, 0.3, 0.2]])
    coat = np.full((2, 3), 0.04)
    found = chosen(both(planted, base, paint, sharp, coat, extent), extent=extent)
    (bells,) = found.sharp
    assert bells.code == BELL.code and bells.pixels.tolist() == [0, 1]
    np.testing.assert_allclose(bells.parameters.T, about(np.array(sharp)), atol=1e-5)
    np.testing.assert_allclose(bells.light, coat.T, rtol=1e-12)
    np.testing.assert_allclose(found.coefficient, paint, rtol=1e-12)
    assert set(found.codes.tolist()) <= {WHOLE.code, LINEAR.code}


def test_what_is_broad_is_one_entry_of_all_light(planted) -> None:
    base, sharp = [[0.0, 1.0, 0.0, 1.0]], [[0.0, 1.0, 0.1, 0.9]]
    found = chosen(both(planted, base, np.full((1, 3), 0.2), sharp, np.full((1, 3), 0.3)), 10)
    assert not len(found.sharp)
    np.testing.assert_allclose(found.coefficient, 0.5)
    assert found.codes.tolist() == [LINEAR.code]


def test_a_base_too_dark_to_keep_goes_to_the_rest(planted) -> None:
    base, sharp = [[0.0, 1.0, 0.0, 1.0]], [[0.3, 0.31, 0.3, 0.31]]
    found = chosen(both(planted, base, np.full((1, 3), 1e-9), sharp, np.ones((1, 3))))
    assert found.codes.tolist() == [NOTHING] and found.sharp[0].pixels.tolist() == [0]


def test_a_mirror_pixel_is_a_bell_however_few_its_paths(planted) -> None:
    """By the share of its light; a few sharp paths on something matt are noise."""
    base, sharp = [[0.0, 1.0, 0.0, 1.0]], [[0.3, 0.5, 0.1, 0.5]]
    for light, share, entries in ((0.02, 0.9, 1), (0.02, 0.1, 0)):
        images = both(planted, base, np.ones((1, 3)), sharp, np.full((1, 3), light))
        known = evidence(np.full((1, 1), 3.06, np.float32), (1, 1), np.full(1, 1e-3), 64)
        found = choose_lobes(images, LOBES, known, 0, np.arange(1), FLAT, False, np.full(1, share))
        assert len(found.sharp) == entries


def test_a_field_of_lobes_gives_all_of_an_even_light_back(planted, tmp_path) -> None:
    """And under light that is even in half of the patch, what the two boxes see of it."""
    rng = np.random.default_rng(3)
    k, shape = len(CUBE), (4, 6)
    n = shape[0] * shape[1]
    low = rng.uniform(0.05, 0.85, (k, n, 2))
    narrow = np.stack([low[..., 0], low[..., 0] + 0.1, low[..., 1], low[..., 1] + 0.1], axis=-1)
    whole = np.broadcast_to([0.0, 1.0, 0.0, 1.0], narrow.shape)
    lights = rng.uniform(0.1, 1, (2, k, n, 3)).astype(np.float32)
    basis = np.stack(
        [
            both(planted, whole[i], lights[0, i], narrow[i], lights[1, i], CUBE.extent(i))
            for i in range(k)
        ]
    )
    data = TileData(
        Region(0, 0, shape[1], shape[0]),
        basis.reshape(k, 5, *shape, 3).astype(np.float32),
        np.zeros((*shape, 3), np.float32),
        np.ones(shape, np.float32),
        {},
    )
    *_, tile = fit_tile(data, LOBES, CUBE, "auto")
    assert isinstance(tile, TileWriter)
    writer = FieldWriter(tmp_path / "field", CUBE, shape)
    writer.add(tile)
    writer.close()
    field = Field(tmp_path / "field")
    assert field.tiles[0].used == {"whole": k * n, "bell": k * n}
    even = Environment(np.ones((32, 64, 3), np.float32))
    picture = relight(field, PatchLight(even, CUBE))[..., :3].reshape(n, 3)
    np.testing.assert_allclose(picture, lights.sum(axis=(0, 1)), rtol=4e-3)
    noise = Environment(rng.exponential(size=(64, 128, 3)).astype(np.float32))
    light = PatchLight(noise, CUBE)
    expected = np.zeros((n, 3))
    for i in range(k):
        expected += lights[0, i] * light.whole[i]
        expected += lights[1, i] * BELL.average(light, i, about(narrow[i]))
    found = relight(field, light)[..., :3].reshape(n, 3)
    np.testing.assert_allclose(found, expected, rtol=0.01)


def about(boxes: np.ndarray) -> np.ndarray:
    """The bells (n, 4) that have the middles and the widths of boxes."""
    u0, u1, v0, v1 = boxes.T
    return np.stack([(u0 + u1) / 2, (u1 - u0) / 2, (v0 + v1) / 2, (v1 - v0) / 2], axis=-1)


def test_bells_have_the_mean_and_the_variance_that_they_were_asked_for() -> None:
    """Also where the rim cuts them, as it cuts an exponential whose mean is its deviation."""
    rng = np.random.default_rng(0)
    mean = rng.uniform(0.02, 0.22, 400)
    half = np.sqrt(3) * mean * rng.uniform(0.1, 1.2, 400)
    mean[::2] = 1 - mean[::2]
    low, high = stacked(mean, half)
    assert low.min() >= -1e-4 and high.max() <= 1 + 1e-4
    np.testing.assert_allclose((low + high).mean(axis=0) / 2, mean, rtol=1e-9)
    squares = (low * low + low * high + high * high).mean(axis=0) / 3
    np.testing.assert_allclose(squares - mean**2, half**2 / 3, rtol=1e-6)


@pytest.mark.parametrize("patch", [0, 5, 14, 23])
def test_even_light_on_all_of_a_patch_is_all_of_it(patch: int) -> None:
    extent = CUBE.extent(patch)
    even = uniform_moments(extent)
    mean = np.array([even[U]]), np.array([even[V]])
    spread = np.array([even[UU] - even[U] ** 2]), np.array([even[VV] - even[V] ** 2])
    bell = bells_of(mean, spread, extent)
    np.testing.assert_allclose(bell, [[0.5, 0.5, 0.5, 0.5]], atol=2e-3)
    for found, m in zip(moments_of(bell, extent), (U, UU, V, VV), strict=True):
        np.testing.assert_allclose(found, even[m], atol=3e-3)


def test_a_bell_has_the_mean_and_the_variance_of_its_box() -> None:
    """Beside no rim; at a rim it is the box."""
    boxes = np.array([[0.4, 0.6, 0.3, 0.5], [0.0, 0.3, 0.2, 0.4]])

    class Squares:
        """Light that is u^2 in red, u in green and v in blue, of which averages are known."""

        resolutions = (1000,)

        def point(self, k, u, v):
            assert not len(u)
            return np.empty((0, 3))

        def box(self, k, u0, u1, v0, v1):
            found = box_averages(np.stack([u0, u1, v0, v1], axis=-1), FLAT)
            return found[[UU, U, V]].T

    light = Squares()
    np.testing.assert_allclose(
        BELL.average(light, 0, about(boxes)), BOX.average(light, 0, boxes), rtol=1e-3
    )


@pytest.mark.parametrize("resolution", [1, 2, 7])
def test_a_point_is_a_box_of_a_bin(resolution: int) -> None:
    rng = np.random.default_rng(1)
    image = rng.exponential(size=(64, 128, 3)).astype(np.float32)
    light = PatchLight(Environment(image), CUBE, resolution)
    u, v = rng.random((2, 300))
    np.testing.assert_allclose(light.point(5, u, v), light.box(5, u, u, v, v), rtol=1e-9)


def test_a_bell_never_shows_less_than_the_darkest_of_a_patch() -> None:
    rng = np.random.default_rng(0)
    light = PatchLight(Environment(rng.exponential(size=(64, 128, 3)).astype(np.float32)), CUBE)
    found = BELL.average(light, 3, rng.random((500, 4)))
    bins = light.bins_of(3).reshape(-1, 4)
    radiance = bins[:, :3] / bins[:, 3:]
    assert (found >= radiance.min(axis=0) - 1e-9).all()
    assert (found <= radiance.max(axis=0) + 1e-9).all()
