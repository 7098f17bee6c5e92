"""A look inside: the parts of a pixel are its light, the unfolded hemicube is what is around."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from arto.core.errors import FieldError
from arto.core.hemicube import Hemicube
from arto.core.inside import drawn, parts_at, shares_at, unfolded
from arto.core.light.environment import Environment
from arto.core.light.layers import by_faces
from arto.core.light.light import PatchLight
from arto.core.relight import relight

CUBE = Hemicube(patches=2)
SHAPE = (9, 11)


@pytest.fixture
def made(scene):
    return scene(CUBE, SHAPE)


@pytest.fixture
def field(tmp_path: Path, made, write_scene, fitted):
    return fitted(write_scene(tmp_path / "capture", made), tmp_path / "f", "box")


def test_parts_sum_to_the_pixel(field, noisy) -> None:
    light = PatchLight(noisy(2, 64), CUBE)
    picture = relight(field, light, 0.0)
    for y, x in ((0, 0), (4, 7), (8, 10)):
        total = sum(p.light for p in parts_at(field, light, x, y))
        pixel = (y * SHAPE[1]) + x
        rest = (
            field.tiles[0].rest(slice(pixel, pixel + 1))
            if field.tiles[0].rest_weights is not None
            else 0
        )
        assert np.all(np.abs(total - picture[y, x, :3]) <= 1e-4 + np.abs(rest) * 20)


def test_a_planted_box_comes_back(field, made, noisy) -> None:
    """The brightest entries of a pixel are of the boxes that were planted."""
    light = PatchLight(noisy(2, 64), CUBE)
    for y, x in ((2, 3), (7, 5)):
        for part in parts_at(field, light, x, y)[:4]:
            np.testing.assert_allclose(part.box, made.boxes[part.patch, y, x], atol=0.02)
            planted = made.coefficient[part.patch, y, x]
            np.testing.assert_allclose(part.reflects, planted, rtol=0.05, atol=0.02)


def test_shares_sum_to_one_and_name_the_only_light(field) -> None:
    image = np.zeros((64, 128, 3), np.float32)
    environment = Environment(image)
    faces = by_faces(environment, CUBE)
    image[faces["left"] > 0] = 3.0
    found = shares_at(field, Environment(image), 4, 4, faces)
    assert sum(found.values()) == pytest.approx(1, abs=1e-6)
    assert next(iter(found)) == "left" and found["left"] > 0.98


def test_no_light_is_no_share(field) -> None:
    dark = Environment.uniform(0.0)
    found = shares_at(field, dark, 4, 4, by_faces(dark, CUBE))
    assert set(found.values()) == {0.0}


def test_outside_the_picture(field, noisy) -> None:
    light = PatchLight(noisy(2, 64), CUBE)
    for x, y in ((-1, 0), (11, 0), (0, 9)):
        with pytest.raises(FieldError, match="nothing was captured"):
            parts_at(field, light, x, y)


@pytest.mark.parametrize("patches", [1, 2])
def test_the_unfolded_hemicube_hangs_together(patches: int) -> None:
    """Every face is at its place, and along each edge of the cross the directions go on."""
    side = 32
    cube = Hemicube(patches=patches)
    around, patch, _, _ = unfolded(cube, side)
    d = around / np.maximum(np.linalg.norm(around, axis=-1, keepdims=True), 1e-9)
    places = {"top": (0, 1), "left": (1, 0), "back": (1, 1), "right": (1, 2), "front": (1, 3)}
    normals = {"top": (0, 0, 1), "left": (-1, 0, 0), "back": (0, 1, 0), "right": (1, 0, 0)}
    for face, (row, column) in places.items():
        middle = d[row * side + side // 2, column * side + side // 2]
        if face in normals:
            assert middle @ np.array(normals[face]) > 0.99
    there = patch >= 0
    assert there.sum() == 6 * side * side
    step = 2 / side * 1.6
    across = np.linalg.norm(np.diff(d, axis=1), axis=-1)[there[:, 1:] & there[:, :-1]]
    down = np.linalg.norm(np.diff(d, axis=0), axis=-1)[there[1:] & there[:-1]]
    assert across.max() < step and down.max() < step


def test_supports_are_drawn_where_they_are(field, noisy) -> None:
    """Orange is on the patches that give light, and nowhere else."""
    environment = noisy(2, 64)
    parts = parts_at(field, PatchLight(environment, CUBE), 4, 4)[:1]
    picture = drawn(CUBE, environment, parts, side=64)
    _, patch, u, v = unfolded(CUBE, 64)
    orange = np.isclose(picture[..., :3], (1.0, 0.35, 0.02)).all(axis=-1)
    assert orange.any() and set(patch[orange]) == {parts[0].patch}
    u0, u1, v0, v1 = parts[0].box
    assert u[orange].min() >= u0 and u[orange].max() <= u1
    assert v[orange].min() >= v0 and v[orange].max() <= v1
    assert (picture[..., 3] == (patch >= 0)).all()
