"""Lamps smaller than a cell: their energy on a map, and that they are found again."""

from __future__ import annotations

import numpy as np
import pytest
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment
from arto.core.match.answers import Answers
from arto.core.match.cells import Cells
from arto.core.match.discs import Discs
from arto.core.match.fit import Columns, fitted
from arto.core.match.match import free_light
from arto.core.match.target import Target

CUBE = Hemicube(patches=2)


def toward(azimuth: float, elevation: float) -> np.ndarray:
    a, e = np.radians([azimuth, elevation])
    return np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)])


@pytest.mark.parametrize("elevation", [0.0, 35.0, 89.9])
@pytest.mark.parametrize("degrees", [0.1, 0.64, 10.0])
def test_a_disc_on_a_map_has_its_energy_and_its_place(elevation: float, degrees: float) -> None:
    disc = Discs(toward(70.0, elevation)[None], np.radians([degrees]))
    drawn = disc.drawn_on(Environment.uniform(0.0, 128), np.array([[3.0, 2.0, 1.0]]))
    flux = drawn.image * drawn.row_solid_angles[:, None, None]
    np.testing.assert_allclose(
        flux.sum(axis=(0, 1)), disc.solid_angles * np.array([3.0, 2.0, 1.0]), rtol=1e-5
    )
    v, u = np.unravel_index(int(flux[..., 0].argmax()), flux.shape[:2])
    at = toward(180 - 360 * (u + 0.5) / 256, 90 - 180 * (v + 0.5) / 128)
    assert at @ disc.directions[0] > np.cos(np.radians(degrees / 2 + 1.5))


class Shot:
    """Pixels that look at a small part of the light each, and pixels that throw sharp shadows."""

    def __init__(self, noise: float) -> None:
        rng = np.random.default_rng(3)
        self.noise, self.rng = noise, rng
        self.cells = Cells(CUBE, np.full(len(CUBE), 3))
        normals = rng.normal(size=(600, 3))
        self.normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        edges = rng.normal(size=(600, 3))
        self.edges = edges / np.linalg.norm(edges, axis=1, keepdims=True)
        # the field knows a cell as a whole
        fine = Cells(CUBE, np.full(len(CUBE), 12))
        shown = self.of(fine.middles) * fine.solid_angles[:, None]
        values = np.zeros((self.cells.count, 600))
        np.add.at(values, self.cells.locate(fine.middles), shown)
        self.values = np.repeat(values[None], 3, 0).astype(np.float32)

    def of(self, directions: np.ndarray) -> np.ndarray:
        """What light from directions shows, for each steradian: (L, n)."""
        lit = np.maximum(directions @ self.normals.T, 0)
        return lit * (directions @ self.edges.T > 0.1) + 0.05

    def pictures(self, discs: Discs) -> np.ndarray:
        shown = self.of(discs.directions) * discs.solid_angles[:, None]
        twice = np.repeat(shown[None], 2, 0)
        twice = twice * (1 + self.noise * self.rng.normal(size=twice.shape))
        return np.repeat(twice[..., None], 3, -1)

    @property
    def answers(self) -> Answers:
        small = type("Proxy", (), {"shape": (20, 30)})()
        none = np.empty(0, np.intp)
        return Answers(self.cells, self.values, small, small, (1, 1), none, np.ones(600))


def test_a_sun_is_found_to_a_degree() -> None:
    shot = Shot(0.2)
    sun = Discs(toward(-36.0, 28.0)[None], np.radians([0.6]))
    sky = 0.3
    lit = sky * shot.values.sum(axis=1).T + 4e4 * shot.of(sun.directions).T * sun.solid_angles
    target = Target(lit.astype(float), np.ones(600))
    start = Environment.uniform(1.0)
    work = free_light(shot.answers, start, target, np.zeros((600, 3)), lamps=True)
    sent, renders = None, 0
    while True:
        try:
            asked = work.send(sent)
        except StopIteration as e:
            found = e.value
            break
        sent = None
        if isinstance(asked, Discs):
            sent, renders = shot.pictures(asked), renders + 1
    assert renders == 3 and found.error < 0.03 and not found.missing.told
    image = found.environment.image.astype(float)
    flux = np.maximum(image - 10, 0).mean(axis=-1) * found.environment.row_solid_angles[:, None]
    rows, columns = np.indices(flux.shape)
    height, width = flux.shape
    places = np.stack(
        [toward(180 - 360 * (u + 0.5) / width, 90 - 180 * (v + 0.5) / height)
         for v, u in zip(rows[flux > 0], columns[flux > 0], strict=True)]
    )  # fmt: skip
    middle = flux[flux > 0] @ places
    middle /= np.linalg.norm(middle)
    assert middle @ sun.directions[0] > np.cos(np.radians(1.0))
    assert flux.sum() == pytest.approx(4e4 * float(sun.solid_angles[0]), rel=0.1)


def test_noise_of_pictures_does_not_spread_a_lamp() -> None:
    """Of ten lamps one shines: it keeps more of its light where noise is known."""
    shot = Shot(1.0)
    near = Discs(np.stack([toward(-36.0 + 9.0 * i, 28.0) for i in range(10)]), np.full(10, 0.02))
    lit = 1e3 * shot.of(near.directions[:1]).T * near.solid_angles[0] * np.ones(3)
    target = Target(lit, np.ones(600))
    columns = Columns.of(shot.answers, np.full((shot.cells.count, 3), 1e-3))
    shown = np.moveaxis(shot.pictures(near), -1, 0).astype(np.float32)
    every = columns.and_discs(near, shown)
    blind = Columns(every.values, every.solid_angles, every.pairs, every.border, every.have,
                    np.zeros_like(every.noise))  # fmt: skip

    def light(of: Columns) -> float:
        work = fitted(of, target, np.zeros((600, 3)))
        while True:
            try:
                next(work)
            except StopIteration as e:
                flux = e.value[-10:].mean(axis=-1)
                return float(flux[0] / flux.sum())

    known, unknown = light(every), light(blind)
    assert known > 0.8 and known > unknown + 0.1
