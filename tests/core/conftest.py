"""What the tests of `core` share: transports whose answer is known, and captures made of them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import OpenImageIO
import pytest
from arto.core import exr
from arto.core.capture import capture_set, names
from arto.core.capture import head as heads
from arto.core.capture.head import CaptureHead
from arto.core.capture.tile_entry import TileEntry
from arto.core.errors import FieldError
from arto.core.field.field import Field
from arto.core.field.head import HEADER
from arto.core.field.tile_file import TileFile, written
from arto.core.fit import fit
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from arto.core.patterns import PatternSet, monomials, pattern_set
from arto.core.region import Region
from arto.core.relight import relight
from arto.core.signed import parsed
from hypothesis import settings
from numpy.typing import NDArray

# No clock: the machine may be busy. No random seed of the day: a test is green or red for all.
settings.register_profile("core", deadline=None, max_examples=40, derandomize=True)
settings.load_profile("core")


def _rotation(seed: int) -> tuple[tuple[float, ...], ...]:
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    if np.linalg.det(q) < 0:
        q[:, 0] *= -1
    return tuple(tuple(float(x) for x in row) for row in q)


# A patch so small that its area and its solid angle are one: boxes have their moments written out.
FLAT = (-1e-6, 1e-6, -1e-6, 1e-6)


def _box_moments(boxes: NDArray, extent: tuple[float, ...] = FLAT) -> NDArray:
    """Moments (6, n) over the zeroth of transports that see boxes (n, 4: u0, u1, v0, v1) of a patch
    evenly by solid angle. On a flat patch the integrals written out; else a sum over 24 x 24 places
    of each box, weighted by how a face at distance 1 is foreshortened and far there."""
    u0, u1, v0, v1 = np.asarray(boxes, np.float64).T
    if extent == FLAT:
        return np.stack(
            [
                np.ones_like(u0),
                (u0 + u1) / 2,
                (u0 * u0 + u0 * u1 + u1 * u1) / 3,
                (v0 + v1) / 2,
                (v0 * v0 + v0 * v1 + v1 * v1) / 3,
                (u0 + u1) * (v0 + v1) / 4,
            ]
        )
    at, weight = np.polynomial.legendre.leggauss(24)
    at = (at + 1) / 2
    u, v = u0 + (u1 - u0) * at[:, None, None], v0 + (v1 - v0) * at[:, None]
    x0, x1, y0, y1 = extent
    x, y = x0 + (x1 - x0) * u, y0 + (y1 - y0) * v
    distance = np.sqrt(x * x + y * y + 1)
    # the cosine to the face's normal is 1 / distance
    solid_angle = weight[:, None, None] * weight[:, None] / distance / distance**2
    m = (monomials(u, v) * solid_angle).sum(axis=(1, 2))
    return m / m[0]


def _planted(
    patterns: PatternSet,
    boxes: NDArray,
    coefficient: NDArray,
    extent: tuple[float, ...] = FLAT,
) -> NDArray:
    """Basis images (P, n, 3) of even boxes (n, 4: u0, u1, v0, v1) with R (n, 3)."""
    found = _box_moments(boxes, extent)
    # by channel; half of the grains are lit
    shown = [
        [np.array((0.5, 0, 0, 0, 0, 0)) if row is None else np.array(row) for row in rows]
        for rows in map(patterns.emission, patterns.patterns)
    ]
    each = [[row @ found for row in (rows if len(rows) == 3 else 3 * rows)] for rows in shown]
    return np.moveaxis(np.array(each), 1, -1) * coefficient


def _hits(patterns: PatternSet, u: NDArray, v: NDArray, weights: NDArray) -> NDArray:
    """Basis images (P, n, 3) of transports that are points: u, v (m, n), weights (m, n, 3)."""
    return np.einsum("pmn,mnc->pnc", patterns.radiance(u, v), weights)


def _smooth(seed: int) -> Callable[[NDArray], NDArray]:
    """A smooth positive light: direction (..., 3) -> radiance (..., 3), quadratic in direction."""
    rng = np.random.default_rng(seed)
    slope, form = rng.normal(size=(3, 3)), rng.normal(size=(3, 3, 3))

    def light(d: NDArray) -> NDArray:
        value = d @ slope + np.einsum("...i,ijc,...j->...c", d, form, d)
        return 4 + value / 2

    return light


def _texel_directions(height: int, width: int) -> NDArray:
    """(H, W, 3) unit directions of a map's texels as Cycles has them, first row up:
    u = 0.5 - atan2(y, x) / 2 pi, v = 0.5 + atan2(z, hypot(x, y)) / pi, v = 0 below."""
    u = (np.arange(width) + 0.5) / width
    v = 1 - (np.arange(height) + 0.5) / height
    azimuth, latitude = (0.5 - u) * 2 * np.pi, (v - 0.5) * np.pi
    return np.stack(
        [
            np.cos(latitude)[:, None] * np.cos(azimuth),
            np.cos(latitude)[:, None] * np.sin(azimuth),
            np.broadcast_to(np.sin(latitude)[:, None], (height, width)),
        ],
        axis=-1,
    )


def _noisy(seed: int, height: int = 32) -> Environment:
    """A map of independent texels over three decades."""
    rng = np.random.default_rng(seed)
    return Environment((10 ** rng.uniform(-2, 1, (height, 2 * height, 3))).astype(np.float32))


class Scene(NamedTuple):
    """A made-up capture and the truth behind it."""

    hemicube: Hemicube
    patterns: PatternSet
    boxes: NDArray  # (K, H, W, 4)
    coefficient: NDArray  # (K, H, W, 3)
    basis: NDArray  # (K, P, H, W, 3) float32
    own: NDArray  # (H, W, 3)
    alpha: NDArray  # (H, W)


def _scene(
    hemicube: Hemicube,
    shape: tuple[int, int] = (6, 8),
    patterns: str = "moments",
    seed: int = 0,
    widest: float = 0.9,
    unlit: float = 0.25,
) -> Scene:
    """Random boxes up to `widest` wide; a share `unlit` of the pixel-patch pairs gets no light."""
    rng = np.random.default_rng(seed)
    k = len(hemicube)
    size = rng.uniform(0.05, widest, (k, *shape, 2))
    low = rng.uniform(0, 1 - size)
    boxes = np.stack([low[..., 0], low[..., 0] + size[..., 0]], -1)
    boxes = np.concatenate([boxes, np.stack([low[..., 1], low[..., 1] + size[..., 1]], -1)], -1)
    coefficient = 10 ** rng.uniform(-2, 0, (k, *shape, 3))
    coefficient[rng.random((k, *shape)) < unlit] = 0
    chosen = pattern_set(patterns)
    basis = np.stack(
        [
            _planted(chosen, b.reshape(-1, 4), c.reshape(-1, 3), hemicube.extent(n))
            for n, (b, c) in enumerate(zip(boxes, coefficient, strict=True))
        ]
    )
    basis = basis.reshape(k, len(chosen), *shape, 3).astype(np.float32)
    own = rng.uniform(0, 2, (*shape, 3)).astype(np.float32)
    alpha = rng.uniform(0, 1, shape).astype(np.float32)
    return Scene(hemicube, chosen, boxes, coefficient, basis, own, alpha)


def _write_scene(folder: Path, scene: Scene, regions: list[Region] | None = None) -> Path:
    """A capture set of the scene, of one tile or of one per region."""
    if regions is None:
        capture_set.write(
            folder, scene.hemicube, scene.patterns, scene.basis, scene.own, scene.alpha
        )
        return folder
    height, width = scene.alpha.shape
    tiles = []
    for n, region in enumerate(regions):
        cut = region.slices
        rgb = scene.basis.sum(axis=(0, 1), dtype=np.float64)[cut] + scene.own[cut]
        layers = {"Combined": np.dstack([rgb, scene.alpha[cut]]).astype(np.float32)}
        for k in range(len(scene.hemicube)):
            for p, name in enumerate(scene.patterns.patterns):
                part = f"Combined_{names.group_name(k, name)}"
                layers[part] = scene.basis[k, p][cut]
        exr.write(folder / f"tile_{n:04d}.exr", layers)
        tiles.append(TileEntry(region, (f"tile_{n:04d}.exr",), done=True))
    heads.write(folder, CaptureHead(scene.hemicube, scene.patterns, height, width, tuple(tiles)))
    return folder


def _fitted(capture: Path, folder: Path, choice: str = "box") -> Field:
    for _ in fit.fit(capture_set.CaptureSet(capture), folder, choice):
        pass
    return Field(folder)


def _arrays_of(tile: Path) -> dict[str, NDArray]:
    """All arrays of a tile's file."""
    there = TileFile(tile)
    return {name: there.load(name).copy() for name in there.sizes}


def _put_arrays(tile: Path, **arrays: NDArray | None) -> None:
    """Write a tile's file anew with other arrays, whole and with right checksums; None: without."""
    kept = _arrays_of(tile) | arrays
    with written(tile) as out:
        for name, array in kept.items():
            if array is not None:
                out.add(name, array)
    header = tile.parent / HEADER
    if header.exists():  # as the version before wrote it, which had no checksums of tiles
        head = parsed(header.read_text())
        for entry in head["tiles"]:
            entry.pop("checksum", None)
        header.write_text(json.dumps(head))


def _used(folder: Path) -> NDArray[np.float32]:
    """The picture of a field under even light."""
    with Field(folder) as field:
        return relight(field, PatchLight(Environment.uniform(1.0, 16), field.hemicube))


def _refused(folder: Path, *says: str) -> None:
    """Opening or using the field fails with a message that holds `says` and advice."""
    with pytest.raises(FieldError) as e:
        _used(folder)
    for text in says:
        assert text in str(e.value), (text, str(e.value))
    assert "fit again" in str(e.value)


# Helpers come as fixtures: test files are no package, so they cannot import this one.
def _helper(function: Callable) -> Callable:
    return pytest.fixture(scope="session", name=function.__name__.lstrip("_"))(lambda: function)


@pytest.fixture(scope="session")
def flat() -> tuple[float, ...]:
    """The extent of a patch so small that its area and its solid angle are one."""
    return FLAT


rotation = _helper(_rotation)
planted = _helper(_planted)
box_moments = _helper(_box_moments)
hits = _helper(_hits)
smooth = _helper(_smooth)
texel_directions = _helper(_texel_directions)
noisy = _helper(_noisy)
scene = _helper(_scene)
write_scene = _helper(_write_scene)
fitted = _helper(_fitted)
arrays_of = _helper(_arrays_of)
put_arrays = _helper(_put_arrays)
used = _helper(_used)
refused = _helper(_refused)


@pytest.fixture(params=["OpenEXR", "OpenImageIO"])
def library(request: pytest.FixtureRequest) -> Iterator[str]:
    """Which library packs and unpacks the pixels of EXR files."""
    before = exr.chosen()
    exr.choose(exr.OpenImageIo(OpenImageIO) if request.param == "OpenImageIO" else exr.OpenExr())
    yield request.param
    exr.choose(before)


@pytest.fixture
def tiny_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 256 kB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    if sys.platform != "linux" or os.geteuid() != 0:
        pytest.skip("only root on Linux can mount a tiny disk")
    done = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", str(folder)], capture_output=True
    )
    if done.returncode:
        pytest.skip(f"no tiny disk here: {done.stderr.decode().strip()}")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


@pytest.fixture
def read_only(tmp_path: Path) -> Iterator[Path]:
    """A folder that nobody can write to, root included where it can mount one."""
    folder = tmp_path / "read_only"
    folder.mkdir()
    root = hasattr(os, "geteuid") and os.geteuid() == 0
    if not root:
        folder.chmod(0o500)
        yield folder
        folder.chmod(0o700)
        return
    done = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "ro,size=64k", "tmpfs", str(folder)], capture_output=True
    )
    if done.returncode:
        pytest.skip(f"root writes everywhere here: {done.stderr.decode().strip()}")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)
