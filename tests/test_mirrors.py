"""The bench of mirrors: each error tells what it is named after."""

from __future__ import annotations

import numpy as np
import pytest

from bench.mirror_metrics import BLOCK, by_material, chroma, dark, patch_borders, worst_block

SHAPE = (4 * BLOCK, 4 * BLOCK)


def picture() -> np.ndarray:
    return np.ones((*SHAPE, 3))


def test_a_picture_like_its_reference_has_no_error() -> None:
    masks = {"all": np.ones(SHAPE, bool), "few": np.zeros(SHAPE, bool)}
    found = by_material(picture(), picture(), masks, np.zeros(SHAPE, bool))
    assert found == {"all": {"error": 0, "worst": 0, "chroma": 0, "dark": 0, "borders": None}}


def test_the_worst_block_is_told_and_only_of_its_material() -> None:
    error = np.zeros(SHAPE)
    error[:BLOCK, :BLOCK] = 0.5
    error[BLOCK : 2 * BLOCK, :BLOCK] = 0.1
    mask = np.ones(SHAPE, bool)
    assert worst_block(error, mask) == pytest.approx(0.5)
    mask[:BLOCK, :BLOCK] = False
    assert worst_block(error, mask) == pytest.approx(0.1)
    assert worst_block(error, np.zeros(SHAPE, bool)) is None


def test_black_holes_and_colour_where_there_is_none() -> None:
    mask = np.ones(SHAPE, bool)
    broken = picture()
    broken[: BLOCK // 2] = 0.4
    assert dark(broken, picture(), mask) == pytest.approx(1 / 8)
    assert chroma(broken, picture(), mask) == pytest.approx(0)
    broken[: BLOCK // 2] = (2, 0, 0)
    assert chroma(broken, picture(), mask) == pytest.approx(4 / 3 / 8)
    red = picture() * (1, 0.1, 0.1)
    assert chroma(broken, red, mask) is None


def test_borders_of_patches_lie_within_an_object() -> None:
    strongest, index = np.zeros(SHAPE, int), np.ones(SHAPE, int)
    strongest[:, 10:] = 1
    found = patch_borders(strongest, index)
    assert found[:, 9:11].all() and found.sum() == 2 * SHAPE[0]
    index[:, 10:] = 2
    assert not patch_borders(strongest, index).any()
