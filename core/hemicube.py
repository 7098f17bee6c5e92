"""The hemicube: the cube of light patches around the scene (paper 3 and 4.1).

A face is a square of half-edge 1 at distance 1, in the hemicube's own frame: x right, y away from
the camera, z up. A face carries a regular grid of patches, or the leaves of a quadtree (`refine`).
A patch has coordinates u, v in [0, 1] that are linear on the face. Patches of a grid are numbered
face by face, and row by row from below.

Examples
--------
>>> cube = Hemicube(patches=2)
>>> len(cube), round(float(cube.solid_angles.sum() / np.pi), 6)
(24, 4.0)
>>> patch, u, v = cube.locate(np.array([[0.5, 0.5, 1.0]]))
>>> cube.patch_name(int(patch[0])), float(u[0]), float(v[0])
('top 0,1', 0.5, 0.5)
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .dome import APART, Dome
from .errors import HemicubeError
from .faces import FACE_NAMES, FACES, FINEST, LEAF_SIDES, Leaf
from .measure import Extent, uniform_moments
from .partition import Cell, Grid, Quadtree

MOST_LAMPS = 10_000
IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Hemicube:
    """The geometry of the light around a scene: K patches, of which k is the number of one.

    Parameters
    ----------
    faces : tuple of str
        A subset of `FACE_NAMES`. A direction that meets no face has no patch.
    patches : int
        Patches a side of a face, 1 to 16.
    half_sides : bool
        Whether the sides exist only above the horizon, with half as many rows.
    orientation : 3 rows of 3 float
        The rotation from the hemicube's frame to the world.
    centre : tuple of 3 float
        In scene units.
    size : float
        The half-edge in scene units.
    leaves : tuple of Leaf
        Patches of a quadtree in place of the grid. A direction that meets no leaf has no patch.
    lamps : tuple of 3 float
        The cells of a dome's lamps in place of the grid: directions of length 1, see `dome`.
    reach : float
        Degrees around its direction for which a lamp stands at most.

    Raises
    ------
    HemicubeError
        A value is out of bounds, or leaves overlap.
    """

    faces: tuple[str, ...] = FACE_NAMES
    patches: int = 4
    half_sides: bool = False
    orientation: tuple[tuple[float, ...], ...] = IDENTITY
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    size: float = 1000.0
    leaves: tuple[Leaf, ...] = ()
    lamps: tuple[tuple[float, float, float], ...] = ()
    reach: float = 180.0

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
        if isinstance(self.partition, Quadtree) and self.partition.overlap:
            raise HemicubeError("the patches of the hemicube overlap")
        if self.lamps:
            self._check_lamps()
        if not (math.isfinite(self.size) and self.size > 0):
            raise HemicubeError(f"a hemicube of size {self.size}: choose a size above 0")
        r = np.array(self.orientation, np.float64)
        if (
            r.shape != (3, 3)
            or not np.allclose(r @ r.T, np.eye(3), atol=1e-4)
            or np.linalg.det(r) < 0
        ):
            raise HemicubeError("the orientation of the hemicube must be a rotation")

    def _check_lamps(self) -> None:
        d = np.array(self.lamps, np.float64)
        if d.ndim != 2 or d.shape[1] != 3 or not np.allclose((d * d).sum(1), 1, atol=1e-6):
            raise HemicubeError("the direction of a lamp is three numbers, of length 1")
        if self.leaves or len(self.faces) < len(FACES) or not 0 < self.reach <= 180:
            raise HemicubeError("lamps stand on all faces, without leaves, and reach 0 to 180")
        cosines = d @ d.T
        np.fill_diagonal(cosines, -1)
        if (cosines > math.cos(math.radians(APART))).any():
            a, b = np.unravel_index(int(cosines.argmax()), cosines.shape)
            raise HemicubeError(f"the lamps {a} and {b} have one direction: take one of them")

    def to_json(self) -> dict[str, Any]:
        """Give the hemicube as an object of a description.

        Returns
        -------
        dict
        """
        out = asdict(self)
        if not self.lamps:  # as files were before there were lamps
            del out["lamps"], out["reach"]
        return out

    @staticmethod
    def from_json(data: dict[str, Any]) -> Hemicube:
        """Read a hemicube from an object of a description.

        Parameters
        ----------
        data : dict

        Returns
        -------
        Hemicube

        Raises
        ------
        HemicubeError
            The object describes no hemicube.
        """

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
            lamps = data.get("lamps") or ()
            if len(lamps) > MOST_LAMPS:
                raise ValueError(f"{len(lamps)} lamps")
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
                lamps=tuple(
                    (float(number(a)), float(number(b)), float(number(c))) for a, b, c in lamps
                ),
                reach=float(number(data.get("reach", 180.0))),
            )
        except (KeyError, TypeError, ValueError, OverflowError, AttributeError) as e:
            raise HemicubeError(f"this is not the description of a hemicube: {e!r:.200}") from None

    @cached_property
    def partition(self) -> Grid | Quadtree | Dome:
        """How the faces are cut into patches."""
        if self.lamps:
            return Dome(self.lamps, self.reach)
        if self.leaves:
            return Quadtree(self.faces, self.leaves)
        return Grid(self.faces, self.patches, self.half_sides)

    @cached_property
    def grid(self) -> tuple[Cell, ...]:
        """(face, row, column) of each patch. Those of a leaf count leaves of its size."""
        return self.partition.cells

    def __len__(self) -> int:
        return len(self.grid)

    def face_slice(self, face: str) -> slice:
        """Find the patches of a face of a grid.

        Parameters
        ----------
        face : str

        Returns
        -------
        slice
            Into the patches.
        """
        start = next(k for k, (f, _, _) in enumerate(self.grid) if f == face)
        return slice(start, start + sum(f == face for f, _, _ in self.grid))

    def patch_name(self, k: int) -> str:
        """Name a patch for messages.

        Parameters
        ----------
        k : int

        Returns
        -------
        str
        """
        face, row, column = self.grid[k]
        if self.lamps:
            return f"lamp {k} ({face})"
        return f"{face} {row},{column}" + (f" of {self.leaves[k][1]}" if self.leaves else "")

    @cached_property
    def sides(self) -> NDArray[np.intp]:
        """(K,) int: for each patch, how many patches of its size make up a side of the face."""
        return self.partition.sides

    @cached_property
    def extents(self) -> NDArray[np.float64]:
        """(K, 4) float64: x0, x1, y0, y1 of each patch on its face, which is [-1, 1]^2."""
        return self.partition.extents

    def frame(self, face: str) -> NDArray[np.float64]:
        """Compute the frame of a face in the world.

        Parameters
        ----------
        face : str

        Returns
        -------
        (3, 3) float64
            As rows: the centre, the direction of u and the direction of v.
        """
        return np.array(FACES[face], np.float64) @ np.array(self.orientation).T

    def _frame_of(self, k: int) -> NDArray[np.float64]:
        """The frame of the face that a patch is on; a lamp's cell has its own."""
        if isinstance(self.partition, Dome):
            return self.partition.frames[k] @ np.array(self.orientation).T
        return self.frame(self.grid[k][0])

    def corners(self, k: int) -> NDArray[np.float64]:
        """Compute the corners of a patch.

        Parameters
        ----------
        k : int

        Returns
        -------
        (4, 3) float64
            At (u, v) = (0, 0), (1, 0), (1, 1), (0, 1), relative to the centre, for half-edge 1.
        """
        x0, x1, y0, y1 = self.extents[k]
        c, eu, ev = self._frame_of(k)
        return np.array([c + x * eu + y * ev for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))])

    def directions(self, k: int, u: NDArray, v: NDArray) -> NDArray[np.float64]:
        """Compute the directions in the world of points of a patch.

        Parameters
        ----------
        k : int
        u, v : (...) float
            Patch coordinates.

        Returns
        -------
        (..., 3) float64
            Unit vectors.
        """
        x0, x1, y0, y1 = self.extents[k]
        c, eu, ev = self._frame_of(k)
        x = np.asarray(x0 + (x1 - x0) * np.asarray(u, np.float64))[..., None]
        y = np.asarray(y0 + (y1 - y0) * np.asarray(v, np.float64))[..., None]
        d = c + x * eu + y * ev
        return d / np.linalg.norm(d, axis=-1, keepdims=True)

    def locate(self, directions: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Find the patch that each direction meets.

        Parameters
        ----------
        directions : (..., 3) float
            In the world, of any length.

        Returns
        -------
        patch : (...) int32
            The number of the patch, or -1.
        u, v : (...) float
            Patch coordinates, of the dtype of `directions`.
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
            patch[hit], u[hit], v[hit] = self.partition.place(face, x, y)
        return patch, u, v

    @cached_property
    def solid_angles(self) -> NDArray[np.float64]:
        """(K,) float64: the steradians of each patch seen from the centre, in closed form; those
        of a dome are measured."""
        if isinstance(self.partition, Dome):
            return self.partition.solid_angles
        x0, x1, y0, y1 = self.extents.T

        def corner(x: NDArray, y: NDArray) -> NDArray:
            return np.arctan2(x * y, np.sqrt(1 + x * x + y * y))

        return corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0)

    def extent(self, k: int) -> Extent:
        """Give the place of a patch on its face, a row of `extents`.

        Parameters
        ----------
        k : int

        Returns
        -------
        tuple of 4 float
            x0, x1, y0, y1.
        """
        x0, x1, y0, y1 = (float(x) for x in self.extents[k])
        return x0, x1, y0, y1

    def uniform_moments(self, k: int) -> NDArray[np.float64]:
        """Compute the moments of a transport that sees all of a patch evenly by solid angle.

        Parameters
        ----------
        k : int

        Returns
        -------
        (6,) float64
            Moments over the zeroth, in the order of `patterns.MONOMIALS`.
        """
        return uniform_moments(self.extent(k))

    @property
    def closed(self) -> bool:
        """Whether every direction has a patch."""
        return self.partition.closed

    def parallax_degrees(self, radius: float) -> float:
        """Compute how far the direction to a patch differs between the scene's centre and its rim.

        This is the error of taking the hemicube for an environment at infinity.

        Parameters
        ----------
        radius : float
            The radius of the scene, in scene units.

        Returns
        -------
        float
            Degrees.
        """
        return math.degrees(math.atan2(radius, self.size))
