"""A shot for a page shows what the field shows, in any turn of its worlds."""

from __future__ import annotations

import numpy as np
import pytest
from arto.core import metrics
from arto.core.errors import WebError
from arto.core.field.field import Field
from arto.core.field.tile_writer import TileWriter
from arto.core.field.writer import FieldWriter
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment, directions, sample_directions
from arto.core.light.light import PatchLight
from arto.core.region import Region
from arto.core.relight import relight
from arto.core.supports import BELL, LINEAR
from arto.core.web import file, sphere
from arto.core.web.budget import bare, within
from arto.core.web.reader import Dials, Reader
from arto.core.web.reduce import reduced
from arto.core.web.shot import Shot, map_of, world_of

CUBE = Hemicube(patches=4)
SIZE = (24, 32)


def sky(height: int = 128) -> Environment:
    """Light that is brighter on one side, with a soft window."""
    azimuth, latitude, _ = sample_directions(height, 2 * height, 1)
    around = directions(azimuth, latitude)
    window = np.exp((around @ np.array([0.6, 0.48, 0.64]) - 1) * 30)
    level = 0.4 + 0.3 * around[..., 2] + 4 * window
    return Environment((level[..., None] * [1.0, 0.9, 0.7]).astype(np.float32))


@pytest.fixture(scope="module")
def field(tmp_path_factory: pytest.TempPathFactory) -> Field:
    """A ball: matt on the left, a mirror on the right, half transparent at the top."""
    rows, columns = (a.ravel() for a in np.mgrid[: SIZE[0], : SIZE[1]])
    x, y = (columns + 0.5) / SIZE[1] * 1.8 - 0.9, 0.9 - (rows + 0.5) / SIZE[0] * 1.8
    normal = np.stack([x * 0.7, -np.sqrt(1 - 0.49 * (x * x + y * y)), y * 0.7], axis=-1)
    mirror = columns >= SIZE[1] // 2
    alpha = np.where(rows < 3, 0.5, 1.0).reshape(SIZE)
    tile = TileWriter(Region(0, 0, SIZE[1], SIZE[0]), {"alpha": alpha, "own": np.zeros((*SIZE, 3))})
    seen = np.array([0.0, 1.0, 0.0])
    mirrored = seen - 2 * (normal @ seen)[:, None] * normal
    at, u, v = CUBE.locate(mirrored)
    for k in range(len(CUBE)):
        middle = CUBE.directions(k, np.array([0.5]), np.array([0.5]))[0]
        matt = np.maximum(normal @ middle, 0) * CUBE.solid_angles[k] / np.pi
        codes = np.where(mirror, np.where(at == k, BELL.code, 0), LINEAR.code * (matt > 0))
        light = np.where(mirror, at == k, 0.6 * matt)[:, None] * np.array([1.0, 0.8, 0.6])
        some = codes == BELL.code
        bells = np.stack([u, 0.01 + 0 * u, v, 0.01 + 0 * v], axis=-1)[some]
        plain = np.full((int((codes == LINEAR.code).sum()), 2), 0.5)
        tile.add(codes.astype(np.uint8), light, {BELL.code: bells, LINEAR.code: plain})
    writer = FieldWriter(tmp_path_factory.mktemp("web") / "field", CUBE, SIZE)
    writer.add(tile)
    writer.close()
    return Field(writer.folder)


@pytest.fixture(scope="module")
def shot(field: Field) -> Shot:
    world = world_of("sky", sphere.of_environment(sky(), 128))
    rays = np.zeros((*SIZE, 3))
    rays[..., 0], rays[..., 2] = (
        np.linspace(-0.3, 0.3, SIZE[1]),
        np.linspace(0.2, 0, SIZE[0])[:, None],
    )
    rays[..., 1] = 1.0
    *_, made = reduced(field, [world], rays, "ball")
    assert isinstance(made, Shot)
    return made


@pytest.mark.parametrize("turn", [0.0, 2.0])
def test_it_shows_what_the_field_shows(field: Field, shot: Shot, turn: float) -> None:
    reader = Reader(file.from_bytes(file.to_bytes(shot)))
    found = reader.picture(Dials(turn=turn, behind=False))
    light = PatchLight(Environment(sky().image, turn), CUBE)
    error = metrics.relative_error(found, relight(field, light)[..., :3]).reshape(*SIZE, 3)
    assert error[:, : SIZE[1] // 2].mean() < 0.015
    # the map of the page is coarser than that of the field
    assert error[:, SIZE[1] // 2 :].mean() < 0.06
    # strength is a factor for all of it
    brighter = reader.picture(Dials(turn=turn, strength=2.0, behind=False))
    np.testing.assert_allclose(brighter, 2 * found, rtol=1e-5)


def test_a_shot_gets_small_enough(shot: Shot) -> None:
    """By coarser steps, which hardly change the picture."""
    small = within(shot, bare(shot) - 500)
    assert bare(small) <= bare(shot) - 500
    one, two = (Reader(s).picture(Dials()) for s in (shot, small))
    assert np.abs(one - two).max() < 0.02 * one.max()
    assert within(shot, bare(shot)) is shot


def test_what_a_mirror_shows_is_in_its_lobes(shot: Shot) -> None:
    """And nowhere else: a sharp lamp must not be blurred by components."""
    (lobe, *others) = shot.lobes
    assert not others
    there = lobe.colour.any(axis=0)
    assert there[:, SIZE[1] // 2 :].mean() > 0.95 and not there[:, : SIZE[1] // 2].any()
    assert not shot.white[:, there].any()


def test_the_world_behind_is_where_the_camera_looks(shot: Shot) -> None:
    reader = Reader(shot)
    behind = reader.picture(Dials()) - reader.picture(Dials(behind=False))
    assert not behind[3:].any()
    # through half of the pixel
    expected = 0.5 * sphere.read(map_of(shot.worlds[0]), reader.rays()).reshape(*SIZE, 3)
    np.testing.assert_allclose(behind[:3], expected[:3], rtol=5e-3, atol=1e-4)
    wanted = np.array([-0.3, 1.0, 0.2])
    got = reader.rays().reshape(*SIZE, 3)[0, 0]
    assert got @ wanted / np.linalg.norm(wanted) > 1 - 1e-5


def test_a_lamp_of_a_kit_is_added(field: Field) -> None:
    around = sphere.directions(128)
    lamp = world_of("Key", 50.0 * (around[..., [0]] > 0.97) * np.ones(3, np.float32))
    base = sphere.of_environment(sky(), 128)
    *_, made = reduced(field, [world_of("kit", base, (lamp,))])
    assert isinstance(made, Shot)
    reader = Reader(made)
    dark = reader.picture(Dials(lights={"Key": (0.0, 0.0, 0.0)}))
    lit, red = reader.picture(Dials()), reader.picture(Dials(lights={"Key": (1.0, 0.0, 0.0)}))
    assert lit.mean() > 1.03 * dark.mean()
    np.testing.assert_allclose(red[..., 0], lit[..., 0], rtol=1e-5)
    np.testing.assert_allclose(red[..., 1], dark[..., 1], rtol=1e-5, atol=1e-6)


def test_a_lamp_keeps_its_light_at_every_turn() -> None:
    """Even where it is smaller than the steps between the directions that are looked in."""
    from arto.core.web.light import light_on

    map = np.zeros((128, 128, 3), np.float32)
    map[40, 70] = 1000.0
    every = sphere.levels(map)
    omega = sphere.solid_angles(64).ravel()
    sums = [float(omega @ light_on(every, 64, turn)[:, 0]) for turn in np.linspace(0, 1, 9)]
    assert np.ptp(sums) < 0.06 * np.mean(sums)


@pytest.mark.parametrize("at", [0, 9, 40, 0.5, 0.9])
def test_a_damaged_file_is_told(shot: Shot, at: float) -> None:
    data = bytearray(file.to_bytes(shot))
    begin = at if isinstance(at, int) else int(at * len(data))
    data[begin : begin + 8] = b"\xff" * 8
    with pytest.raises(WebError):
        file.from_bytes(bytes(data))
    with pytest.raises(WebError):
        file.from_bytes(bytes(data[: begin + 4]))
