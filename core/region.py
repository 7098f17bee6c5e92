"""A rectangle of a picture's pixels: a tile, a render region, the surroundings of some pixels."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import NDArray


@dataclass(frozen=True)
class Region:
    """A rectangle of pixels of a picture.

    Parameters
    ----------
    x, y : int
        The leftmost column and the topmost row. Rows count from the top of the picture.
    width, height : int
        Numbers of columns and rows.

    Examples
    --------
    >>> Region(0, 0, 8, 4).overlap(Region(6, 2, 8, 8))
    Region(x=6, y=2, width=2, height=2)
    """

    x: int
    y: int
    width: int
    height: int

    @staticmethod
    def around(rows: NDArray, columns: NDArray) -> Region:
        """Find the smallest rectangle that holds some pixels.

        Parameters
        ----------
        rows, columns : (n,) int
            The places of the pixels, at least one.

        Returns
        -------
        Region
        """
        x, y = int(columns.min()), int(rows.min())
        return Region(x, y, int(columns.max()) + 1 - x, int(rows.max()) + 1 - y)

    @property
    def pixels(self) -> int:
        """The number of pixels."""
        return self.width * self.height

    @property
    def slices(self) -> tuple[slice, slice]:
        """The rows and the columns, to index a picture (H, W, ...) with."""
        return slice(self.y, self.y + self.height), slice(self.x, self.x + self.width)

    def overlap(self, other: Region) -> Region | None:
        """Find the pixels that two rectangles share.

        Parameters
        ----------
        other : Region

        Returns
        -------
        Region or None
            None where the rectangles share no pixel.
        """
        x, y = max(self.x, other.x), max(self.y, other.y)
        right = min(self.x + self.width, other.x + other.width)
        bottom = min(self.y + self.height, other.y + other.height)
        return Region(x, y, right - x, bottom - y) if right > x and bottom > y else None
