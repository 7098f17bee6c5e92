"""Light on the patches as polynomials of their coordinates (paper 6)."""

from __future__ import annotations

import numpy as np
import pytest
from arto.core.faces import FACE_NAMES
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from arto.core.patterns import ONE, UU, VV, U, V, monomials
from arto.core.supports import LINEAR


@pytest.mark.parametrize("which", [(ONE,), (ONE, U, V), (ONE, U, UU, V, VV), (*range(6),)])
def test_polynomial_light_is_met_exactly(which: tuple[int, ...]) -> None:
    cube = Hemicube(patches=3, half_sides=True)
    light = PatchLight(Environment.uniform(1.0, 32), cube)
    truth = np.random.default_rng(0).normal(size=(len(cube), len(which), 3))
    for k in range(len(cube)):
        u, v = light.bin_centres(k)
        basis = monomials(u[None, :], v[:, None])[list(which)]
        radiance = np.einsum("mji,mc->jic", basis, truth[k])
        light.binned[k, ..., :3] = radiance * light.binned[k, ..., 3:]
    np.testing.assert_allclose(light.polynomial(which), truth, atol=1e-8)


def test_a_map_that_is_a_plane_over_each_patch(texel_directions) -> None:
    """Through the map, to within its texels; and the plane at the mean place is the pixel. One
    plane a face, seen by the patches in the middle: no texel of another face reaches them."""
    faces, cube = Hemicube(patches=1), Hemicube(patches=4)
    rng = np.random.default_rng(1)
    truth = rng.uniform(0.2, 1, (6, 3, 3))

    def plane(face: np.ndarray | int, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        t = truth[face]
        return t[..., 0, :] + u[..., None] * t[..., 1, :] + v[..., None] * t[..., 2, :]

    image = plane(*faces.locate(texel_directions(256, 512)))
    light = PatchLight(Environment(image.astype(np.float32)), cube)
    found = light.polynomial((ONE, U, V))
    mean = rng.random((20, 2))
    for k, (name, row, column) in enumerate(cube.grid):
        if not {row, column} <= {1, 2}:
            continue
        face = FACE_NAMES.index(name)
        here = np.array([plane(face, np.array(column / 4), np.array(row / 4))])
        np.testing.assert_allclose(found[k, :1], here, rtol=3e-3)
        np.testing.assert_allclose(found[k, 1:], truth[face, 1:] / 4, atol=5e-3)
        u, v = (column + mean[:, 0]) / 4, (row + mean[:, 1]) / 4
        np.testing.assert_allclose(LINEAR.average(light, k, mean), plane(face, u, v), rtol=3e-3)


def test_the_projection_is_the_nearest_by_solid_angle(noisy) -> None:
    """What is left over is orthogonal to 1, u and v under the weight of solid angle."""
    light = PatchLight(noisy(9), Hemicube())
    found = light.polynomial((ONE, U, V))
    for k in range(0, 96, 11):
        u, v = light.bin_centres(k)
        m = monomials(u[None, :], v[:, None])[[ONE, U, V]]
        left = light.binned[k, ..., :3] - np.einsum(
            "mji,mc,ji->jic", m, found[k], light.binned[k, ..., 3]
        )
        size = np.abs(light.binned[k, ..., :3]).sum()
        np.testing.assert_allclose(np.einsum("mji,jic->mc", m, left) / size, 0, atol=1e-12)
