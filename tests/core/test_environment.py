"""Environment maps: which texel shines from where, and how much of the sphere it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from arto.core import exr
from arto.core.errors import EnvironmentMapError, ExrError
from arto.core.light.environment import Environment, sample_directions
from hypothesis import given
from hypothesis import strategies as st


def test_texels_shine_from_where_cycles_puts_them() -> None:
    image = np.zeros((16, 32, 3), np.float32)
    image[:, 16] = 1  # u just over 0.5
    image[:, 8] = 2  # u = 0.25
    image[0] = 5
    image[-1] = 7
    e = Environment(image)
    a = 1e-3
    d = np.array([[1, -a, 0], [a, 1, 0], [0, 0, 1], [0, 0, -1], [-1, 0, 0], [0, -1, 0]])
    # +x in the middle, +y a quarter to the left of it, up in the first row
    assert e.at(d)[:, 0].tolist() == [1, 2, 5, 7, 0, 0]


def test_every_texel_is_found_at_its_own_direction(noisy, texel_directions) -> None:
    e = noisy(0, 16)
    np.testing.assert_array_equal(e.at(3 * texel_directions(16, 32)), e.image)


@pytest.mark.parametrize("finer", [1, 3])
def test_samples_are_the_texels_directions(texel_directions, finer: int) -> None:
    azimuth, latitude, weight = sample_directions(8, 20, finer)
    d = texel_directions(8 * finer, 20 * finer)
    np.testing.assert_allclose(np.cos(latitude)[:, None, None] * azimuth, d[..., :2], atol=1e-14)
    np.testing.assert_allclose(np.sin(latitude), d[:, 0, 2], atol=1e-14)
    assert weight.sum() * len(azimuth) == pytest.approx(4 * np.pi, rel=1e-13)


@given(height=st.integers(2, 64), width=st.integers(2, 99))
def test_texels_share_the_sphere(height: int, width: int) -> None:
    e = Environment(np.full((height, width, 3), 0.25, np.float32))
    assert e.row_solid_angles.sum() * width == pytest.approx(4 * np.pi, rel=1e-12)
    np.testing.assert_allclose(e.irradiance(), np.pi, rtol=1e-6)
    np.testing.assert_allclose(e.row_solid_angles, e.row_solid_angles[::-1])


def test_irradiance_is_the_integral_of_the_light(texel_directions) -> None:
    """z^2 integrates to 4 pi / 3 over the sphere, a constant to 4 pi, x to nothing."""
    d = texel_directions(128, 256)
    image = np.stack([d[..., 2] ** 2, np.ones(d.shape[:2]), d[..., 0]], axis=-1)
    found = Environment(image.astype(np.float32)).irradiance()
    np.testing.assert_allclose(found, [4 * np.pi / 3, 4 * np.pi, 0], rtol=1e-3, atol=1e-5)


def test_uniform() -> None:
    e = Environment.uniform((1.0, 2.0, 3.0), 8)
    assert e.image.shape == (8, 16, 3) and e.image.dtype == np.float32
    assert (e.image == [1, 2, 3]).all()


@pytest.mark.parametrize("shape", [(4, 8), (4, 8, 4), (1, 8, 3), (4, 1, 3)])
def test_an_image_of_another_shape_is_no_map(shape: tuple[int, ...]) -> None:
    with pytest.raises(EnvironmentMapError, match="three channels"):
        Environment(np.ones(shape, np.float32))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_bad_texel_is_refused(bad: float) -> None:
    image = np.ones((4, 8, 3), np.float32)
    image[2, 5, 1] = bad
    with pytest.raises(EnvironmentMapError, match="infinite or not a number: repair"):
        Environment(image)


@pytest.mark.parametrize("channels", ["RGB", "RGBA", "RGBAZ"])
def test_load_takes_the_colour_whatever_stands_beside_it(tmp_path: Path, channels: str) -> None:
    import OpenEXR

    rng = np.random.default_rng(0)
    planes = {c: rng.random((4, 8)).astype(np.float16) for c in channels}
    head = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    path = tmp_path / "map.exr"
    OpenEXR.File(head, dict(planes)).write(str(path))
    found = Environment.load(path).image
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, np.stack([planes[c] for c in "RGB"], axis=-1))


def test_load_passes_over_parts_without_colour(tmp_path: Path) -> None:
    colour = np.random.default_rng(0).random((4, 8, 3), np.float32)
    exr.write(tmp_path / "map.exr", {"depth": np.ones((4, 8)), "sky": colour})
    np.testing.assert_array_equal(Environment.load(tmp_path / "map.exr").image, colour)
    exr.write(tmp_path / "grey.exr", {"depth": np.ones((4, 8))})
    with pytest.raises(EnvironmentMapError, match=r"grey\.exr has no colour"):
        Environment.load(tmp_path / "grey.exr")
    with pytest.raises(ExrError, match="there is no file"):
        Environment.load(tmp_path / "none.exr")


def test_a_coarser_map_has_the_same_light(noisy) -> None:
    """Texels count by their solid angle: what all directions bring stays, turned or not."""
    fine = noisy(4, 64)
    coarse = fine.coarser(4)
    assert coarse.image.shape == (16, 32, 3)
    np.testing.assert_allclose(coarse.irradiance(), fine.irradiance(), rtol=1e-5)


def test_how_much_light_is_below_zero() -> None:
    """A band of -1 around the horizon in a world of 1: by solid angle, half of a sphere is within
    30 degrees of its equator."""
    image = np.ones((180, 360, 3), np.float32)
    assert Environment(image).below_zero == 0
    assert Environment(0 * image).below_zero == 0
    image[60:120] = -1
    assert Environment(image).below_zero == pytest.approx(0.5)
