"""The kernels that a relight and a fit spend their time in, for `pytest --benchmark-only`.

What they give is asserted here too; their times are compared by who measures, and never asserted.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from arto.core.field import proxy
from arto.core.field import tile as field_tile
from arto.core.field.field import Field
from arto.core.field.tile_writer import TileWriter
from arto.core.field.writer import FieldWriter
from arto.core.fit.evidence import evidence
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from arto.core.region import Region
from arto.core.relight import relight
from arto.core.supports import LINEAR, NOTHING

CUBE = Hemicube(patches=4)
SHAPE = (96, 128)


@pytest.fixture(scope="module")
def tile() -> TileWriter:
    """A fifth of all pixels and patches, as linear entries."""
    rng = np.random.default_rng(0)
    n = SHAPE[0] * SHAPE[1]
    layers = {"own": np.zeros((*SHAPE, 3), np.float32), "alpha": np.ones(SHAPE, np.float32)}
    out = TileWriter(Region(0, 0, SHAPE[1], SHAPE[0]), layers)
    for _ in range(len(CUBE)):
        lit = rng.random(n) < 0.2
        codes = np.where(lit, LINEAR.code, NOTHING).astype(np.uint8)
        r = rng.random((n, 3), np.float32) * lit[:, None]
        out.add(codes, r, {LINEAR.code: rng.random((int(lit.sum()), 2))})
    return out


@pytest.fixture(scope="module")
def field(tmp_path_factory: pytest.TempPathFactory, tile: TileWriter) -> Field:
    folder: Path = tmp_path_factory.mktemp("kernels") / "field"
    writer = FieldWriter(folder, CUBE, SHAPE)
    writer.add(tile)
    writer.close()
    return Field(folder)


def test_the_sum_works_by_patch_and_not_by_entry(field: Field, monkeypatch, benchmark) -> None:
    """Its calls are counted: one of each kernel for a patch and a block."""
    light = PatchLight(Environment.uniform(1.0), CUBE)
    calls = []
    real = field_tile.Model.pixels
    monkeypatch.setattr(
        field_tile.Model, "pixels", lambda m, b, k: calls.append(k) or real(m, b, k)
    )
    relight(field, light)
    assert sorted(calls) == list(range(len(CUBE)))
    picture = benchmark(relight, field, light)
    assert picture[..., :3].min() > 0


def test_the_bins_of_a_map(benchmark) -> None:
    environment = Environment.uniform(2.0, 256)
    light = benchmark(PatchLight, environment, CUBE)
    np.testing.assert_allclose(light.whole, 2.0, rtol=1e-9)


def test_the_proxies_of_a_tile(tile: TileWriter, benchmark) -> None:
    found = benchmark(proxy.proxies, tile, CUBE)
    light = {f: sum(float(m[2].sum()) for m in p.models[LINEAR.code]) for f, p in found.items()}
    total = sum(float(m[2].sum()) for m in tile.models[LINEAR.code])
    assert list(light) == [2, 4, 8]
    for factor, some in light.items():
        assert some * factor**2 == pytest.approx(total, rel=1e-4)


def test_the_evidence_of_a_tile(benchmark) -> None:
    rng = np.random.default_rng(1)
    sizes = rng.random((len(CUBE), SHAPE[0] * SHAPE[1])).astype(np.float32)
    known = benchmark(evidence, sizes, SHAPE, CUBE.solid_angles, 64.0)
    np.testing.assert_allclose(known.total, sizes.sum(axis=0), rtol=1e-5)
