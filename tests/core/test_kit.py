"""The light kit on arrays: its energy, its files, its names."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from arto.core.errors import KitError
from arto.core.kit import kit_file
from arto.core.kit.light import Blend, Kind, Light
from arto.core.kit.model import Base, BaseKind, Kit
from arto.core.kit.shine import aimed, frame, map_of, over

SHAPES = [
    (Kind.RECTANGLE, 40, 20),
    (Kind.RECTANGLE, 170, 100),
    (Kind.ROUND, 30, 30),
    (Kind.RING, 50, 50),
    (Kind.SUN, 0.53, 1),
]


@pytest.mark.parametrize(("kind", "width", "height"), SHAPES)
@pytest.mark.parametrize("elevation", [10.0, 89.0])
def test_a_light_has_the_energy_of_its_shape(
    kind: Kind, width: float, height: float, elevation: float
) -> None:
    light = Light("a", kind, width=width, height=height, azimuth=179, elevation=elevation, roll=20)
    found = map_of(Kit((light,)), 180).irradiance()[0]
    assert found == pytest.approx(light.radiance[0] * light.solid_angle, rel=6e-3)


def test_a_sun_lights_a_place_that_faces_it_by_its_strength() -> None:
    sun = Light("sun", Kind.SUN, width=2, elevation=30, strength=4, stops=1)
    image = map_of(Kit((sun,)), 180)
    # so small a sun's light comes from its middle
    assert image.irradiance()[0] == pytest.approx(8, rel=0.02)


def test_lights_blend_as_they_stand() -> None:
    back = Light("back", width=20, height=20, strength=2)
    front = Light("front", Kind.ROUND, width=10, height=10, strength=0.5)
    ahead = np.array([[1.0, 0.0, 0.0]])
    under = over(np.zeros((1, 3)), back, ahead)
    expected = {Blend.ADD: 2.5, Blend.OVER: 0.5, Blend.MULTIPLY: 1.0}
    for blend, value in expected.items():
        light = Light("front", front.kind, blend, width=10, height=10, strength=0.5)
        assert over(under, light, ahead)[0, 0] == pytest.approx(value)
        half = Light("front", front.kind, blend, width=10, height=10, strength=0.5, amount=0.5)
        assert over(under, half, ahead)[0, 0] == pytest.approx(
            2.25 if blend is Blend.ADD else 1.25 if blend is Blend.OVER else 1.5
        )


def test_a_turned_kit_is_its_turned_map() -> None:
    lamp = Light("lamp", azimuth=40, elevation=20, width=30, height=10, roll=15)
    kit = Kit((lamp,), Base(BaseKind.GRADIENT))
    turned = map_of(Kit(kit.lights, kit.base, turn=90.0), 64).image
    # a turn is clockwise from above, and the azimuth of a map falls from left to right
    assert np.allclose(np.roll(map_of(kit, 64).image, 32, axis=1), turned, atol=1e-3)


def test_the_roll_turns_right_to_down() -> None:
    right, _, ahead = frame(Light("a", azimuth=0, roll=90))
    assert np.allclose(ahead, [1, 0, 0]) and np.allclose(right, [0, 0, -1])
    assert aimed(np.array([0.0, 2.0, 2.0])) == pytest.approx((90, 45))


def test_only_solo_lights_are_lit() -> None:
    a, b, c = Light("a"), Light("b", solo=True), Light("c", solo=True, on=False)
    assert [light.name for light in Kit((a, b, c)).lit] == ["b"]
    assert [light.name for light in Kit((a, c)).lit] == ["a"]


def test_a_kit_comes_back_from_its_file(tmp_path: Path) -> None:
    picture = Light("Logo", Kind.PICTURE, Blend.OVER, image="//logo.png", colour=(0.1, 0.5, 1.0))
    kit = Kit(
        (picture, Light("Sun", Kind.SUN, width=0.5, lock=True, kelvin=3000)),
        Base(BaseKind.HDRI, "//studio.exr", turn=30, blur=5),
        Base(BaseKind.GRADIENT, top=(0.0, 0.1, 0.2)),
        turn=10,
    )
    kit_file.save(kit, tmp_path / "kit.json")
    assert kit_file.load(tmp_path / "kit.json") == kit


@pytest.mark.parametrize(
    "wrong",
    [
        {"lights": [{"name": "a", "width": 200}]},
        {"lights": [{"name": "a", "widht": 20}]},
        {"lights": [{"name": "a", "kind": "BLOB"}]},
        {"lights": [{"name": "a"}, {"name": "a"}]},
        {"lights": [{}]},
        {"lights": [{"name": "a", "colour": [1, 2]}]},
        {"lights": [{"name": "a", "colour": [1, 2, -1]}]},
        {"lights": {"a": 1}},
        {"base": []},
        {"backdrop": {"kind": 3}},
        {"turn": math.inf},
        {"arto kit": 99},
        {"strenght": 1},
        {"lights": [{"name": "a\ud800b"}]},
        {"lights": [{"name": "a\0b"}]},
        {"lights": [{"name": "a" * 64}]},
        {"lights": [{"name": "a", "image": "/\udc80.png"}]},
    ],
)
def test_a_wrong_kit_is_refused(wrong: dict, tmp_path: Path) -> None:
    path = tmp_path / "kit.json"
    path.write_text(json.dumps({"arto kit": 1, **wrong}))
    with pytest.raises(KitError):
        kit_file.load(path)
