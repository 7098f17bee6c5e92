"""Photographs of a dome become a capture set: planted lamps, curves and shifts are found.

The photographs are arrays, and a reader that hands them out: no library reads a picture here.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from arto.core.capture.capture_set import CaptureSet
from arto.core.errors import PhotographsError
from arto.core.field.field import Field
from arto.core.fit.fit import fit
from arto.core.light.environment import Environment, sample_directions
from arto.core.light.environment import directions as directions_of
from arto.core.light.light import PatchLight
from arto.core.photographs import agree, ball, curve, dome_set, held_out, lamps
from arto.core.photographs.description import Description, Kind, Lamp, Photograph
from arto.core.photographs.opened import Photographs
from arto.core.photographs.reader import InMemory, Picture
from arto.core.relight import relights
from numpy.typing import NDArray

HEIGHT, WIDTH = 60, 80


def sphere_normals() -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Normals (H, W, 3) of a sphere in the picture, and where it is."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    nx, ny = (x - 39.5) / 26, -(y - 29.5) / 26
    inside = nx * nx + ny * ny < 1
    nz = np.sqrt(np.maximum(1 - nx * nx - ny * ny, 0))
    return np.stack([nx, ny, nz], axis=-1) * inside[..., None], inside


NORMALS, INSIDE = sphere_normals()
ALBEDO = np.array([0.7, 0.5, 0.3])


def around(count: int, lowest: float = 0.25) -> NDArray[np.float64]:
    """Directions of lamps on the camera's side."""
    z = 1 - (1 - lowest) * (np.arange(count) + 0.5) / count
    turn, flat = np.arange(count) * 2.399963, np.sqrt(1 - z * z)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)


def lambert(direction: NDArray, strength: float = 1.0) -> NDArray[np.float64]:
    """The sphere in the light of a far lamp whose irradiance is the strength."""
    return strength * np.maximum(NORMALS @ direction, 0)[..., None] * ALBEDO / np.pi


def textured(seed: int = 0) -> NDArray[np.float64]:
    """Light with edges and with even places, (H, W, 3)."""
    rng = np.random.default_rng(seed)
    blocks = np.exp(rng.uniform(np.log(0.01), np.log(30), (12, 16)))
    return blocks.repeat(5, 0).repeat(5, 1)[..., None] * np.array([1.0, 0.9, 0.8])


def s_curve() -> NDArray[np.float64]:
    """A camera's curve that is no power: sRGB's with more contrast, (1024,) light by value."""
    z = np.linspace(0, 1, 1024)
    bent = np.clip(z + 0.12 * np.sin(2 * np.pi * z) / (2 * np.pi), 0, 1)
    return np.where(bent <= 0.04045, bent / 12.92, ((bent + 0.055) / 1.055) ** 2.4)


def taken(light: NDArray, time: float, table: NDArray, rng: np.random.Generator) -> NDArray:
    """Values of a photograph of eight bits with 0.5% of noise."""
    seen = np.clip(light * time * (1 + rng.normal(0, 0.005, light.shape)), 0, 1)
    return np.rint(np.interp(seen, table, np.linspace(0, 1, len(table))) * 255) / 255


def opened(said: Description, pictures: dict[str, Picture]) -> Photographs:
    return Photographs(Path("there"), said, lambda path: pictures[path.name])


def dome(
    directions: NDArray, strengths: NDArray | None = None, **more: object
) -> tuple[Description, dict[str, Picture]]:
    """Linear photographs of the sphere under lamps."""
    each = np.ones(len(directions)) if strengths is None else strengths
    photos = tuple(Photograph(f"{k}.tif", Kind.LIGHT, lamp=k) for k in range(len(directions)))
    there = tuple(Lamp(tuple(d)) for d in directions.tolist())
    pictures: dict[str, Picture] = {
        f"{k}.tif": InMemory(lambert(d, s), linear=True, levels=0)
        for k, (d, s) in enumerate(zip(directions, each, strict=True))
    }
    return Description(photos, there, **more), pictures  # type: ignore[arg-type]


def written(photos: Photographs, path: Path, **more: object) -> dome_set.Written:
    work = dome_set.write(path, photos, **more)  # type: ignore[arg-type]
    while True:
        try:
            next(work)
        except StopIteration as end:
            return end.value


@pytest.mark.parametrize("stops", [2, 4])
def test_a_curve_is_found_to_two_in_a_hundred(stops: int) -> None:
    rng, table = np.random.default_rng(4), s_curve()
    times = [1.0, 2.0**-stops, 4.0**-stops]
    photos, pictures = [], {}
    for k in range(3):
        light = textured(k) * 3
        for i, time in enumerate(times):
            name = f"{k}_{i}"
            photos.append(Photograph(name, Kind.LIGHT, lamp=k, exposure=time))
            pictures[name] = InMemory(taken(light, time, table, rng))
    there = opened(Description(tuple(photos), (Lamp((0.0, 0.0, 1.0)),) * 3), pictures)
    values = np.linspace(0.15, 0.97, 40)
    found = there.curve.light(np.stack([values] * 3, axis=-1))
    true = np.interp(values, np.linspace(0, 1, len(table)), table)[:, None]
    ratio = found / true
    assert np.abs(ratio / np.median(ratio, axis=0) - 1).max() < 0.02
    # and the light of all exposures together is the light, where an exposure holds it
    light, saturated = there.measured(there.group(Kind.LIGHT, lamp=0))
    true_light = textured(0) * 3
    off = light / true_light
    seen = ~saturated & (true_light.min(axis=-1) > 0.05)
    assert seen.mean() > 0.5
    assert np.abs(off[seen] / np.median(off[seen]) - 1).mean() < 0.02


@pytest.mark.parametrize("curved", [False, True])
def test_values_that_are_light_are_told_from_values_for_a_display(curved: bool) -> None:
    directions = around(12, 0.4)
    said, pictures = dome(directions)
    rng = np.random.default_rng(2)
    for name, picture in list(pictures.items()):
        light = np.clip(3.5 * picture.rows(0, HEIGHT), 0, 1)
        shown = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
        values = (shown if curved else light) + rng.normal(0, 0.003, light.shape)
        pictures[name] = InMemory(np.rint(np.clip(values, 0, 1) * 255) / 255)
    there = opened(said, pictures)
    assert (there.curve.table is None) != curved
    assert ("taken for light" in there.assumed) != curved and there.assumed


def test_what_is_saturated_in_every_exposure_is_a_mask() -> None:
    values = np.linspace(0, 2, 101)[None, :, None] * np.ones((4, 1, 3))
    pictures: dict[str, Picture] = {
        "a": InMemory(np.clip(values, 0, 1), linear=True, levels=65535),
        "b": InMemory(np.clip(values / 1.5, 0, 1), linear=True, levels=65535),
    }
    photos = tuple(
        Photograph(n, Kind.LIGHT, lamp=0, exposure=t) for n, t in (("a", 1.0), ("b", 1 / 1.5))
    )
    there = opened(Description(photos, (Lamp((0.0, 0.0, 1.0)),)), pictures)
    light, saturated = there.measured(photos)
    np.testing.assert_array_equal(saturated, values[..., 0] >= 1.5 * curve.FULL)
    np.testing.assert_allclose(light[~saturated], values[~saturated], atol=1e-5)
    assert np.isnan(there.light(photos)[saturated]).all()


def test_a_shift_of_three_pixels_is_found_and_mended() -> None:
    directions = around(12)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    spots = 1 + 0.6 * np.sign(np.sin(x * 0.9) * np.sin(y * 0.7 + x * 0.2))
    said, pictures = dome(directions)
    true = {name: p.rows(0, HEIGHT) * spots[..., None] for name, p in pictures.items()}
    for name, light in true.items():
        moved = np.roll(light, (-2, 3), (0, 1)) if name == "5.tif" else light
        pictures[name] = InMemory(moved, linear=True, levels=0)
    there = opened(said, pictures)
    for _ in there.find_shifts():
        pass
    assert {n: (s.x, s.y) for n, s in there.moved.items()} == {"5.tif": (3, -2)}
    back = there.light(there.group(Kind.LIGHT, lamp=5))
    inner = (slice(4, -4), slice(4, -4))
    np.testing.assert_allclose(back[inner], true["5.tif"][inner], rtol=1e-6)


def test_a_lamp_twice_as_strong_is_found_by_the_white_target(tmp_path: Path) -> None:
    directions = around(6, 0.5)
    strengths = np.array([1.0, 1.0, 2.0, 1.0, 0.5, 1.0])
    said, pictures = dome(directions, strengths, white=(2, 3, 6, 4))
    for k, picture in enumerate(pictures.values()):
        # a target that reflects all, and faces the camera
        picture.pixels[3:7, 2:8] = strengths[k] * directions[k, 2] / np.pi  # type: ignore
    found = written(opened(said, pictures), tmp_path).lamps
    np.testing.assert_allclose(found.strengths, np.repeat(strengths[:, None], 3, 1), rtol=1e-6)
    assert found.absolute
    # in a world of radiance 1 that shines as far as the lamps reach, white is the cells' light
    tile = CaptureSet(tmp_path).read(0)
    cube = CaptureSet(tmp_path).hemicube
    shone = (cube.solid_angles * directions[:, 2]).sum() / np.pi
    np.testing.assert_allclose(tile.basis.sum(axis=(0, 1))[4, 4], shone, rtol=1e-4)


def test_a_held_out_lamp_of_a_diffuse_sphere_is_predicted() -> None:
    directions = around(12, 0.5)
    pictures = np.stack([lambert(d) for d in directions])
    found = held_out.held_out(pictures, directions, INSIDE.astype(float))
    assert found is not None and len(found.rows) == 12
    inner = [r for r in found.rows if directions[r.lamp, 2] > 0.6]
    # the terminator is all that linear light does not tell
    assert max(r.error for r in inner) < 0.06
    assert all(r.error < 0.5 * r.nearest for r in inner)
    # a lamp whose strength is wrong by two is told by its gain
    pictures[2] *= 2
    again = held_out.held_out(pictures, directions, INSIDE.astype(float))
    assert again is not None and max(again.rows, key=lambda r: r.gain).lamp == 2


def test_directions_that_are_upside_down_are_told() -> None:
    directions = around(12, 0.4)
    pictures = np.stack([lambert(d) for d in directions])
    assert agree.turned(pictures, directions, INSIDE) == ""
    assert agree.turned(pictures, directions * (1, -1, 1), np.ones(INSIDE.shape)) == ""
    assert "turned round in y" in agree.turned(pictures, directions * (1, -1, 1), INSIDE)
    assert "turned round in x" in agree.turned(pictures, directions * (-1, 1, 1), INSIDE)


def test_a_dome_is_relit_as_the_thing_would_be(tmp_path: Path) -> None:
    """Sixty lamps all around: a Lambert sphere in a world that is bright on one side."""
    z = 1 - (2 * np.arange(60) + 1) / 60
    turn, flat = np.arange(60) * 2.399963, np.sqrt(1 - z * z)
    directions = np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)
    said, pictures = dome(directions)
    there = opened(said, pictures)
    found = written(there, tmp_path / "set", budget=60 * WIDTH * dome_set.BYTES * 25)
    captured = CaptureSet(tmp_path / "set")
    assert len(captured.regions) == 3 and found.hole < 1e-9
    for _ in fit(captured, tmp_path / "field", choice="whole"):
        pass
    field = Field(tmp_path / "field")
    # radiance 1 + x around: the irradiance is pi + 2 pi / 3 of the normal's x
    azimuth, latitude, _ = sample_directions(64, 128, 1)
    world = Environment((1 + directions_of(azimuth, latitude)[..., :1].repeat(3, -1)).astype("f4"))
    picture = next(iter(relights(field, [PatchLight(world, field.hemicube)], 0.0)))[..., :3]
    inner = NORMALS[..., 2] > 0.2
    expected = found.level * ALBEDO * (1 + 2 / 3 * NORMALS[..., :1])
    np.testing.assert_allclose(picture[inner] / expected[inner], 1, atol=0.06)


def test_near_lamps_are_as_far_ones(tmp_path: Path) -> None:
    """A flat grey plane: what far lamps would show is even, what near ones show is not."""
    directions = around(20, 0.4)
    places = directions * 2.0
    span = 1.0
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    at = np.stack(
        [(x + 0.5 - WIDTH / 2) * span / WIDTH, (HEIGHT / 2 - y - 0.5) * span / WIDTH, 0 * x], -1
    )
    photos, pictures = [], {}
    for k, place in enumerate(places):
        away = place - at
        far = np.linalg.norm(away, axis=-1)
        # of strength 1 at the middle
        light = np.repeat((away[..., 2] / far * 4.0 / far**2)[..., None], 3, axis=-1)
        photos.append(Photograph(f"{k}", Kind.LIGHT, lamp=k))
        pictures[f"{k}"] = InMemory(light, linear=True, levels=0)
    there = tuple(Lamp(place=tuple(p)) for p in places.tolist())
    said = Description(tuple(photos), there, span=span)
    level = written(opened(said, pictures), tmp_path).level
    captured = CaptureSet(tmp_path)
    basis = captured.read(0).basis[:, 0]
    expected = level * captured.hemicube.solid_angles * directions[:, 2]
    raw = np.stack([p.pixels for p in pictures.values()])  # type: ignore[attr-defined]
    uneven = np.ptp(raw, axis=(1, 2, 3)) / raw.mean(axis=(1, 2, 3))
    off = np.abs(basis / expected[:, None, None, None] - 1)
    assert uneven.min() > 0.15
    assert off.mean() < 0.01 and off.max() < 0.06


def test_ambient_light_and_darkness_are_taken_off(tmp_path: Path) -> None:
    directions = around(5)
    said, pictures = dome(directions)
    dark, room = 0.02, 0.1 * np.ones((HEIGHT, WIDTH, 3))
    for name, picture in list(pictures.items()):
        pictures[name] = InMemory(picture.rows(0, HEIGHT) + room + dark, linear=True, levels=0)
    pictures["dark.tif"] = InMemory(dark + 0 * room, linear=True, levels=0)
    pictures["ambient.tif"] = InMemory(dark + room, linear=True, levels=0)
    pictures["mask.png"] = InMemory(np.repeat(INSIDE[..., None], 3, -1).astype(float))
    more = (
        Photograph("dark.tif", Kind.DARK),
        Photograph("ambient.tif", Kind.AMBIENT),
        Photograph("mask.png", Kind.MASK),
    )
    said = replace(said, photographs=said.photographs + more)
    found = written(opened(said, pictures), tmp_path)
    tile = CaptureSet(tmp_path).read(0)
    np.testing.assert_allclose(tile.own[INSIDE], 0.1 * found.level, rtol=1e-4)
    np.testing.assert_array_equal(tile.alpha, INSIDE)
    omega = CaptureSet(tmp_path).hemicube.solid_angles
    for k in range(5):
        expected = lambert(directions[k]) * omega[k] * found.level
        np.testing.assert_allclose(tile.basis[k, 0], expected, atol=1e-5)


def test_a_chrome_ball_tells_the_lamps(tmp_path: Path) -> None:
    directions = around(8, 0.3)
    y, x = np.mgrid[:160, :200]
    nx, ny = (x - 120.3) / 40, -(y - 82.6) / 40
    on = nx * nx + ny * ny < 1
    normal = np.stack([nx, ny, np.sqrt(np.maximum(1 - nx * nx - ny * ny, 0))], axis=-1)
    mirrored = 2 * normal[..., 2:] * normal - np.array([0.0, 0.0, 1.0])
    photos, pictures = [], {}
    for k, d in enumerate(directions):
        light = np.where(on, 0.02, 0.3) + 20.0 * (on & (mirrored @ d > np.cos(0.06)))
        pictures[f"{k}"] = InMemory(np.repeat(light[..., None], 3, -1), linear=True, levels=0)
        photos.append(Photograph(f"{k}", Kind.LIGHT, lamp=k))
    said = Description(tuple(photos), (Lamp(),) * 8)
    there = opened(said, pictures)
    found = lamps.found(
        there, lambda k, a, b: there.measured(there.group(Kind.LIGHT, lamp=k), a, b)
    )
    cosines = (found.directions * directions).sum(axis=1)
    assert np.degrees(np.arccos(np.clip(cosines, -1, 1))).max() < 2.0
    plain: dict[str, Picture] = {
        n: InMemory(np.full((160, 200, 3), 0.3), linear=True, levels=0) for n in pictures
    }
    with pytest.raises(PhotographsError, match="no ball is seen"):
        written(opened(said, plain), tmp_path)
    with pytest.raises(PhotographsError, match="not all in the picture"):
        ball.direction(np.ones((50, 50)), (45.0, 20.0, 10.0))


def test_bad_photographs_are_a_sentence_each(tmp_path: Path) -> None:
    said, pictures = dome(around(3))
    small: Picture = InMemory(np.ones((HEIGHT, WIDTH - 1, 3)), linear=True)
    with pytest.raises(PhotographsError, match=r"'0.tif' is 80 x 60 and '1.tif' is 79 x 60"):
        opened(said, pictures | {"1.tif": small})
    black: dict[str, Picture] = {n: InMemory(np.full((60, 80, 3), 0.004)) for n in pictures}
    with pytest.raises(PhotographsError, match="all photographs are black"):
        written(opened(said, black), tmp_path)
    same = replace(said, lamps=(said.lamps[0], said.lamps[0], said.lamps[2]))
    with pytest.raises(PhotographsError, match="lamps 0 and 1 have one direction"):
        written(opened(same, pictures), tmp_path)
    unlit = replace(said, photographs=said.photographs[:2])
    with pytest.raises(PhotographsError, match="lamp 2 has no photograph"):
        written(opened(unlit, pictures), tmp_path)
    twice = replace(said, photographs=(*said.photographs, Photograph("x", Kind.LIGHT, lamp=0)))
    with pytest.raises(PhotographsError, match="do not say their exposures"):
        opened(twice, pictures | {"x": pictures["0.tif"]})
    aside = replace(said, white=(70, 0, 20, 5))
    with pytest.raises(PhotographsError, match="not in the picture of 80 x 60"):
        written(opened(aside, pictures), tmp_path)
