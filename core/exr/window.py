"""The place of a picture in what is delivered: the display and the data window of an EXR file.

The display window is the delivered picture. The data window has the pixels that the file holds. A
picture may have more pixels at its edges (overscan), for lens distortion and camera shake, and
empty edges need not be in the file. ARTO's own files also say how large the picture was, so that
edges that were cropped as empty come back as they were.

Examples
--------
>>> plane = np.zeros((6, 8), np.float32)
>>> plane[2, 3] = 1.0
>>> parts, head = Window(overscan=1, crop=True).put([("", {"Y": plane})])
>>> parts[0][1]["Y"].shape, head["displayWindow"], head["dataWindow"]
((1, 1), (0, 0, 5, 3), (2, 1, 2, 1))

Source
------
OpenEXR documentation, "Technical Introduction to OpenEXR", overscan and windows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ExrError

# ARTO's own attribute: the box of the whole picture. With overscan it is larger than the display
# window, with a crop it is larger than the data window.
PICTURE = "arto.picture"
# A display window that makes a larger picture is taken for damage: most of it would be empty.
_MOST_PIXELS = 1 << 27
# Cycles' depth where a ray meets nothing.
NO_HIT = 1e10

Box = tuple[int, int, int, int]  # x0, y0, x1, y1, the last two inside
Part = tuple[str, dict[str, NDArray]]


@dataclass(frozen=True)
class Window:
    """The place of pictures in their files.

    Parameters
    ----------
    overscan : int
        Pixels at each edge beyond the delivered picture.
    crop : bool
        Whether empty edges are left out of the file.
    """

    overscan: int = 0
    crop: bool = False

    def check(self, shape: tuple[int, int]) -> None:
        """Check that a picture is large enough for the overscan.

        Parameters
        ----------
        shape : tuple of int
            (H, W) of the picture, overscan included.

        Raises
        ------
        ExrError
            Nothing of the picture would be left.
        """
        height, width = shape
        if self.overscan < 0:
            raise ExrError(f"an overscan of {self.overscan} pixels cannot be: 0 is none")
        if 2 * self.overscan >= min(height, width):
            raise ExrError(
                f"an overscan of {self.overscan} pixels at each edge leaves nothing of a picture "
                f"of {width}x{height}: make the scene's resolution that of the delivery and "
                f"{2 * self.overscan} more, or the overscan less"
            )

    def put(self, parts: Sequence[Part]) -> tuple[list[Part], dict[str, Any]]:
        """Prepare the parts of a file for writing.

        Parameters
        ----------
        parts : sequence of (str, dict of str to (H, W) array)
            The name and the channels of each part, all of one size.

        Returns
        -------
        parts : list
            The same, cropped.
        head : dict
            The windows, for the header.

        Raises
        ------
        ExrError
            As `check`.
        """
        shape = next(iter(parts[0][1].values())).shape
        self.check(shape)
        if not self.overscan and not self.crop:
            return list(parts), {}
        (height, width), n = shape, self.overscan
        y0, y1, x0, x1 = 0, height - 1, 0, width - 1
        if self.crop:
            planes = [plane for _, some in parts for plane in some.items()]
            y0, y1, x0, x1 = _something(planes, n)
        cut = slice(y0, y1 + 1), slice(x0, x1 + 1)
        found = [
            (name, {c: np.ascontiguousarray(plane[cut]) for c, plane in channels.items()})
            for name, channels in parts
        ]
        return found, {
            "displayWindow": (0, 0, width - 2 * n - 1, height - 2 * n - 1),
            "dataWindow": (x0 - n, y0 - n, x1 - n, y1 - n),
            PICTURE: (-n, -n, width - n - 1, height - n - 1),
        }


FULL = Window()


def _something(planes: Sequence[tuple[str, NDArray]], overscan: int) -> tuple[int, int, int, int]:
    """The first and last row and column that are not empty.

    A pixel is empty if all its channels are 0; a depth (channel Z) is also empty where no ray hit
    anything. Of an empty picture this is the first delivered pixel, because a file must have
    pixels.
    """
    shape = planes[0][1].shape
    rows, columns = np.zeros(shape[0], bool), np.zeros(shape[1], bool)
    for name, plane in planes:
        there = plane != 0
        if name.rpartition(".")[2] == "Z":
            there &= ~(plane >= NO_HIT)
        rows |= there.any(axis=1)
        columns |= there.any(axis=0)
    if not rows.any():
        return overscan, overscan, overscan, overscan
    (y,), (x,) = rows.nonzero(), columns.nonzero()
    return int(y[0]), int(y[-1]), int(x[0]), int(x[-1])


def place(heads: Sequence[dict[str, Any]], parts: Sequence[dict[str, NDArray]]) -> None:
    """Put the channels of each part of a file into the whole picture, in place.

    The whole picture is the display window and all data windows together. It is 0 where the file
    has no pixels.

    Parameters
    ----------
    heads : sequence of dict
        The header of each part.
    parts : sequence of dict of str to (H, W) array
        The channels of each part; changed in place.

    Raises
    ------
    ExrError
        The windows are those of a damaged header.
    """
    data = [head["dataWindow"] for head in heads]
    others = [head[PICTURE] for head in heads if PICTURE in head]
    whole = _around([*data, *others, *(head["displayWindow"] for head in heads)])
    width, height = whole[2] - whole[0] + 1, whole[3] - whole[1] + 1
    if width * height > _MOST_PIXELS and any(box != whole for box in data):
        raise ExrError(f"its windows make a picture of {width}x{height} pixels")
    for box, channels in zip(data, parts, strict=True):
        if box == whole:
            continue
        y, x = box[1] - whole[1], box[0] - whole[0]
        there = slice(y, y + box[3] - box[1] + 1), slice(x, x + box[2] - box[0] + 1)
        for name, pixels in channels.items():
            out = np.zeros((height, width), pixels.dtype)
            out[there] = pixels
            channels[name] = out


def _around(boxes: Sequence[Box]) -> Box:
    """The smallest box around some boxes; boxes without pixels are left out."""
    some = [b for b in boxes if b[2] >= b[0] and b[3] >= b[1]]
    x0, y0 = (min(b[i] for b in some) for i in (0, 1))
    x1, y1 = (max(b[i] for b in some) for i in (2, 3))
    return x0, y0, x1, y1
