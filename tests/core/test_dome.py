"""The cells of a dome's lamps are patches: they hold the sphere's light, and a hole is told."""

from __future__ import annotations

import numpy as np
import pytest
from arto.core.dome import own_reach
from arto.core.errors import HemicubeError
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from numpy.typing import NDArray

TURNED = ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))


def spread(count: int) -> NDArray[np.float64]:
    """Directions that are spread evenly over the sphere."""
    z = 1 - (2 * np.arange(count) + 1) / count
    turn, flat = np.arange(count) * 2.399963, np.sqrt(1 - z * z)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)


def of(lamps: NDArray, reach: float = 180.0, **more: object) -> Hemicube:
    return Hemicube(lamps=tuple(map(tuple, lamps.tolist())), reach=reach, **more)  # type: ignore


def test_cells_fill_the_sphere_and_hold_their_lamps() -> None:
    lamps = spread(40)
    dome = of(lamps, orientation=TURNED)
    assert dome.closed and abs(dome.solid_angles.sum() - 4 * np.pi) < 1e-9
    world = lamps @ np.array(TURNED).T
    patch, u, v = dome.locate(world)
    assert patch.tolist() == list(range(40))
    np.testing.assert_allclose([u, v], 0.5, atol=1e-9)
    # a place of a cell is where its patch coordinates say
    near = np.array([dome.directions(k, np.array(0.4), np.array(0.55)) for k in range(40)])
    patch, u, v = dome.locate(near)
    assert patch.tolist() == list(range(40))
    np.testing.assert_allclose([u, v], [[0.4] * 40, [0.55] * 40], atol=1e-9)


def test_a_hole_is_what_no_lamp_reaches() -> None:
    one = of(np.array([[0.0, 0.0, 1.0]]), reach=60.0)
    assert not one.closed
    # a cap of 60 degrees is a quarter of the sphere
    assert abs(one.solid_angles[0] - np.pi) < 0.01 and abs(one.partition.hole - 3 * np.pi) < 0.01  # type: ignore
    above = spread(80)
    above = above[above[:, 2] > 0]
    half = of(above, own_reach(above))
    # lamps over the ground stand for the sky, and for a rim below it
    assert 0.35 < half.partition.hole / (4 * np.pi) < 0.5  # type: ignore


def test_light_of_the_cells_is_the_worlds() -> None:
    z = np.cos((np.arange(64) + 0.5) / 64 * np.pi)
    image = np.broadcast_to((1 + z)[:, None, None], (64, 128, 3)).astype(np.float32)
    dome = of(spread(60))
    light = PatchLight(Environment(image), dome).whole
    # the mean of 1 + z over a cell is that of its middle, where cells are small and even
    np.testing.assert_allclose(light[:, 0], 1 + spread(60)[:, 2], atol=0.06)
    total = dome.solid_angles @ light
    np.testing.assert_allclose(total, 4 * np.pi, rtol=0.005)


def test_a_dome_is_described_and_other_hemicubes_as_before() -> None:
    dome = of(spread(12), 30.0)
    assert Hemicube.from_json(dome.to_json()) == dome
    assert not {"lamps", "reach"} & Hemicube().to_json().keys()
    twice = np.concatenate([spread(12), spread(12)[:1]])
    with pytest.raises(HemicubeError, match="lamps 0 and 12 have one direction"):
        of(twice)
    with pytest.raises(HemicubeError, match="of length 1"):
        of(2 * spread(12))
