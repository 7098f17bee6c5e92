"""The hemicube: every direction has one patch, and every patch its share of the sphere."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from arto.core.errors import HemicubeError
from arto.core.faces import FACE_NAMES, FACES, PRESETS, SIDES
from arto.core.hemicube import Hemicube
from hypothesis import given
from hypothesis import strategies as st

seeds = st.integers(0, 2**31)


def quadtree(rng: np.random.Generator, face: str, n: int = 1, row: int = 0, column: int = 0):
    """Leaves of a face, split at random."""
    if n == 16 or rng.random() < 0.4:
        return [(face, n, row, column)]
    return [
        leaf
        for i in (0, 1)
        for j in (0, 1)
        for leaf in quadtree(rng, face, 2 * n, 2 * row + i, 2 * column + j)
    ]


@st.composite
def hemicubes(draw: st.DrawFn, rotation) -> Hemicube:
    if draw(st.booleans()):
        faces = tuple(draw(st.permutations(FACE_NAMES))[: draw(st.integers(1, 6))])
        rng = np.random.default_rng(draw(seeds))
        leaves = [leaf for face in faces for leaf in quadtree(rng, face)]
        turn = rotation(draw(seeds))
        return Hemicube(faces=faces, orientation=turn, leaves=tuple(leaves))
    return Hemicube(
        faces=tuple(draw(st.permutations(FACE_NAMES))[: draw(st.integers(1, 6))]),
        patches=draw(st.integers(1, 16)),
        half_sides=draw(st.booleans()),
        orientation=rotation(draw(seeds)),
    )


@given(data=st.data(), seed=seeds)
def test_directions_find_their_way_back(rotation, data: st.DataObject, seed: int) -> None:
    cube = data.draw(hemicubes(rotation))
    rng = np.random.default_rng(seed)
    k = int(rng.integers(len(cube)))
    u, v = rng.uniform(1e-6, 1 - 1e-6, (2, 50))
    d = cube.directions(k, u, v)
    np.testing.assert_allclose(np.linalg.norm(d, axis=-1), 1, atol=1e-14)
    # of any length
    patch, back_u, back_v = cube.locate(d * 10 ** rng.uniform(-3, 3, (50, 1)))
    assert (patch == k).all()
    np.testing.assert_allclose(back_u, u, atol=1e-11)
    np.testing.assert_allclose(back_v, v, atol=1e-11)


@given(data=st.data(), seed=seeds)
def test_locate_finds_the_way_to_the_direction(rotation, data: st.DataObject, seed: int) -> None:
    """Any direction: either its patch leads back to it, or no patch of the cube covers it."""
    cube = data.draw(hemicubes(rotation))
    d = np.random.default_rng(seed).normal(size=(200, 3))
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    patch, u, v = cube.locate(d)
    local = d @ np.array(cube.orientation)
    for n in range(len(d)):
        if patch[n] >= 0:
            assert 0 <= u[n] <= 1 and 0 <= v[n] <= 1
            np.testing.assert_allclose(cube.directions(patch[n], u[n], v[n]), d[n], atol=1e-12)
        else:
            normals = {f: np.dot(FACES[f][0], local[n]) for f in FACE_NAMES}
            face = max(normals, key=lambda f: normals[f])
            below = cube.half_sides and face in SIDES and local[n, 2] < 0
            assert face not in cube.faces or below


def test_locate_keeps_the_shape_and_single_precision() -> None:
    d = np.random.default_rng(0).normal(size=(3, 4, 3)).astype(np.float32)
    patch, u, v = Hemicube().locate(d)
    assert patch.shape == u.shape == v.shape == (3, 4)
    assert patch.dtype == np.int32 and u.dtype == v.dtype == np.float32
    assert (patch >= 0).all()


def test_half_sides_hold_nothing_below_the_horizon() -> None:
    cube = Hemicube(faces=("top", *SIDES), patches=4, half_sides=True)
    assert len(cube) == 16 + 4 * 2 * 4
    below = cube.locate(np.array([[1, 0.3, -0.01], [0.2, -1, -0.9], [0, 0, -1.0]]))[0]
    above = cube.locate(np.array([[1, 0.3, 0.01], [0.2, -1, 0.9], [0, 0, 1.0]]))[0]
    assert (below == -1).all() and (above >= 0).all()
    x = cube.extents[cube.face_slice("left")]
    assert x[:, 2].min() == 0 and x[:, 3].max() == 1


@pytest.mark.parametrize("half", [False, True])
@pytest.mark.parametrize("patches", [1, 3, 4, 16])
def test_solid_angles_are_those_of_the_spherical_quads(rotation, patches: int, half: bool) -> None:
    """Patch borders are great circles, so a patch is two spherical triangles (Van Oosterom and
    Strackee 1983), whatever the formula on the face."""
    cube = Hemicube(patches=patches, half_sides=half, orientation=rotation(3))

    def triangle(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
        a, b, c = (x / np.linalg.norm(x) for x in (a, b, c))
        return 2 * math.atan2(np.dot(a, np.cross(b, c)), 1 + a @ b + b @ c + c @ a)

    for k in range(len(cube)):
        p = cube.corners(k)
        # u to the right, v up, seen from inside: counter-clockwise from there, so negative outside
        area = -triangle(p[0], p[1], p[2]) - triangle(p[0], p[2], p[3])
        assert cube.solid_angles[k] == pytest.approx(area, rel=1e-9)
    lower_half = len(SIDES) * 2 * math.pi / 6  # four half faces
    expected = 4 * math.pi - (lower_half if half else 0)
    assert cube.solid_angles.sum() == pytest.approx(expected, rel=1e-12)


def test_solid_angles_are_the_integral_of_the_directions(rotation) -> None:
    """Numerically: |d/du x d/dv| over the patch, the derivative by differences."""
    cube = Hemicube(faces=("top", "front"), patches=3, orientation=rotation(5))
    n, e = 40, 1e-5
    t = (np.arange(n) + 0.5) / n
    u, v = np.meshgrid(t, t)
    for k in range(len(cube)):
        du = (cube.directions(k, u + e, v) - cube.directions(k, u - e, v)) / (2 * e)
        dv = (cube.directions(k, u, v + e) - cube.directions(k, u, v - e)) / (2 * e)
        area = np.linalg.norm(np.cross(du, dv), axis=-1).mean()
        assert cube.solid_angles[k] == pytest.approx(area, rel=1e-3)


def test_corner_patches_are_smaller_than_middle_ones() -> None:
    grid = Hemicube(faces=("top",)).solid_angles.reshape(4, 4)
    np.testing.assert_allclose(grid, grid.T)
    np.testing.assert_allclose(grid, grid[::-1, ::-1])
    assert grid[0, 0] < grid[0, 1] < grid[1, 1]


def test_patches_go_face_by_face_row_by_row_from_below() -> None:
    cube = Hemicube(faces=("back", "top"), patches=3)
    assert cube.grid[:4] == (("back", 0, 0), ("back", 0, 1), ("back", 0, 2), ("back", 1, 0))
    assert cube.grid[9] == ("top", 0, 0)
    assert cube.face_slice("back") == slice(0, 9) and cube.face_slice("top") == slice(9, 18)
    assert cube.patch_name(5) == "back 1,2"
    middle = [cube.directions(k, 0.5, 0.5) for k in range(9)]
    # the back face: columns to the right (x), rows up (z), all away from the camera (y)
    assert middle[0][0] < middle[1][0] < middle[2][0]
    assert middle[0][2] < middle[3][2] < middle[6][2]
    assert all(d[1] > 0 for d in middle)


def test_faces_lie_where_their_names_say() -> None:
    at = {
        "top": (0, 0, 1),
        "bottom": (0, 0, -1),
        "left": (-1, 0, 0),
        "right": (1, 0, 0),
        "back": (0, 1, 0),  # away from the camera
        "front": (0, -1, 0),
    }
    for name, direction in at.items():
        np.testing.assert_allclose(
            Hemicube(faces=(name,), patches=1).directions(0, 0.5, 0.5), direction, atol=1e-15
        )
        centre, u, v = (np.array(a) for a in FACES[name])
        # seen from inside, u to the right and v up: none is mirrored
        np.testing.assert_array_equal(np.cross(u, v), -centre)
        if name in SIDES:
            np.testing.assert_array_equal(v, (0, 0, 1))
    assert PRESETS["paper"] == ("top", "left", "right", "back")


def test_orientation_turns_from_own_frame_to_world() -> None:
    # a quarter turn about z, x to y: what was right is then away from the camera
    quarter = ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    cube = Hemicube(faces=("right",), patches=1, orientation=quarter)
    np.testing.assert_allclose(cube.directions(0, 0.5, 0.5), (0, 1, 0), atol=1e-15)
    assert cube.locate(np.array([[0.0, 1, 0], [1.0, 0, 0]]))[0].tolist() == [0, -1]


def test_corners_are_the_ends_of_the_coordinates(rotation) -> None:
    cube = Hemicube(patches=3, half_sides=True, orientation=rotation(2))
    for k in (0, 13, len(cube) - 1):
        corners = cube.corners(k)
        unit = corners / np.linalg.norm(corners, axis=-1, keepdims=True)
        ends = cube.directions(k, np.array([0, 1, 1, 0]), np.array([0, 0, 1, 1]))
        np.testing.assert_allclose(unit, ends, atol=1e-14)
        # on the cube of half-edge 1
        np.testing.assert_allclose(np.abs(corners @ np.array(cube.orientation)).max(axis=1), 1)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"faces": ()}, "at least one face"),
        ({"faces": ("top", "top")}, "only once"),
        ({"faces": ("top", "up")}, "no face 'up': choose from top, left"),
        ({"patches": 0}, "choose 1 to 16"),
        ({"patches": 17}, "choose 1 to 16"),
        ({"size": 0.0}, "above 0"),
        ({"size": math.inf}, "above 0"),
        ({"size": math.nan}, "above 0"),
        ({"orientation": ((2.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0))}, "rotation"),
        ({"orientation": ((1.0, 0), (0, 1.0))}, "rotation"),
        ({"orientation": ((math.nan, 0, 0), (0, 1.0, 0), (0, 0, 1.0))}, "rotation"),
        ({"orientation": ((-1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0))}, "rotation"),  # a mirror
    ],
)
def test_a_hemicube_that_cannot_be(wrong: dict, says: str) -> None:
    with pytest.raises(HemicubeError, match=says):
        Hemicube(**wrong)


@given(data=st.data())
def test_json_keeps_everything(rotation, data: st.DataObject) -> None:
    cube = data.draw(hemicubes(rotation))
    moved = Hemicube(
        cube.faces, cube.patches, cube.half_sides, cube.orientation, (1.5, -2.25, 0.1), 12.5
    )
    assert Hemicube.from_json(json.loads(json.dumps(moved.to_json()))) == moved


@pytest.mark.parametrize(
    "damage",
    [
        lambda d: d.pop("faces"),
        lambda d: d.pop("size"),
        lambda d: d.update(patches="many"),
        lambda d: d.update(centre=None),
        lambda d: d.update(orientation=[["a"]]),
    ],
)
def test_json_that_is_no_hemicube(damage) -> None:
    data = Hemicube().to_json()
    damage(data)
    with pytest.raises(HemicubeError, match="not the description of a hemicube"):
        Hemicube.from_json(data)


def test_parallax() -> None:
    """A point at the scene's rim sees the middle of a face under that other angle."""
    assert Hemicube(size=10).parallax_degrees(1) == pytest.approx(5.71, abs=0.01)
    assert Hemicube(size=1000).parallax_degrees(1) < 0.06
    rim, patch = np.array([0, 2.0, 0]), np.array([7.0, 0, 0])
    seen = patch - rim
    angle = math.degrees(math.acos(seen @ patch / np.linalg.norm(seen) / np.linalg.norm(patch)))
    assert Hemicube(size=7).parallax_degrees(2) == pytest.approx(angle, rel=1e-9)


@given(seed=seeds)
def test_leaves_are_a_hemicube_like_any_other(seed: int) -> None:
    rng = np.random.default_rng(seed)
    leaves = tuple(leaf for face in FACE_NAMES for leaf in quadtree(rng, face))
    cube = Hemicube(leaves=leaves)
    assert cube.closed and cube.solid_angles.sum() == pytest.approx(4 * np.pi)
    assert Hemicube.from_json(json.loads(json.dumps(cube.to_json()))) == cube
    assert [cube.patch_name(k) for k in range(len(cube))][-1].endswith(f"of {leaves[-1][1]}")
    without = Hemicube(leaves=leaves[1:])
    assert not without.closed
    lost = without.locate(cube.directions(0, np.array([0.5]), np.array([0.5])))[0]
    assert lost.tolist() == [-1]


def test_the_grid_as_leaves_is_the_grid() -> None:
    grid = Hemicube(patches=4)
    cube = Hemicube(leaves=tuple((f, 4, row, column) for f, row, column in grid.grid))
    np.testing.assert_array_equal(cube.extents, grid.extents)
    d = np.random.default_rng(0).normal(size=(1000, 3))
    for one, two in zip(cube.locate(d), grid.locate(d), strict=True):
        np.testing.assert_allclose(one, two, atol=1e-12)


@pytest.mark.parametrize(
    ("leaves", "say"),
    [
        ((("top", 3, 0, 0),), "no patch 0,0 of 3x3"),
        ((("top", 2, 2, 0),), "no patch 2,0 of 2x2"),
        ((("side", 2, 0, 0),), "on the face 'side'"),
        ((("top", 2, 0, 0), ("top", 4, 1, 1)), "overlap"),
    ],
)
def test_leaves_that_cannot_be(leaves, say: str) -> None:
    with pytest.raises(HemicubeError, match=say):
        Hemicube(leaves=leaves)


@pytest.mark.parametrize(
    "cube",
    [
        *(Hemicube(patches=n) for n in (1, 2, 4, 16)),
        Hemicube(patches=3, half_sides=True),
        Hemicube(leaves=(("top", 1, 0, 0), ("left", 2, 1, 0), ("back", 16, 3, 15))),
    ],
    ids=len,
)
def test_uniform_moments_are_the_integrals_of_solid_angle(cube: Hemicube) -> None:
    """Written out: the integrals of 1, x, x^2, y, y^2, xy over (1 + x^2 + y^2)^(3/2), between the
    corners of the patch, then in its coordinates."""

    def primitives(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        r = np.sqrt(1 + x * x + y * y)
        angle = np.arctan(x * y / r)
        by_x, by_y = np.arcsinh(x / np.sqrt(1 + y * y)), np.arcsinh(y / np.sqrt(1 + x * x))
        return np.stack([angle, -by_y, y * by_x - angle, -by_x, x * by_y - angle, -r])

    for k in range(len(cube)):
        x0, x1, y0, y1 = cube.extents[k]
        total = primitives(x1, y1) - primitives(x0, y1) - primitives(x1, y0) + primitives(x0, y0)
        assert total[0] == pytest.approx(cube.solid_angles[k])
        one, x, xx, y, yy, xy = total / total[0]
        a, b = x1 - x0, y1 - y0
        expected = [
            one,
            (x - x0) / a,
            (xx - 2 * x0 * x + x0 * x0) / a**2,
            (y - y0) / b,
            (yy - 2 * y0 * y + y0 * y0) / b**2,
            (xy - x0 * y - y0 * x + x0 * y0) / (a * b),
        ]
        np.testing.assert_allclose(cube.uniform_moments(k), expected, atol=1e-10)


def test_where_the_mean_of_a_corner_patch_is() -> None:
    """Off its middle, towards the middle of the face."""
    np.testing.assert_allclose(Hemicube(patches=2).uniform_moments(3)[[1, 3]], 0.426, atol=5e-4)
    np.testing.assert_allclose(Hemicube(patches=4).uniform_moments(15)[[1, 3]], 0.456, atol=5e-4)
