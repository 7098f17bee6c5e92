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

    def overlap(self, other: Region) -> Region | None:
        """What is in both; None for nothing."""
        x, y = max(self.x, other.x), max(self.y, other.y)
        right = min(self.x + self.width, other.x + other.width)
        bottom = min(self.y + self.height, other.y + other.height)
        return Region(x, y, right - x, bottom - y) if right > x and bottom > y else None
