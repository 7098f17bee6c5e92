"""Light on the patches: their averages keep the energy of the map (paper 6)."""

from __future__ import annotations

import numpy as np
import pytest
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from arto.core.supports import BOX


@pytest.mark.parametrize("patches", [8, 16])
def test_no_corner_of_a_fine_cube_is_without_light(noisy, patches: int) -> None:
    """Bins at the cube's corners are narrow: one that no sample met must not divide by nothing,
    and must show what the map holds there."""
    cube, e = Hemicube(patches=patches), noisy(4, 32)
    light = PatchLight(e, cube)
    k = np.arange(len(cube))
    for corner in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)):
        u, v = (np.full(len(cube), t) for t in corner)
        found = light.box(k, u, u, v, v)
        assert (found >= e.image.min() * 0.999).all() and (found <= e.image.max() * 1.001).all()
    # and it takes next to nothing from the energy of the others
    total = light.binned.sum(axis=(0, 1, 2))
    np.testing.assert_allclose(total[:3], e.irradiance(), rtol=2e-6)
    assert total[3] == pytest.approx(4 * np.pi, rel=2e-6)


@pytest.mark.parametrize("turned", [0, 1, 2])
@pytest.mark.parametrize("patches", [1, 2, 4, 8])
def test_flux_is_kept(rotation, noisy, patches: int, turned: int) -> None:
    """The patches' averages times their solid angles are the integral of the map."""
    turn = {"orientation": rotation(turned)} if turned else {}
    cube, e = Hemicube(patches=patches, **turn), noisy(turned, 128)
    flux = cube.solid_angles @ PatchLight(e, cube).whole
    np.testing.assert_allclose(flux, e.irradiance(), rtol=1e-3)


def test_directions_without_a_patch_give_no_light(noisy) -> None:
    e = noisy(0, 64)
    whole = PatchLight(e, Hemicube())
    some = PatchLight(e, Hemicube(faces=("back", "top"), half_sides=True))
    cube = whole.hemicube
    np.testing.assert_allclose(some.whole[-16:], whole.whole[cube.face_slice("top")], rtol=1e-12)
    upper = whole.whole[cube.face_slice("back")][8:]
    np.testing.assert_allclose(some.whole[:8], upper, rtol=0.01)
    assert some.binned[..., 3].sum() == pytest.approx(4 * np.pi / 6 * 1.5, rel=1e-3)


RADIUS, RIM = 0.25, 0.1  # degrees


def sun_at(direction: np.ndarray, texels: np.ndarray, radiance: float) -> Environment:
    """A disc of half a degree on black, each texel with the share of it that the disc covers.

    Its rim fades over a tenth of a degree, so that 16 x 16 points of a texel are enough.
    """
    height, width = texels.shape[:2]
    image = np.zeros((height, width, 3), np.float32)
    row, column = np.nonzero(texels @ direction > np.cos(np.radians(0.9)))
    t = (np.arange(16) + 0.5) / 16
    latitude = np.pi / 2 - np.pi * (row[:, None, None] + t[:, None]) / height
    azimuth = (0.5 - (column[:, None, None] + t) / width) * 2 * np.pi
    cosine = np.cos(latitude) * (direction[0] * np.cos(azimuth) + direction[1] * np.sin(azimuth))
    angle = np.degrees(np.arccos(np.minimum(cosine + np.sin(latitude) * direction[2], 1)))
    covered = np.clip((RADIUS - angle) / RIM + 0.5, 0, 1).mean(axis=2)
    share = np.cos(latitude[..., 0])
    lit = (covered * share).sum(axis=1) / share.sum(axis=1)
    image[row, column] = radiance * lit[:, None]
    return Environment(image)


def test_a_sun_of_half_a_degree_keeps_its_energy(rotation, texel_directions) -> None:
    """Anywhere: on the border of patches, of faces, at a corner of the cube, at the poles."""
    cube = Hemicube(orientation=rotation(7))
    rng = np.random.default_rng(0)
    places = [*rng.normal(size=(3, 3)), np.array([0, 0, 1.0]), np.array([1e-4, 0, -1.0])]
    for _ in range(2):
        k, t = int(rng.integers(len(cube))), rng.random()
        places += [cube.directions(k, 0, t), cube.directions(k, t, 1), cube.directions(k, 1, 1)]
    places.append(cube.directions(0, 0, 0))
    texels = texel_directions(512, 1024)
    for place in places:
        sun = sun_at(place / np.linalg.norm(place), texels, 1e5)
        # what such a disc gives: the integral over its radius, the fading rim included
        energy = 1e5 * np.pi * np.radians(1) ** 2 * (RADIUS**2 + RIM**2 / 12)
        np.testing.assert_allclose(sun.irradiance(), energy, rtol=0.01)
        light = PatchLight(sun, cube)
        np.testing.assert_allclose(cube.solid_angles @ light.whole, sun.irradiance(), rtol=0.01)
        # and it stands where it should: in the box of two degrees around its place
        k, u, v = (x[0] for x in cube.locate(place[None]))
        x = cube.extents[k]
        reach = np.radians(1.5) * 2 / (x[1] - x[0])
        box = np.clip([[u - reach, u + reach, v - reach, v + reach]], 0, 1)
        inside = BOX.average(light, int(k), box)[0, 0]
        lit = light.binned[k, ..., 0].sum()
        part = box_solid_angle(cube, int(k), box[0])
        # nothing of the patch's light lies outside; the box's own solid angle comes from samples
        assert inside * part == pytest.approx(lit, rel=0.05)


def box_solid_angle(cube: Hemicube, k: int, box: np.ndarray, n: int = 64) -> float:
    x0, x1, y0, y1 = cube.extents[k]
    t = (np.arange(n) + 0.5) / n
    x = x0 + (x1 - x0) * (box[0] + (box[1] - box[0]) * t)
    y = y0 + (y1 - y0) * (box[2] + (box[3] - box[2]) * t)
    weight = (1 + x**2 + y[:, None] ** 2) ** -1.5
    area = (x1 - x0) * (y1 - y0) * (box[1] - box[0]) * (box[3] - box[2])
    return float(weight.mean() * area)


LEAVES = (
    *(
        ("top", 1, 0, 0),
        ("bottom", 1, 0, 0),
        ("left", 2, 0, 0),
        ("left", 2, 0, 1),
        ("left", 2, 1, 0),
    ),
    *(
        ("left", 4, 2, 2),
        ("left", 4, 2, 3),
        ("left", 4, 3, 2),
        ("left", 8, 6, 6),
        ("left", 8, 6, 7),
    ),
    *(("left", 8, 7, 6), ("left", 16, 14, 14), ("left", 16, 14, 15), ("left", 16, 15, 14)),
    *(("left", 16, 15, 15), ("right", 1, 0, 0), ("back", 1, 0, 0), ("front", 1, 0, 0)),
)


def test_patches_of_different_size_share_the_light(noisy) -> None:
    """Each leaf sees of the map what the patches of its grid see; all together see all."""
    e = noisy(3, 128)
    light = PatchLight(e, Hemicube(leaves=LEAVES))
    flux = light.hemicube.solid_angles @ light.whole
    np.testing.assert_allclose(flux, e.irradiance(), rtol=1e-3)
    for n in (1, 2, 4, 8, 16):
        grid = PatchLight(e, Hemicube(patches=n))
        for k, (face, side, row, column) in enumerate(LEAVES):
            if side != n:
                continue
            alike = grid.hemicube.grid.index((face, row, column))
            np.testing.assert_allclose(light.whole[k], grid.whole[alike], rtol=0.02)
            u0, u1, v0, v1 = (np.array([t]) for t in (0.25, 0.75, 0.5, 1.0))
            one, two = light.box(k, u0, u1, v0, v1), grid.box(alike, u0, u1, v0, v1)
            np.testing.assert_allclose(one, two, rtol=0.05)
    with pytest.raises(ValueError, match="differ in size"):
        _ = light.resolution


def test_uniform_light_is_uniform_on_patches_of_any_size() -> None:
    light = PatchLight(Environment.uniform((0.3, 2, 40), 64), Hemicube(leaves=LEAVES))
    np.testing.assert_allclose(light.whole, np.tile((0.3, 2, 40), (len(LEAVES), 1)), rtol=1e-6)
    linear = light.polynomial((0, 1, 3))
    np.testing.assert_allclose(linear[:, 0], light.whole, rtol=1e-5)
    np.testing.assert_allclose(linear[:, 1:], 0, atol=1e-3)
