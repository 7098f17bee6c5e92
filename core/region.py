"""A rectangle of a picture's pixels: a tile, a render region, what is around some pixels."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import NDArray


@dataclass(frozen=True)
class Region:
    """A rectangle of pixels; rows count from the top."""

    x: int
    y: int
    width: int
    height: int

    @staticmethod
    def around(rows: NDArray, columns: NDArray) -> Region:
        """The smallest one with these pixels in it."""
        x, y = int(columns.min()), int(rows.min())
        return Region(x, y, int(columns.max()) + 1 - x, int(rows.max()) + 1 - y)

    @property
    def pixels(self) -> int:
        return self.width * self.height

    @property
    def slices(self) -> tuple[slice, slice]:
        return slice(self.y, self.y + self.height), slice(self.x, self.x + self.width)
