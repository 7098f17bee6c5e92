"""Light on the patches: averages over boxes, cancellation, linearity (paper 6)."""

from __future__ import annotations

import numpy as np
import pytest
from arto.core.faces import FACE_NAMES
from arto.core.hemicube import Hemicube
from arto.core.light.bins import bin_coordinate
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from arto.core.patterns import ONE, UU, UV, VV, U, V
from arto.core.supports import BOX, LINEAR, SUPPORTS, WHOLE
from hypothesis import example, given, settings
from hypothesis import strategies as st

seeds = st.integers(0, 2**31)


def random_boxes(rng: np.random.Generator, n: int, narrowest: float = 0) -> np.ndarray:
    """(n, 4): u0, u1, v0, v1; a quarter of them pushed against a rim."""
    size = rng.uniform(narrowest, 1, (n, 2))
    low = rng.uniform(0, 1 - size)
    low[: n // 8] = 0
    low[n // 8 : n // 4] = 1 - size[n // 8 : n // 4]
    high = np.minimum(low + size, 1)
    return np.stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]], axis=-1)


@given(
    seed=seeds,
    faces=st.permutations(FACE_NAMES),
    count=st.integers(1, 6),
    patches=st.integers(1, 16),
    half=st.booleans(),
    turned=st.booleans(),
    shape=st.sampled_from([(16, 32), (32, 64), (16, 64), (32, 32), (2, 4)]),
)
@example(0, list(FACE_NAMES), 6, 16, False, False, (32, 64))
@example(0, list(FACE_NAMES), 6, 1, True, False, (32, 64))
@settings(max_examples=25)
def test_uniform_light_is_uniform_in_every_box(
    rotation, seed, faces, count, patches, half, turned, shape
) -> None:
    """Boxes thinner than a bin, at the rim and in the corner included; any map, any cube."""
    cube = Hemicube(
        faces=tuple(faces[:count]),
        patches=patches,
        half_sides=half,
        **({"orientation": rotation(seed)} if turned else {}),
    )
    colour = np.array([0.25, 3.0, 700.0])
    light = PatchLight(Environment(np.tile(colour.astype(np.float32), (*shape, 1))), cube)
    rng = np.random.default_rng(seed)
    corners = np.array([[a, a, b, b] for a in (0.0, 1.0) for b in (0.0, 1.0)])
    for k in rng.permutation(len(cube))[:12]:
        box = np.concatenate([random_boxes(rng, 16), corners, [[0, 1, 0, 1]]])
        found = BOX.average(light, int(k), box)
        np.testing.assert_allclose(found, np.broadcast_to(colour, found.shape), rtol=1e-9)
        np.testing.assert_allclose(
            LINEAR.average(light, int(k), rng.random((5, 2))), np.tile(colour, (5, 1)), rtol=1e-5
        )
    np.testing.assert_allclose(light.whole, np.tile(colour, (len(cube), 1)), rtol=1e-12)


@pytest.mark.parametrize("seed", range(2))
def test_boxes_average_by_solid_angle(rotation, smooth, texel_directions, seed: int) -> None:
    """Against brute force: the light itself at 64 x 64 points of the box."""
    function = smooth(seed)
    cube = Hemicube(patches=2 + seed, orientation=rotation(seed))
    e = Environment(function(texel_directions(256, 512)).astype(np.float32))
    light = PatchLight(e, cube)
    rng = np.random.default_rng(seed)
    t = (np.arange(64) + 0.5) / 64
    flat = []
    for k in range(len(cube)):
        boxes = random_boxes(rng, 8, 2.5 / light.resolution)
        found = BOX.average(light, k, boxes)
        for box, average in zip(boxes, found, strict=True):
            u = (box[0] + (box[1] - box[0]) * t)[None, :]
            v = (box[2] + (box[3] - box[2]) * t)[:, None]
            values = function(cube.directions(k, *np.broadcast_arrays(u, v)))
            x0, x1, y0, y1 = cube.extents[k]
            weight = (1 + (x0 + (x1 - x0) * u) ** 2 + (y0 + (y1 - y0) * v) ** 2) ** -1.5
            truth = np.einsum("ij,ijc->c", weight, values) / weight.sum()
            np.testing.assert_allclose(average, truth, rtol=2e-3)
            flat.append(np.abs(values.mean(axis=(0, 1)) / truth - 1).max())
    # the check means something: an average by area would be off
    assert max(flat) > 5e-3


def test_light_of_one_face_fills_a_sixth_of_the_sphere() -> None:
    """And light of all faces all of it, however many patches there are and however bright it is."""
    hemicube = Hemicube(patches=4)
    even = PatchLight(Environment.uniform(3.0), hemicube)
    assert even.spread == pytest.approx(1, rel=1e-6)
    one = even.whole.copy()
    one[len(hemicube) // 6 :] = 0
    bins = np.column_stack([one * hemicube.solid_angles[:, None], hemicube.solid_angles])
    lit = PatchLight.of_bins(hemicube, np.ones(len(hemicube), np.intp), bins)
    assert lit.spread == pytest.approx(1 / 6, rel=1e-6)
    bins[:, :3] = 0
    assert PatchLight.of_bins(hemicube, lit.resolutions, bins).spread == 0


def test_whole_is_the_box_of_the_whole_patch(noisy) -> None:
    light = PatchLight(noisy(1), Hemicube())
    for k in (0, 50, 95):
        box = BOX.average(light, k, np.array([[0.0, 1, 0, 1]]))
        np.testing.assert_allclose(box[0], light.whole[k], rtol=1e-12)
        np.testing.assert_allclose(WHOLE.average(light, k, np.empty((3, 0))), light.whole[[k] * 3])


def test_boxes_of_many_patches_at_once(noisy) -> None:
    light = PatchLight(noisy(2), Hemicube())
    rng = np.random.default_rng(0)
    k, boxes = rng.integers(0, 96, 40), random_boxes(rng, 40)
    together = light.box(k, *boxes.T)
    for n in range(40):
        np.testing.assert_allclose(together[n], light.box(int(k[n]), *boxes[n : n + 1].T)[0])


def test_halves_make_the_whole(noisy) -> None:
    """Averages weighted by solid angle add up, wherever a box is cut."""
    light = PatchLight(noisy(5), Hemicube(), resolution=16)
    rng = np.random.default_rng(3)
    for k in range(0, 96, 7):
        u0, u1, v0, v1 = 0.05, 0.95, 0.1, 0.8
        cut = rng.uniform(0.3, 0.7)

        def both(*box: float, k: int = k) -> np.ndarray:
            i0, i1 = (bin_coordinate(light.hemicube, k, np.array([t]), 0, 16) for t in box[:2])
            j0, j1 = (bin_coordinate(light.hemicube, k, np.array([t]), 1, 16) for t in box[2:])
            weight = light._sums_between(k, i0, i1, j0, j1)[0, 3]
            average = light.box(k, *(np.array([t]) for t in box))[0]
            return np.append(average * weight, weight)

        parts = both(u0, cut, v0, v1) + both(cut, u1, v0, v1)
        np.testing.assert_allclose(parts, both(u0, u1, v0, v1), rtol=1e-10)


def test_darkness_beside_a_sun_stays_dark() -> None:
    """Four corners of a table that holds 1e6 and 1: float64, or nothing is left of the 1."""
    cube = Hemicube(faces=("back",))
    image = np.ones((64, 128, 3), np.float32)
    k, (u, v) = 5, (0.4, 0.6)
    d = cube.directions(k, u, v)
    row = int((0.5 - np.arcsin(d[2]) / np.pi) * 64)
    column = int((0.5 - np.arctan2(d[1], d[0]) / (2 * np.pi)) * 128)
    image[row, column] = 1e6
    light = PatchLight(Environment(image), cube)
    r = light.resolution
    radiance = light.binned[k, ..., 0] / light.binned[k, ..., 3]
    i = np.nonzero(radiance > 1.0001)[1]
    assert len(i) and radiance.max() > 1e5
    x = cube.extents[k]
    start, stop = np.arctan(x[:2])

    def coordinate(b: float) -> np.ndarray:  # of a bin edge
        return np.array([(np.tan(start + (stop - start) * b / r) - x[0]) / (x[1] - x[0])])

    a = 1e-9  # of a bin beside the sun's: as good as touching it
    left = light.box(k, coordinate(0), coordinate(i.min() - a), np.zeros(1), np.ones(1))
    right = light.box(k, coordinate(i.max() + 1 + a), coordinate(r), np.zeros(1), np.ones(1))
    thin = light.box(
        k, coordinate(i.max() + 1 + a), coordinate(i.max() + 2 + a), np.zeros(1), np.ones(1)
    )
    for dark in (left, right, thin):
        np.testing.assert_allclose(dark, 1, rtol=1e-6)
    over = light.box(k, coordinate(i.max() + 0.9), coordinate(r), np.zeros(1), np.ones(1))
    assert over.min() > 100


@pytest.mark.parametrize("texels", [1, 16, 37])
def test_turning_cube_and_world_together_changes_nothing(noisy, texels: int) -> None:
    """About z by whole texels: counter-clockwise from above is to the left in the map."""
    e = noisy(3, 64)
    a = 2 * np.pi * texels / 128
    turn = ((np.cos(a), -np.sin(a), 0.0), (np.sin(a), np.cos(a), 0.0), (0.0, 0.0, 1.0))
    still = PatchLight(e, Hemicube())
    turned = PatchLight(Environment(np.roll(e.image, -texels, axis=1)), Hemicube(orientation=turn))
    assert np.abs(still.whole / PatchLight(e, Hemicube(orientation=turn)).whole - 1).max() > 0.01
    np.testing.assert_allclose(turned.whole, still.whole, rtol=1e-9)
    boxes = random_boxes(np.random.default_rng(0), 30)
    for k in range(0, 96, 5):
        np.testing.assert_allclose(turned.box(k, *boxes.T), still.box(k, *boxes.T), rtol=1e-9)
    np.testing.assert_allclose(
        turned.polynomial((ONE, U, V)), still.polynomial((ONE, U, V)), atol=1e-9
    )


def test_light_is_linear_in_the_world(noisy) -> None:
    cube, a, b = Hemicube(patches=2), noisy(1), noisy(2)
    both = PatchLight(Environment(2 * a.image + 0.5 * b.image), cube)
    la, lb = PatchLight(a, cube), PatchLight(b, cube)
    np.testing.assert_allclose(both.whole, 2 * la.whole + 0.5 * lb.whole, rtol=1e-6)
    boxes = random_boxes(np.random.default_rng(0), 30)
    np.testing.assert_allclose(
        both.box(3, *boxes.T), 2 * la.box(3, *boxes.T) + 0.5 * lb.box(3, *boxes.T), rtol=1e-5
    )
    which = (ONE, U, UU, V, VV, UV)
    np.testing.assert_allclose(
        both.polynomial(which), 2 * la.polynomial(which) + 0.5 * lb.polynomial(which), atol=1e-4
    )


def test_a_thin_box_at_the_rim_sees_the_bin_there(noisy) -> None:
    """Widened to one bin, inwards."""
    cube = Hemicube(patches=2)
    light = PatchLight(noisy(3), cube)
    k = np.arange(len(cube))
    radiance = light.binned[..., :3] / light.binned[..., 3:]
    for u, i in ((0.0, 0), (1.0, -1)):
        for v, j in ((0.0, 0), (1.0, -1)):
            us, vs = np.full(len(cube), u), np.full(len(cube), v)
            found = light.box(k, us, us, vs, vs)
            np.testing.assert_allclose(found, radiance[:, j, i], rtol=1e-9)


def test_entries_of_several_patches_are_those_of_each(noisy) -> None:
    """Asked together or patch by patch, every model averages the same."""
    light = PatchLight(noisy(5), Hemicube())
    k, rng = np.repeat([3, 40, 81], 5), np.random.default_rng(4)
    for support in SUPPORTS.values():
        parameters = np.sort(rng.random((15, len(support.parameters))), axis=1)
        parameters[::2] = parameters[::2, :1] if parameters.shape[1] == 4 else parameters[::2]
        each = [
            support.average(light, int(n), p[None])[0] for n, p in zip(k, parameters, strict=True)
        ]
        np.testing.assert_allclose(support.average(light, k, parameters), each, rtol=1e-5)
