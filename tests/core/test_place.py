"""Where a light is put for a pixel, against planted fields."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from arto.core.capture.moments import Moments
from arto.core.errors import FieldError
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment
from arto.core.place.lobes import Lobes, lobes_at, unit
from arto.core.place.lobes import _parts as parts_of
from arto.core.place.place import facing, grazing, normal_at, reflected, shading
from arto.core.supports import PER_CHANNEL, SUPPORTS

CUBE = Hemicube(patches=2)
UP = np.array([0.0, 0.0, 1.0])


def apart(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip(a @ b, -1, 1))))


def matt(normal: np.ndarray, count: int = 400, seed: int = 1) -> Lobes:
    """A matt place in the open: light from each side by the cosine, in narrow noisy lobes."""
    around = np.random.default_rng(seed).normal(size=(count, 3))
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    weight = np.maximum(around @ normal, 0) * 4 / count
    return Lobes(around[weight > 0], np.full((weight > 0).sum(), 0.02), weight[weight > 0])


def joined(*several: Lobes) -> Lobes:
    return Lobes(*(np.concatenate([getattr(a, n) for a in several]) for n in vars(several[0])))


def one(direction: np.ndarray, spread: float, weight: float) -> Lobes:
    return Lobes(unit(direction)[None], np.array([spread]), np.array([weight]))


def test_lobes_are_where_the_boxes_were_planted(tmp_path: Path, scene, write_scene, fitted) -> None:
    made = scene(CUBE, (9, 11))
    field = fitted(write_scene(tmp_path / "capture", made), tmp_path / "f", "box")
    for y, x in ((2, 3), (7, 5)):
        lobes = lobes_at(field, x, y)
        best = int(lobes.weight.argmax())
        k = int(made.coefficient[:, y, x].mean(axis=-1).argmax())
        u0, u1, v0, v1 = made.boxes[k, y, x]
        middle = CUBE.directions(k, np.array((u0 + u1) / 2), np.array((v0 + v1) / 2))
        assert apart(lobes.direction[best], middle) < 1.0
        corner = CUBE.directions(k, np.array(u1), np.array(v1))
        assert np.degrees(lobes.spread[best]) < apart(middle, corner)
    with pytest.raises(FieldError):
        lobes_at(field, 11, 0)


@pytest.mark.parametrize("name", [n for n in SUPPORTS if n not in ("whole", "double")])
def test_the_lobe_of_a_narrow_entry_is_narrow_and_there(name: str) -> None:
    """Of light from one small place of a patch, as each model is fitted to it."""
    u, v, half = 0.3, 0.6, 0.02
    values = np.array([1.0, u, u * u + half**2 / 3, v, v * v + half**2 / 3, u * v])
    plain = Moments(np.ones((1, 3)), values[:, None], CUBE.extent(3))
    moments = Moments(np.ones((1, 3)), values[:, None], CUBE.extent(3), (plain,) * 3)
    parameters = SUPPORTS[name].fit(moments)[0]
    ((weight, at_u, at_v, half_u, half_v),) = parts_of(name, parameters, np.full(3, 0.5))
    assert (weight, at_u, at_v) == pytest.approx((0.5, u, v), abs=0.01)
    assert max(half_u, half_v) < (1.0 if name == "linear" else 0.05)
    three = parts_of(f"{name}_rgb", PER_CHANNEL[name].fit(moments)[0], np.full(3, 0.5))
    assert [part[0] for part in three] == pytest.approx([0.5 / 3] * 3)
    assert all(part[1:] == pytest.approx((at_u, at_v, half_u, half_v)) for part in three)


@pytest.mark.parametrize("coat", [0.04, 0.9])
def test_a_weak_reflection_is_found_over_a_bright_base(coat: float) -> None:
    there = unit(np.array([0.3, -0.5, 0.6]))
    lobes = joined(matt(UP), one(there, 0.01, coat))
    found = reflected(lobes, None, None)
    assert found.by == "field" and apart(found.direction, there) < 2.0 and found.spread < 5


def test_a_reflection_across_the_seams_of_patches_is_one() -> None:
    there = unit(np.array([1.0, 0.02, 0.01]))
    parts = [one(there + 0.05 * np.array([0, a, b]), 0.03, 0.25) for a in (-1, 1) for b in (-1, 1)]
    found = reflected(joined(*parts), None, None)
    assert apart(found.direction, there) < 0.5


def test_a_matt_place_is_mirrored_by_its_normal() -> None:
    eye = unit(np.array([1.0, 0.0, -1.0]))
    found = reflected(matt(UP), UP, eye)
    assert found.by == "normal" and apart(found.direction, unit(np.array([1.0, 0, 1]))) < 0.1
    with pytest.raises(FieldError, match="nothing stands"):
        reflected(Lobes(np.zeros((0, 3)), np.zeros(0), np.zeros(0)), None, None)


def test_a_place_faces_along_its_normal_unless_something_stands_there() -> None:
    tilted = unit(np.array([0.5, 0.0, 1.0]))
    assert facing(matt(tilted), tilted).direction @ tilted > 0.999
    # without a normal, the even light of a matt place tells it
    assert apart(facing(matt(tilted, 4000), None).direction, tilted) < 4
    open_ = matt(UP, 4000)
    covered = open_.only(open_.direction[:, 0] > 0.5)  # a roof leaves light from one side alone
    found = facing(covered, UP)
    assert found.by == "field" and found.direction[0] > 0.5


def test_a_rim_light_grazes_from_behind() -> None:
    eye = unit(np.array([0.0, 1.0, -0.2]))
    normal = unit(np.array([0.2, -1.0, 0.3]))
    found = grazing(matt(normal, 4000), normal, eye)
    assert 5 < 90 - apart(found.direction, normal) < 30
    front = grazing(matt(UP, 4000), UP, eye)
    assert front.direction @ eye > 0.5


def test_a_flag_stands_before_the_sun() -> None:
    image = np.full((90, 180, 3), 0.1, np.float32)
    image[20:22, 40:42] = 500.0
    environment = Environment(image, turn=0.4)
    lat, azimuth = np.radians(90 - 42 + 0.0), (0.5 - 41 / 180) * 2 * np.pi - 0.4
    sun = np.array([np.cos(azimuth) * np.cos(lat), np.sin(azimuth) * np.cos(lat), np.sin(lat)])
    found = shading(matt(UP, 2000), environment)
    assert apart(found.direction, sun) < 3
    # a place that the sun does not reach is shaded from elsewhere
    away = matt(UP, 2000)
    away = away.only(away.direction @ sun < 0.3)
    assert apart(shading(away, environment).direction, sun) > 40
    with pytest.raises(FieldError, match="no light"):
        shading(matt(UP), Environment.uniform(0.0))


def test_normals_are_those_of_the_places() -> None:
    x, y = np.meshgrid(np.arange(8.0), np.arange(6.0))
    position = np.stack([x, 7 - y, 5 + 0.5 * x], axis=-1)
    normal = unit(np.array([-0.5, 0.0, 1.0]))
    found = normal_at(position, 3, 3, np.array([0.0, 0.0, -1.0]))
    assert found is not None and apart(found, normal) < 0.01
    position[:, 4:] += 100  # another thing begins here
    found = normal_at(position, 3, 3, np.array([0.0, 0.0, -1.0]))
    assert found is not None and apart(found, normal) < 0.01
    assert normal_at(np.zeros((4, 4, 3)), 1, 1, np.array([0.0, 0.0, -1.0])) is None
