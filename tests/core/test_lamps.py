"""Lamps are cut out of the map, and nothing is lost."""

from __future__ import annotations

import numpy as np
import pytest
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment
from arto.core.light.lamps import CONTRAST, WORTH, split
from hypothesis import given
from hypothesis import strategies as st

HEIGHT, WIDTH = 64, 128


def sky(radiance: float = 1.0) -> np.ndarray:
    """A soft sky: brighter above, coloured."""
    up = np.linspace(1.5, 0.5, HEIGHT)[:, None, None]
    image = np.broadcast_to(radiance * up * (0.7, 0.9, 1.2), (HEIGHT, WIDTH, 3))
    return image.astype(np.float32)


def with_lamp(image: np.ndarray, radiance: tuple[float, float, float], size: int = 2) -> np.ndarray:
    out = image.copy()
    out[20 : 20 + size, 40 : 40 + size] = radiance
    return out


@given(
    seed=st.integers(0, 1000),
    bright=st.floats(1, 1e5),
    contrast=st.floats(2, 100),
)
def test_the_parts_add_up_to_the_map(seed: int, bright: float, contrast: float) -> None:
    rng = np.random.default_rng(seed)
    image = rng.gamma(0.3, size=(HEIGHT, WIDTH, 3)).astype(np.float32)
    image = with_lamp(image, (bright, bright / 2, bright / 4))
    found = split(Environment(image), contrast=contrast)
    total = found.rest.image.astype(np.float64) + found.lamps.image
    np.testing.assert_allclose(total, image, rtol=2e-7)
    assert (found.rest.image >= 0).all() and (found.lamps.image >= 0).all()
    lit = found.lamps.irradiance().sum() / Environment(image).irradiance().sum()
    assert found.share == pytest.approx(lit, abs=1e-6)


def test_a_sun_is_found_and_only_the_sun() -> None:
    image = with_lamp(sky(), (5000, 4000, 3000))
    found = split(Environment(image))
    inside = (slice(20, 22), slice(40, 42))
    np.testing.assert_array_less(0.99 * image[inside], found.lamps.image[inside])
    elsewhere = found.lamps.image.copy()
    elsewhere[inside] = 0
    assert not elsewhere.any()
    # what stays of the sun is as bright as the rest of the sky makes a lamp begin
    radiance = found.rest.image.sum(axis=-1)
    mean = (radiance * found.rest.row_solid_angles[:, None]).sum() / (4 * np.pi)
    assert radiance[inside].max() == pytest.approx(CONTRAST * mean, rel=1e-4)
    assert found.worth and 0.5 < found.share < 1


def test_the_cut_keeps_the_colour() -> None:
    found = split(Environment(with_lamp(sky(), (9000, 300, 30))))
    for part in (found.lamps, found.rest):
        colour = part.image[20, 40] / part.image[20, 40, 0]
        np.testing.assert_allclose(colour, (1, 1 / 30, 1 / 300), rtol=1e-4)


@pytest.mark.parametrize(
    "image",
    [sky(), np.ones((HEIGHT, WIDTH, 3), np.float32), np.zeros((HEIGHT, WIDTH, 3), np.float32)],
    ids=["sky", "white", "black"],
)
def test_soft_light_has_no_lamps(image: np.ndarray) -> None:
    found = split(Environment(image))
    assert not found.lamps.image.any() and found.share == 0 and not found.worth


def test_half_the_sphere_is_no_lamp() -> None:
    image = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    image[: HEIGHT // 2] = 1e4
    assert not split(Environment(image)).worth


def test_a_lamp_in_darkness_is_all_there_is() -> None:
    found = split(Environment(with_lamp(np.zeros((HEIGHT, WIDTH, 3), np.float32), (3, 3, 3))))
    assert found.share == pytest.approx(1, abs=1e-6)


def test_exposure_and_turning_change_nothing() -> None:
    image = with_lamp(sky(), (500, 400, 300))
    found = split(Environment(image))
    brighter = split(Environment(image * np.float32(1024)))
    np.testing.assert_allclose(brighter.lamps.image, found.lamps.image * 1024, rtol=1e-5)
    turned = split(Environment(np.roll(image, 31, axis=1)))
    np.testing.assert_allclose(
        turned.lamps.image, np.roll(found.lamps.image, 31, axis=1), rtol=1e-5
    )


def test_light_without_a_patch_is_neither_lamp_nor_counted() -> None:
    """A sun below the horizon of a hemicube without a bottom, and one above it."""
    upper = Hemicube(faces=("top", "left", "right", "back", "front"), half_sides=True)
    image = with_lamp(sky(), (500, 500, 500))
    below = image.copy()
    below[50:52, 40:42] = 5e5
    one, two = (split(Environment(i), upper) for i in (image, below))
    assert one.share == pytest.approx(two.share) and two.share > WORTH
    assert not two.lamps.image[HEIGHT // 2 :].any()
