"""The choice of a support model: by evidence, within the light that may be dropped."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from arto.core.capture.capture_set import CaptureSet
from arto.core.errors import FieldError, PatternError
from arto.core.field import tile_file
from arto.core.field.tile import Tile
from arto.core.field.tile_writer import TileWriter
from arto.core.fit.choice import BROAD, CHOICES, check, choose
from arto.core.fit.evidence import DROPPED, SUN, Evidence, evidence
from arto.core.fit.fit import fit_tile
from arto.core.hemicube import Hemicube
from arto.core.patterns import PatternSet, pattern_set
from arto.core.supports import BOX, BY_CODE, LINEAR, NOTHING, REST, SUPPORTS, WHOLE
from hypothesis import given
from hypothesis import strategies as st

MOMENTS = pattern_set("moments")
FLAT = (-1e-6, 1e-6, -1e-6, 1e-6)


def known(coefficients: np.ndarray, samples: float | None = None) -> Evidence:
    """Evidence of a row of pixels, (K, n, 3), on patches so large that no sun matters."""
    patches, pixels = coefficients.shape[:2]
    sizes = coefficients.sum(axis=-1, dtype=np.float64).astype(np.float32)
    return evidence(sizes, (1, pixels), np.full(patches, 4 * np.pi), samples)


def alone(
    choice: str,
    basis: np.ndarray,
    patterns: PatternSet = MOMENTS,
    samples: float | None = None,
    extent: tuple[float, float, float, float] = FLAT,
) -> tuple[np.ndarray, dict[int, np.ndarray]]:
    """The choice where this patch is the only one. basis: (P, n, 3)."""
    coefficient = patterns.coefficient(basis)
    evident = known(coefficient[None], samples)
    return choose(choice, basis, coefficient, patterns, evident, 0, extent)


def test_no_light_is_no_entry() -> None:
    patterns = pattern_set("moments_uv")
    for name in ("auto", *SUPPORTS):
        codes, parameters = alone(name, np.zeros((6, 3, 3), np.float32), patterns)
        assert (codes == NOTHING).all()
        assert all(len(p) == 0 for p in parameters.values())


def test_auto_takes_the_plane_for_broad_light_and_the_box_for_narrow(planted) -> None:
    h = BROAD
    box = np.array(
        [
            [0.5 - h, 0.5 + h + 0.1, 0.5 - h - 0.01, 0.5 + h + 0.01],
            [0.5 - h + 0.01, 0.5 + h - 0.01, 0.4, 0.5],  # narrow both ways
            [0.0, 1.0, 0.2, 0.3],  # narrow one way
            [0.2, 0.9, 0.1, 0.9],
            [0.3, 0.4, 0.3, 0.4],
        ]
    )
    r = np.ones((5, 3))
    r[3] = 0  # no light
    codes, parameters = alone("auto", planted(MOMENTS, box, r))
    assert codes.tolist() == [LINEAR.code, BOX.code, LINEAR.code, NOTHING, BOX.code]
    np.testing.assert_allclose(parameters[BOX.code], box[[1, 4]], atol=1e-9)
    np.testing.assert_allclose(parameters[LINEAR.code], [[0.55, 0.5], [0.5, 0.25]], atol=1e-9)


@pytest.mark.parametrize("cube", [Hemicube(patches=n) for n in (1, 2, 4, 16)], ids=len)
def test_what_sees_its_whole_patch_evenly_is_the_whole_patch(planted, cube: Hemicube) -> None:
    """Evenly by solid angle: the mean is off the patch's middle, by 0.074 on one of 2x2. What is
    even over the face's area instead is not the whole patch, where the two differ."""
    for k in (0, 1, len(cube) // 2, len(cube) - 1):
        extent = cube.extent(k)
        for share in (False, True):
            basis = planted(MOMENTS, [[0, 1, 0, 1]], np.ones((1, 3)), extent)
            coefficient = MOMENTS.coefficient(basis)
            evident = known(coefficient[None], 1000)
            codes, _ = choose("auto", basis, coefficient, MOMENTS, evident, 0, extent, share)
            assert codes.tolist() == [WHOLE.code]
    if len(cube) == 24:
        by_area = planted(MOMENTS, [[0, 1, 0, 1]], np.ones((1, 3)))
        assert alone("auto", by_area, samples=1000, extent=extent)[0].tolist() == [LINEAR.code]


@pytest.mark.parametrize(
    "extent", [(-1.0, 1.0, -1.0, 1.0), (0.0, 1.0, 0.0, 1.0), (0.5, 1.0, 0, 0.5)]
)
def test_broad_is_a_width_of_the_box_on_any_patch(planted, extent) -> None:
    """The same box is broad or not, however solid angle bends its spread."""
    for half, support in ((BROAD - 0.005, BOX), (BROAD + 0.005, LINEAR)):
        box = np.array([[0, 2 * half, 0, 2 * half], [1 - 2 * half, 1, 0.1, 0.1 + 2 * half]])
        basis = planted(MOMENTS, box, np.ones((2, 3)), extent)
        assert alone("auto", basis, extent=extent)[0].tolist() == [support.code] * 2


def test_evidence_decides(planted) -> None:
    """Few hits show neither a middle nor a box: the mean is kept as it is, unbiased. Many show a
    middle that is one, and a box that is one."""
    box = np.array([[0.0, 1.0, 0.0, 1.0], [0.7, 0.72, 0.1, 0.12], [0.05, 1.0, 0.0, 1.0]])
    basis = planted(MOMENTS, box, np.ones((3, 3)))
    for samples, middle, narrow in (
        (None, WHOLE, BOX),
        (1000, WHOLE, BOX),
        (100, LINEAR, BOX),
        (2, LINEAR, LINEAR),
    ):
        codes = alone("auto", basis, samples=samples)[0]
        assert codes.tolist() == [middle.code, narrow.code, LINEAR.code]


def test_hits_are_counted_by_the_share_of_the_light(planted) -> None:
    """Without grain: of 64 samples, as many as the patch's share of the pixel's light."""
    box = np.array([[0.7, 0.72, 0.1, 0.12]])
    basis = planted(MOMENTS, box, np.ones((1, 3)))
    codes = []
    for share in (1, 0.25, 0.03):
        rest = np.full((1, 1, 3), 1 / share - 1)
        found = known(np.concatenate([np.ones((1, 1, 3)), rest]), 64)
        assert found.hits(0, np.array([0])) == pytest.approx(64 * share)
        codes.append(choose("auto", basis, np.ones((1, 3)), MOMENTS, found, 0, FLAT)[0][0])
    assert codes == [BOX.code, BOX.code, LINEAR.code]


def test_grain_counts_the_paths_that_matter() -> None:
    """Half of the light, at random, less the other half: its square is the sum of the paths'
    squares. Ten equal paths are ten hits; with one that outshines them all, there is one."""
    rng = np.random.default_rng(0)
    shape = (40, 40)
    weights = np.ones((2, 10, *shape))
    weights[1, 0] = 1000
    sign = rng.choice([-1.0, 1.0], weights.shape)
    size = weights.sum(axis=1)
    sizes = size.reshape(2, -1).astype(np.float32)
    grain = (weights * sign).sum(axis=1)
    found = evidence(sizes, shape, np.ones(2), 1e6, grain.__getitem__)
    even, uneven = (found.hits(k, np.arange(1600)) for k in range(2))
    # windows of 25 pixels scatter; their middle is the truth
    assert np.median(even) == pytest.approx(10, rel=0.1)
    assert np.median(uneven) == pytest.approx((1009 / 1000) ** 2, rel=0.02)


@given(seed=st.integers(0, 2**31), patches=st.integers(1, 60))
def test_what_is_dropped_stays_under_its_share(planted, seed: int, patches: int) -> None:
    """And nothing could be dropped with it: the next larger entry would pass the share."""
    rng = np.random.default_rng(seed)
    r = (10 ** rng.uniform(-6, 0, (patches, 20, 3))).astype(np.float32)
    box = np.tile(np.array([0.1, 0.2, 0.3, 0.5]), (20, 1))
    everything = known(r)
    kept = np.empty((patches, 20), bool)
    for k, c in enumerate(r):
        basis = planted(MOMENTS, box, c).astype(np.float32)
        kept[k] = choose("auto", basis, c, MOMENTS, everything, k, FLAT)[0] != NOTHING
    size = r.sum(axis=-1, dtype=np.float64)
    dropped = np.where(kept, 0, size).sum(axis=0)
    assert (dropped <= DROPPED * size.sum(axis=0)).all()
    smallest = np.where(kept, size, np.inf).min(axis=0)
    assert (dropped + smallest > DROPPED * size.sum(axis=0)).all()


@given(seed=st.integers(0, 2**31))
def test_what_a_sun_could_bring_out_is_kept(seed: int) -> None:
    """On small patches the share of the pixel's light is not all that counts: a sun of irradiance
    pi in a patch, beside a sky of 1, makes no dropped entry more than `SUN` of its pixel."""
    rng = np.random.default_rng(seed)
    cube = Hemicube(patches=16)
    r = 10 ** rng.uniform(-7, 0, (len(cube), 5, 3))
    everything = evidence(r.sum(axis=-1).astype(np.float32), (1, 5), cube.solid_angles)
    size, dropped = r.sum(axis=-1), np.ones((len(cube), 5), bool)
    for k in range(len(cube)):
        dropped[k, everything.kept(k)] = False
    under_sun = size * np.pi / cube.solid_angles[:, None]
    assert (
        under_sun[dropped] <= SUN * np.broadcast_to(size.sum(axis=0), size.shape)[dropped]
    ).all()
    small = np.where(dropped, size, 0).sum(axis=0)
    assert (small > 0).all() and (small <= DROPPED * size.sum(axis=0)).all()


@pytest.mark.newest
@pytest.mark.parametrize("patterns", ["paper", "linear", "moments_uv"])
@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (5, 8)])
def test_what_is_dropped_of_a_tile_stays_under_its_share(
    tmp_path: Path, scene, write_scene, patterns: str, shape: tuple[int, int]
) -> None:
    """Pixels that few patches light: there the least bright entry that must be kept is much."""
    for seed in range(20):
        made = scene(Hemicube(patches=2), shape, patterns, seed, unlit=0.9)
        data = CaptureSet(write_scene(tmp_path / f"{seed}", made)).read(0)
        *_, tile = fit_tile(data, made.patterns, made.hemicube, "auto")
        assert isinstance(tile, TileWriter)
        path = tmp_path / f"tile_{seed}.arto"
        with tile_file.written(path) as out:
            used = tile.write(out)
        written = Tile(path, data.region, used, len(made.hemicube))
        kept = ~np.isin(written.codes, (NOTHING, REST))
        size = made.coefficient.sum(axis=-1).reshape(kept.shape)
        dropped = np.where(kept, 0, size).sum(axis=0)
        assert (dropped <= 1.01 * DROPPED * size.sum(axis=0)).all()


@pytest.mark.parametrize("name", list(SUPPORTS))
def test_one_model_for_all_takes_every_lit_pixel(planted, name: str) -> None:
    r = np.array([[1.0, 0, 0], [0, 0, 0], [0, 0, 1e-6]])  # one channel is enough
    box = np.array([[0.1, 0.2, 0.3, 0.4]] * 3)
    patterns = pattern_set("moments_uv")
    codes, parameters = alone(name, planted(patterns, box, r), patterns)
    support = SUPPORTS[name]
    assert codes.tolist() == [support.code, NOTHING, support.code]
    assert parameters[support.code].shape == (2, len(support.parameters))


def test_codes_are_for_good() -> None:
    """They stand in files: a number is never used for another model."""
    codes = {s.name: s.code for s in SUPPORTS.values()}
    assert codes.items() >= {"whole": 1, "linear": 2, "box": 3}.items()
    for code, support in BY_CODE.items():
        assert support.code == code and 0 < code < 256
    assert len(BY_CODE) == len({s.name for s in BY_CODE.values()})
    assert {WHOLE, LINEAR, BOX} <= set(BY_CODE.values())
    assert (NOTHING, REST) == (0, 255) and not {NOTHING, REST} & set(BY_CODE)


def test_a_choice_that_cannot_be() -> None:
    with pytest.raises(FieldError, match="no support model 'gauss': choose one of auto, whole"):
        check("gauss", MOMENTS)
    with pytest.raises(PatternError, match="needs the moments u2, v2"):
        check("box", pattern_set("paper"))
    for choice in ("linear", "whole", "auto"):
        check(choice, pattern_set("paper"))
    with pytest.raises(PatternError, match="'auto' needs the moments u, v"):
        check("auto", pattern_set("white"))
    with pytest.raises(PatternError, match="'linear' needs the moments u, v"):
        check("linear", pattern_set("white"))
    check("whole", pattern_set("white"))
    with pytest.raises(FieldError, match="'search' has one support for all channels"):
        check("search", MOMENTS, separate=True)
    for choice in CHOICES:
        check(choice, pattern_set("moments_uv"))
