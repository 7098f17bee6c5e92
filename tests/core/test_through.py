"""What is seen through clear things, and light below nothing: by channel, and with its sign."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from arto.arto_addon.live.viewer import Wish, show
from arto.core.capture import capture_set
from arto.core.capture.capture_set import CaptureSet
from arto.core.field.field import Field
from arto.core.field.merged import merged
from arto.core.field.through import opaque
from arto.core.fit.fit import fit
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment
from arto.core.light.layers import share_out
from arto.core.light.light import PatchLight
from arto.core.patterns import pattern_set
from arto.core.preview import Preview, own_light
from arto.core.relight import over, relight

CUBE, WHITE = Hemicube(patches=1), pattern_set("white")
SHAPE = (8, 16)
TINT = np.array([0.8, 0.4, 0.1], np.float32)


def field(folder: Path, alpha: np.ndarray, through: np.ndarray | None, own=None) -> Field:
    basis = np.full((6, 1, *SHAPE, 3), 0.05)
    capture_set.write(folder / "c", CUBE, WHITE, basis, own=own, alpha=alpha, behind=through)
    for _ in fit(CaptureSet(folder / "c"), folder / "f", choice="whole"):
        pass
    return Field(folder / "f")


def pane() -> tuple[np.ndarray, np.ndarray]:
    """Alpha and what is seen through: nothing, tinted glass in the right half, a hole in a row."""
    through = np.ones((*SHAPE, 3), np.float32)
    through[:, 8:] = TINT
    alpha = 1 - through.mean(axis=-1)
    through[0] = 0
    alpha[0] = 0
    return alpha, through


def test_the_colours_are_kept_and_holes_stay_holes(tmp_path: Path) -> None:
    alpha, through = pane()
    found = field(tmp_path, alpha, through)
    kept, half = found.through(), found.proxy(2).through()
    assert kept is not None and half is not None
    np.testing.assert_allclose(kept, through, atol=1e-3)
    np.testing.assert_allclose(half[1:, 4:], np.broadcast_to(TINT, (3, 4, 3)), atol=1e-3)
    world = np.full((*SHAPE, 3), [0.5, 1.0, 2.0], np.float32)
    picture = relight(found, PatchLight(Environment(np.zeros((16, 32, 3), np.float32)), CUBE))
    shown = over(picture, world, found.through())
    np.testing.assert_allclose(shown[..., :3], through * world, atol=4e-3)
    assert (shown[1:, :, 3] == 1).all()
    assert (shown[0, :, 3] == 0).all()


def test_what_is_grey_is_told_by_alpha_alone(tmp_path: Path) -> None:
    """Fields of grey things are as they were, and so are their pictures."""
    alpha, _ = pane()
    grey = np.repeat((1 - alpha)[..., None], 3, axis=-1)
    found = field(tmp_path, alpha, grey)
    assert found.through() is None
    assert "through" not in found.tiles[0].sizes
    assert Preview([found]).through(1) is None


def test_tiles_with_and_without_colours_make_one_picture(tmp_path: Path) -> None:
    alpha, through = pane()
    grey = np.repeat((1 - alpha)[..., None], 3, axis=-1)
    for name, what in (("a", through), ("b", grey)):
        (tmp_path / name).mkdir()
        field(tmp_path / name, alpha, what)
    tinted, plain = (Field(tmp_path / name / "f") for name in "ab")
    both = Field(tmp_path / "a" / "f")
    moved = plain.tiles[0]
    moved.region = type(moved.region)(0, SHAPE[0], SHAPE[1], SHAPE[0])
    both.tiles = [tinted.tiles[0], moved]
    np.testing.assert_allclose(both.tiles[1].through(), grey, atol=1e-3)
    assert both.tinted
    assert merged(both).tinted
    np.testing.assert_allclose(
        np.concatenate([through, grey]), merged(both).tiles[0].through(), atol=1e-3
    )


def test_live_shows_the_world_through_tinted_glass(tmp_path: Path) -> None:
    alpha, through = pane()
    preview = Preview([field(tmp_path, alpha, through)])
    view = np.zeros((*SHAPE, 3), np.float32)
    view[..., 1] = 1
    dark = np.full((16, 32, 3), 1e-9, np.float32)
    lit = np.full((16, 32, 3), 0.5, np.float32)
    found = show(preview, Wish(lit, 1.0, 0.0, 1.0, {}, True, view)).picture
    light = preview.picture(PatchLight(Environment(lit), CUBE))[..., :3]
    np.testing.assert_allclose(found[..., :3] - light, 0.5 * through, atol=2e-3)
    assert found[5, 12, 3] == 1
    assert found[0, 12, 3] == 0
    assert show(preview, Wish(dark, 1.0, 0.0, 1.0, {}, True, None)).picture[5, 0, 3] == 0


@pytest.mark.parametrize("sign", [-0.02, 0.02])
def test_lamps_may_take_light_away(tmp_path: Path, sign: float) -> None:
    """A picture is the sum of what patches and the scene's own lamps give, whatever its sign."""
    own = np.full((*SHAPE, 3), sign, np.float32)
    own[:4] *= 50
    found = field(tmp_path, np.ones(SHAPE), None, own=own)
    np.testing.assert_allclose(own_light(found), own, atol=1e-5)
    light = PatchLight(Environment(np.ones((16, 32, 3), np.float32)), CUBE)
    shown = Preview([found]).picture(light)[..., :3]
    np.testing.assert_allclose(shown, 0.3 + own, atol=1e-3)


def test_layers_that_take_light_away_stay_as_they_are() -> None:
    sun, dark = np.full((2, 2, 3), 0.8), np.full((2, 2, 3), -0.3)
    rest, whole = np.full((2, 2, 3), 0.1), np.full((2, 2, 3), 0.7)
    parts = share_out([sun, dark, rest], whole, signed=[1])
    np.testing.assert_allclose(parts[1], dark)
    np.testing.assert_allclose(sum(parts), whole, atol=1e-6)
    np.testing.assert_allclose(parts[0], 8 * parts[2], atol=1e-6)


def test_alpha_with_the_world_behind() -> None:
    alpha = np.array([[0.0, 0.6, 0.25, 0.25]], np.float32)
    through = np.array([[[1.0] * 3, [0.4] * 3, [0.25] * 3, [0.75, 1.5, 0.0]]], np.float32)
    np.testing.assert_allclose(opaque(alpha, through), [[1, 1, 0.5, 1]], atol=1e-6)
