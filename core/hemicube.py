"""The hemicube: the cube of light patches around the scene (paper 3 and 4.1).

A face is a square of half-edge 1 at distance 1, in the hemicube's own frame: x right, y away from
the camera, z up. Each face carries a regular grid of patches, or patches of different size (the
`leaves` of a quadtree, see `refine`); a patch has coordinates u, v in [0, 1] that are linear on the
face. Patches of a grid are numbered face by face, row by row from below.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import HemicubeError
from .measure import Extent, uniform_moments

# name -> (centre, direction of u, direction of v); seen from inside, v is up on the four sides.
FACES: dict[str, tuple[tuple[int, int, int], ...]] = {
    "top": ((0, 0, 1), (1, 0, 0), (0, -1, 0)),
    "left": ((-1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "right": ((1, 0, 0), (0, -1, 0), (0, 0, 1)),
    "back": ((0, 1, 0), (1, 0, 0), (0, 0, 1)),
    "front": ((0, -1, 0), (-1, 0, 0), (0, 0, 1)),
    "bottom": ((0, 0, -1), (1, 0, 0), (0, 1, 0)),
}
FACE_NAMES = tuple(FACES)
SIDES = ("left", "right", "back", "front")
# The paper's monitors (no side behind the camera), and everything.
PRESETS: dict[str, tuple[str, ...]] = {
    "paper": ("top", "left", "right", "back"),
    "full": FACE_NAMES,
}

# A patch of a quadtree: face, patches a side if all were of its size, row, column.
Leaf = tuple[str, int, int, int]
FINEST = 16
LEAF_SIDES = (1, 2, 4, 8, FINEST)

IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Hemicube:
    """Geometry of the light around a scene; everything that a direction needs to find its patch.

    faces: subset of `FACE_NAMES`; patches: patches a side; half_sides: sides only above the
    horizon, with half as many rows; orientation: rotation, own frame to world (rows of a 3x3);
    centre, size: position and half-edge in scene units; leaves: patches of different size instead
    of the grid (`patches` is then only what they were made from). Directions without a leaf have no
    patch.
    """

    faces: tuple[str, ...] = FACE_NAMES
    patches: int = 4
    half_sides: bool = False
    orientation: tuple[tuple[float, ...], ...] = IDENTITY
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    size: float = 1000.0
    leaves: tuple[Leaf, ...] = ()

    def __post_init__(self) -> None:
        if not self.faces or len(set(self.faces)) != len(self.faces):
            raise HemicubeError("a hemicube needs at least one face, and each only once")
        if unknown := [f for f in self.faces if f not in FACES]:
            raise HemicubeError(f"no face '{unknown[0]}': choose from {', '.join(FACES)}")
        if not 1 <= self.patches <= 16:
            raise HemicubeError(f"{self.patches} patches a side: choose 1 to 16")
        for leaf in self.leaves:
            if len(leaf) != 4:
                raise HemicubeError(f"a patch is a face and three numbers, not {leaf!r:.60}")
            face, n, row, column = leaf
            inside = n in LEAF_SIDES and 0 <= row < n and 0 <= column < n
            if face not in self.faces or not inside:
                raise HemicubeError(f"no patch {row},{column} of {n}x{n} on the face '{face}'")
        if self.leaves and (self.table >= 0).sum() != sum(
            (FINEST // n) ** 2 for _, n, _, _ in self.leaves
        ):
            raise HemicubeError("the patches of the hemicube overlap")
        if not (math.isfinite(self.size) and self.size > 0):
            raise HemicubeError(f"a hemicube of size {self.size}: choose a size above 0")
        r = np.array(self.orientation, np.float64)
        if (
            r.shape != (3, 3)
            or not np.allclose(r @ r.T, np.eye(3), atol=1e-4)
            or np.linalg.det(r) < 0
        ):
            raise HemicubeError("the orientation of the hemicube must be a rotation")

    def to_json(self) -> dict[str, Any]:
        return asdict(self)

    @staticmethod
    def from_json(data: dict[str, Any]) -> Hemicube:
        def number(value: Any, kinds: tuple[type, ...] = (int, float)) -> Any:
            if type(value) not in kinds or not math.isfinite(value):
                raise TypeError(f"{value!r:.40} is no number")
            return value

        try:
            leaves = data.get("leaves") or ()
            if len(leaves) > len(FACES) * FINEST**2:
                raise ValueError(f"{len(leaves)} patches")
            half = data["half_sides"]
            if not isinstance(half, bool):
                raise TypeError(f"half_sides is {half!r:.40}")
            x, y, z = (float(number(x)) for x in data["centre"])
            return Hemicube(
                faces=tuple(str(f) for f in data["faces"][: len(FACES) + 1]),
                patches=number(data["patches"], (int,)),
                half_sides=half,
                orientation=tuple(
                    tuple(float(number(x)) for x in row[:4]) for row in data["orientation"][:4]
                ),
                centre=(x, y, z),
                size=float(number(data["size"])),
                leaves=tuple((str(f), *(number(n, (int,)) for n in rest)) for f, *rest in leaves),
            )
        except (KeyError, TypeError, ValueError, OverflowError, AttributeError) as e:
            raise HemicubeError(f"this is not the description of a hemicube: {e!r:.200}") from None

    def _rows(self, face: str) -> int:
        if self.half_sides and face in SIDES:
            return max(1, self.patches // 2)
        return self.patches

    @cached_property
    def grid(self) -> tuple[tuple[str, int, int], ...]:
        """(face, row, column) of each patch; rows and columns of a leaf are those of its size."""
        if self.leaves:
            return tuple((face, row, column) for face, _, row, column in self.leaves)
        return tuple(
            (face, row, column)
            for face in self.faces
            for row in range(self._rows(face))
            for column in range(self.patches)
        )

    def __len__(self) -> int:
        return len(self.grid)

    def face_slice(self, face: str) -> slice:
        """Where the patches of `face` of a grid stand among all."""
        start = next(k for k, (f, _, _) in enumerate(self.grid) if f == face)
        return slice(start, start + self._rows(face) * self.patches)

    def patch_name(self, k: int) -> str:
        face, row, column = self.grid[k]
        return f"{face} {row},{column}" + (f" of {self.leaves[k][1]}" if self.leaves else "")

    @cached_property
    def table(self) -> NDArray[np.int32]:
        """(F, 16, 16): the leaf that each cell of the finest grid lies in, -1 for none."""
        out = np.full((len(self.faces), FINEST, FINEST), -1, np.int32)
        for k, (face, n, row, column) in enumerate(self.leaves):
            s = FINEST // n
            out[self.faces.index(face), row * s : (row + 1) * s, column * s : (column + 1) * s] = k
        return out

    @cached_property
    def sides(self) -> NDArray[np.intp]:
        """(K,): patches a side if all were of this one's size."""
        if self.leaves:
            return np.array([n for _, n, _, _ in self.leaves], np.intp)
        return np.full(len(self), self.patches, np.intp)

    @cached_property
    def extents(self) -> NDArray[np.float64]:
        """(K, 4): x0, x1, y0, y1 of each patch on its face, where the face is [-1, 1]^2."""
        out = np.empty((len(self), 4))
        for k, (_, n, row, column) in enumerate(self.leaves):
            edges = np.array((column, column + 1, row, row + 1), np.float64)
            out[k] = edges * (2 / n) - 1
        if self.leaves:
            return out
        for k, (face, row, column) in enumerate(self.grid):
            low = 0.0 if self.half_sides and face in SIDES else -1.0
            rows = self._rows(face)
            out[k] = (
                -1 + 2 * column / self.patches,
                -1 + 2 * (column + 1) / self.patches,
                low + (1 - low) * row / rows,
                low + (1 - low) * (row + 1) / rows,
            )
        return out

    def frame(self, face: str) -> NDArray[np.float64]:
        """(3, 3): centre, u and v direction of a face in world space, as rows."""
        return np.array(FACES[face], np.float64) @ np.array(self.orientation).T

    def corners(self, k: int) -> NDArray[np.float64]:
        """(4, 3): the corners of a patch relative to the centre, for half-edge 1, at
        (u, v) = (0,0), (1,0), (1,1), (0,1)."""
        x0, x1, y0, y1 = self.extents[k]
        c, eu, ev = self.frame(self.grid[k][0])
        return np.array([c + x * eu + y * ev for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))])

    def directions(self, k: int, u: NDArray, v: NDArray) -> NDArray[np.float64]:
        """Unit directions in the world of the points (u, v) of patch k -> (..., 3)."""
        x0, x1, y0, y1 = self.extents[k]
        c, eu, ev = self.frame(self.grid[k][0])
        x = np.asarray(x0 + (x1 - x0) * np.asarray(u, np.float64))[..., None]
        y = np.asarray(y0 + (y1 - y0) * np.asarray(v, np.float64))[..., None]
        d = c + x * eu + y * ev
        return d / np.linalg.norm(d, axis=-1, keepdims=True)

    def locate(self, directions: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """The patch that each direction meets, and where.

        directions: (..., 3), any length -> patch (int32, -1 where there is none), u, v.
        """
        local = np.moveaxis(directions @ np.array(self.orientation, directions.dtype), -1, 0)
        major = np.abs(local).argmax(axis=0)
        shape = local.shape[1:]
        patch = np.full(shape, -1, np.int32)
        u = np.zeros(shape, local.dtype)
        v = np.zeros(shape, local.dtype)
        for face in self.faces:
            c, eu, ev = (np.array(a) for a in FACES[face])
            axis = int(np.abs(c).argmax())
            hit = (major == axis) & (np.sign(c[axis]) * local[axis] > 0)
            own = local[:, hit].astype(np.float64)
            depth = np.abs(own[axis])
            x, y = (own[int(np.abs(e).argmax())] * e.sum() / depth for e in (eu, ev))
            if self.leaves:
                cells = [
                    np.clip((t + 1) * (FINEST / 2), 0, FINEST - 1).astype(np.int32) for t in (y, x)
                ]
                k = self.table[self.faces.index(face)][tuple(cells)]
                patch[hit] = k
                x0, x1, y0, y1 = self.extents[k].T
                u[hit] = (x - x0) / (x1 - x0)
                v[hit] = (y - y0) / (y1 - y0)
                continue
            rows = self._rows(face)
            low = 0.0 if self.half_sides and face in SIDES else -1.0
            fu = (x + 1) * (self.patches / 2)
            fv = (y - low) * (rows / (1 - low))
            column = np.clip(fu, 0, self.patches - 1).astype(np.int32)
            row = np.clip(np.floor(fv), -1, rows - 1).astype(np.int32)
            start = self.face_slice(face).start
            patch[hit] = np.where(fv < 0, -1, start + row * self.patches + column)
            u[hit] = fu - column
            v[hit] = fv - row
        return patch, u, v

    @cached_property
    def solid_angles(self) -> NDArray[np.float64]:
        """(K,) steradians of each patch seen from the centre, in closed form."""
        x0, x1, y0, y1 = self.extents.T

        def corner(x: NDArray, y: NDArray) -> NDArray:
            return np.arctan2(x * y, np.sqrt(1 + x * x + y * y))

        return corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0)

    def extent(self, k: int) -> Extent:
        """x0, x1, y0, y1 of patch k on its face: a row of `extents`, to measure its light by."""
        x0, x1, y0, y1 = (float(x) for x in self.extents[k])
        return x0, x1, y0, y1

    def uniform_moments(self, k: int) -> NDArray[np.float64]:
        """(6,) moments, over the zeroth, of a transport that sees all of patch k evenly by solid
        angle, in the order of `patterns.MONOMIALS`: a light path's measure, not the face's area."""
        return uniform_moments(self.extent(k))

    @property
    def closed(self) -> bool:
        """Whether there is a patch in every direction."""
        if self.leaves:
            return len(self.faces) == len(FACE_NAMES) and bool((self.table >= 0).all())
        return len(self.faces) == len(FACE_NAMES) and not self.half_sides

    def parallax_degrees(self, radius: float) -> float:
        """How far the direction to a patch point differs between the centre of the scene and its
        rim: the error of taking a near hemicube for an environment at infinity."""
        return math.degrees(math.atan2(radius, self.size))
