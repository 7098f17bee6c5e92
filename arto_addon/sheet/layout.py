"""Where the cells of a contact sheet and its words stand; lengths are pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.errors import SceneError

# The widest picture of a cell, and the narrowest cell: its words need room.
WIDEST, NARROWEST = 480, 220
# Of the words, and of a line of them.
SIZE, LINE = 14, 20
GAP = 16
# A picture's grey where nothing is in it, and that around the pictures, as on the screen.
GREY, AROUND = 0.22, 0.12
# The longest side of a sheet.
LONGEST = 16384


@dataclass(frozen=True)
class Layout:
    """A grid of cells, under a line of words. width, height: of the pictures."""

    columns: int
    rows: int
    width: int
    height: int

    @property
    def cell(self) -> tuple[int, int]:
        """The height and the width of a cell with its words and its gaps."""
        return self.height + 2 * LINE + 2 * GAP, max(self.width, NARROWEST) + GAP

    @property
    def size(self) -> tuple[int, int]:
        """The height and the width of the sheet."""
        height, width = self.cell
        return GAP + LINE + GAP + self.rows * height, GAP + self.columns * width

    def corner(self, number: int) -> tuple[int, int]:
        """The row and the column of a picture's upper left pixel. number: of the cell, by rows."""
        height, width = self.cell
        row, column = divmod(number, self.columns)
        return 2 * GAP + LINE + row * height, GAP + column * width


def layout(lights: int, views: int, width: int, height: int) -> Layout:
    """A grid of a row for each light and a column for each view; in a square where there is one of
    either. Raises SceneError where no picture can be so large.

    views: cameras times frames; width, height: of the largest picture.
    """
    columns = views if lights > 1 and views > 1 else math.ceil(math.sqrt(lights * views))
    found = Layout(columns, math.ceil(lights * views / columns), width, height)
    if max(found.size) > LONGEST:
        raise SceneError(
            f"a sheet of {lights} lights and {views} frames would be {found.size[1]} x "
            f"{found.size[0]} pixels, and {LONGEST} are the most: take every so many frames, as in "
            "1-100:10"
        )
    return found


def smaller(picture: NDArray[np.float32], width: int) -> NDArray[np.float32]:
    """A picture (H, W, C) of at most a width: each pixel is the mean of all that it covers."""
    rows, columns = picture.shape[:2]
    if columns <= width:
        return picture
    height = max(1, round(rows * width / columns))
    high = np.tensordot(_shares(rows, height), picture, (1, 0))
    return np.tensordot(_shares(columns, width), high, (1, 1)).transpose(1, 0, 2)


def _shares(many: int, few: int) -> NDArray[np.float32]:
    """How much each of many pixels counts in each of few -> (few, many), rows that sum to 1."""
    edges = np.arange(few + 1) * (many / few)
    begin, end = edges[:-1, None], edges[1:, None]
    at = np.arange(many)
    covered = np.minimum(end, at + 1) - np.maximum(begin, at)
    return (np.maximum(covered, 0) * (few / many)).astype(np.float32)
