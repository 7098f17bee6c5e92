"""Patches go where a scene tells directions apart, and every direction keeps one."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from arto.core.capture.refine import refine
from arto.core.errors import HemicubeError
from arto.core.faces import FACE_NAMES, FINEST
from arto.core.hemicube import Hemicube

CUBE = Hemicube(patches=4)
SHAPE = (6, 8)
MANY = 1e9  # samples: as good as no noise


def flat() -> np.ndarray:
    """Every cell alike to every pixel: (F, 16, 16, h, w, 3)."""
    return np.full((6, FINEST, FINEST, *SHAPE, 3), 1.0)


def refined(probe: np.ndarray, samples: float = MANY, most: int = 192) -> Hemicube:
    return refine(CUBE, probe.reshape(-1, *SHAPE, 3), samples, most)


def of_face(cube: Hemicube, face: str) -> Counter[int]:
    return Counter(n for f, n, _, _ in cube.leaves if f == face)


def covers_everything(cube: Hemicube) -> bool:
    return (cube.partition.table >= 0).all() and cube.solid_angles.sum() == pytest.approx(4 * np.pi)


def test_light_without_detail_needs_one_patch_a_face() -> None:
    x = np.linspace(0.1, 1, FINEST)
    ramp = flat() * x[None, None, :, None, None, None] + x[None, :, None, None, None, None]
    for probe in (flat(), ramp):
        cube = refined(probe)
        assert Counter(n for _, n, _, _ in cube.leaves) == {1: 6}
        assert covers_everything(cube)


def test_detail_on_one_face_is_where_the_patches_go() -> None:
    """Pixels that see a window of 5 by 4 cells on the right face, each another part of it."""
    probe = flat() * 1e-3
    right = FACE_NAMES.index("right")
    rng = np.random.default_rng(1)
    probe[right, 6:10, 3:8] = rng.uniform(0.1, 3, (4, 5, *SHAPE, 1))
    cube = refined(probe, most=128)
    assert len(cube) <= 128 and covers_everything(cube)
    assert of_face(cube, "right")[16] >= 20
    for face in FACE_NAMES:
        if face != "right":
            assert of_face(cube, face) == {1: 1}
    sizes = cube.sides[cube.partition.table[right]]
    assert (sizes[6:10, 3:8] == FINEST).all()


def test_noise_is_not_taken_for_detail() -> None:
    rng = np.random.default_rng(2)
    samples = 32
    shape = (24, 32)
    # as many paths a cell as samples give, each with the weight of one sample
    hits = rng.poisson(samples / (6 * FINEST**2), (6 * FINEST**2, *shape))
    probe = np.repeat(hits[..., None] / samples, 3, axis=-1)
    known = refine(CUBE, probe, samples, 192)
    ignored = refine(CUBE, probe, MANY, 192)
    assert len(known) <= 108 and len(ignored) == 192


def test_more_patches_are_never_worse() -> None:
    rng = np.random.default_rng(3)
    # every pixel sees a few cells, as mirrors do
    probe = flat() * (rng.random((6, FINEST, FINEST, *SHAPE, 1)) < 0.003)
    before = 0
    for most in (96, 99, 150, 600, 4000):
        cube = refined(probe, most=most)
        assert covers_everything(cube)
        assert before <= len(cube) <= most
        before = len(cube)
    # every cell that any pixel sees has a patch of its own in the end
    seen = probe.sum(axis=(3, 4, 5)) > 0
    assert (cube.sides[cube.partition.table][seen] == FINEST).mean() > 0.99


def test_a_black_probe_changes_nothing() -> None:
    assert refined(flat() * 0) == CUBE


def test_broken_pixels_do_not_decide() -> None:
    probe = flat() * 1e-3
    rng = np.random.default_rng(4)
    probe[2, 6:10, 3:8] = rng.uniform(0.1, 3, (4, 5, *SHAPE, 1))
    broken = probe.copy()
    broken[..., 0, 0, :] = np.nan
    broken[3, 4, 5, 0, 1, 2] = np.inf
    kept = probe.reshape(-1, SHAPE[0] * SHAPE[1], 1, 3)[:, 2:]
    assert refined(broken) == refine(CUBE, kept, MANY, 192)
    assert len(refined(broken)) > 6


def test_only_whole_faces_can_be_refined() -> None:
    probe = flat().reshape(-1, *SHAPE, 3)
    for cube in (Hemicube(patches=3), Hemicube(half_sides=True)):
        with pytest.raises(HemicubeError, match="Adaptive Patches off"):
            refine(cube, probe, 32, 192)
    with pytest.raises(HemicubeError, match="a probe of"):
        refine(CUBE, probe[1:], 32, 192)
