"""How the faces of a hemicube are cut into patches: a regular grid, or the leaves of a quadtree.

A face is [-1, 1]^2, with x along u and y along v. Patches are numbered from 0.

Examples
--------
>>> grid = Grid(("top",), 2)
>>> grid.cells[3], grid.extents[3].tolist()
(('top', 1, 1), [0.0, 1.0, 0.0, 1.0])
>>> leaves = Quadtree(("top",), (("top", 2, 0, 0), ("top", 4, 3, 3)))
>>> patch, u, v = leaves.place("top", np.array([-0.5, 0.75, 0.25]), np.array([-0.75, 0.75, -0.25]))
>>> patch.tolist(), u[:2].tolist(), v[:2].tolist()
([0, 1, -1], [0.5, 0.5], [0.25, 0.5])
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .faces import FACE_NAMES, FINEST, SIDES, Leaf

# The face, the row and the column of a patch.
Cell = tuple[str, int, int]


@dataclass(frozen=True)
class Grid:
    """Patches of one size, numbered face by face, and row by row from below.

    Parameters
    ----------
    faces : tuple of str
    patches : int
        Patches a side of a face.
    half_sides : bool
        Whether the sides exist only above the horizon, with half as many rows.
    """

    faces: tuple[str, ...]
    patches: int
    half_sides: bool = False

    def rows(self, face: str) -> int:
        """Count the rows of patches on a face.

        Parameters
        ----------
        face : str

        Returns
        -------
        int
        """
        if self._is_half(face):
            return max(1, self.patches // 2)
        return self.patches

    def _is_half(self, face: str) -> bool:
        return self.half_sides and face in SIDES

    @cached_property
    def cells(self) -> tuple[Cell, ...]:
        """(face, row, column) of each patch."""
        return tuple(
            (face, row, column)
            for face in self.faces
            for row in range(self.rows(face))
            for column in range(self.patches)
        )

    @property
    def sides(self) -> NDArray[np.intp]:
        """(K,) int: for each patch, how many patches of its size make up a side of the face."""
        return np.full(len(self.cells), self.patches, np.intp)

    @cached_property
    def starts(self) -> dict[str, int]:
        """The first patch of each face."""
        return {face: self.cells.index((face, 0, 0)) for face in self.faces}

    @property
    def extents(self) -> NDArray[np.float64]:
        """(K, 4) float64: x0, x1, y0, y1 of each patch on its face."""
        out = np.empty((len(self.cells), 4))
        for k, (face, row, column) in enumerate(self.cells):
            low = 0.0 if self._is_half(face) else -1.0
            rows = self.rows(face)
            out[k] = (
                -1 + 2 * column / self.patches,
                -1 + 2 * (column + 1) / self.patches,
                low + (1 - low) * row / rows,
                low + (1 - low) * (row + 1) / rows,
            )
        return out

    def place(self, face: str, x: NDArray, y: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Find the patches in which points of a face lie.

        Parameters
        ----------
        face : str
        x, y : (n,) float64
            The points, in [-1, 1].

        Returns
        -------
        patch : (n,) int
            The numbers of the patches; -1 below the horizon of a half side.
        u, v : (n,) float64
            Patch coordinates.
        """
        rows = self.rows(face)
        low = 0.0 if self._is_half(face) else -1.0
        fu = (x + 1) * (self.patches / 2)
        fv = (y - low) * (rows / (1 - low))
        column = np.clip(fu, 0, self.patches - 1).astype(np.int32)
        row = np.clip(np.floor(fv), -1, rows - 1).astype(np.int32)
        patch = np.where(fv < 0, -1, self.starts[face] + row * self.patches + column)
        return patch, fu - column, fv - row

    @property
    def closed(self) -> bool:
        """Whether every direction has a patch."""
        return len(self.faces) == len(FACE_NAMES) and not self.half_sides


@dataclass(frozen=True)
class Quadtree:
    """Patches of several sizes, which do not overlap.

    Parameters
    ----------
    faces : tuple of str
    leaves : tuple of Leaf
    """

    faces: tuple[str, ...]
    leaves: tuple[Leaf, ...]

    @property
    def cells(self) -> tuple[Cell, ...]:
        """(face, row, column) of each patch. Rows and columns count leaves of the patch's size."""
        return tuple((face, row, column) for face, _, row, column in self.leaves)

    @property
    def sides(self) -> NDArray[np.intp]:
        """(K,) int: for each patch, how many patches of its size make up a side of the face."""
        return np.array([n for _, n, _, _ in self.leaves], np.intp)

    @cached_property
    def table(self) -> NDArray[np.int32]:
        """(F, 16, 16) int32: the leaf in which each cell of the finest grid lies, or -1."""
        out = np.full((len(self.faces), FINEST, FINEST), -1, np.int32)
        for k, (face, n, row, column) in enumerate(self.leaves):
            s = FINEST // n
            out[self.faces.index(face), row * s : (row + 1) * s, column * s : (column + 1) * s] = k
        return out

    @property
    def overlap(self) -> bool:
        """Whether two leaves share a cell of the finest grid."""
        return (self.table >= 0).sum() != sum((FINEST // n) ** 2 for _, n, _, _ in self.leaves)

    @cached_property
    def extents(self) -> NDArray[np.float64]:
        """(K, 4) float64: x0, x1, y0, y1 of each patch on its face."""
        out = np.empty((len(self.leaves), 4))
        for k, (_, n, row, column) in enumerate(self.leaves):
            out[k] = np.array((column, column + 1, row, row + 1), np.float64) * (2 / n) - 1
        return out

    def place(self, face: str, x: NDArray, y: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Find the leaves in which points of a face lie.

        Parameters
        ----------
        face : str
        x, y : (n,) float64
            The points, in [-1, 1].

        Returns
        -------
        patch : (n,) int32
            The numbers of the leaves; -1 where there is none.
        u, v : (n,) float64
            Patch coordinates. They mean nothing where there is no leaf.
        """
        row, column = (
            np.clip((t + 1) * (FINEST / 2), 0, FINEST - 1).astype(np.int32) for t in (y, x)
        )
        patch = self.table[self.faces.index(face)][row, column]
        x0, x1, y0, y1 = self.extents[patch].T
        return patch, (x - x0) / (x1 - x0), (y - y0) / (y1 - y0)

    @property
    def closed(self) -> bool:
        """Whether every direction has a patch."""
        return len(self.faces) == len(FACE_NAMES) and bool((self.table >= 0).all())
