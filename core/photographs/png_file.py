"""PNG files: written with what Python brings along, of 8 or 16 bits.

Examples
--------
>>> import tempfile
>>> with tempfile.TemporaryDirectory() as folder:
...     path = Path(folder) / "white.png"
...     write(path, np.full((2, 3, 3), 255, np.uint8))
...     path.read_bytes()[1:4]
b'PNG'
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import FilesError
from ..files import whole


def write(path: Path, pixels: NDArray) -> None:
    """Write a picture as PNG, whole or not at all.

    Parameters
    ----------
    path : Path
    pixels : (H, W, 3) or (H, W) uint8 or uint16
        Values as they are kept; rows from the top.

    Raises
    ------
    FilesError
        The file cannot be written.
    """
    if pixels.dtype not in (np.uint8, np.uint16):
        raise TypeError(f"a PNG has 8 or 16 bits, not {pixels.dtype}")
    height, width = pixels.shape[:2]
    depth = 8 * pixels.dtype.itemsize
    rows = np.ascontiguousarray(pixels.astype(pixels.dtype.newbyteorder(">"))).reshape(height, -1)
    # a 0 before each row: it is kept as it is
    lines = np.zeros((height, 1 + rows.shape[1] * rows.itemsize), np.uint8)
    lines[:, 1:] = rows.view(np.uint8).reshape(height, -1)
    colour = 2 if pixels.ndim == 3 else 0
    head = struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0)
    parts = ((b"IHDR", head), (b"IDAT", zlib.compress(lines.tobytes(), 1)), (b"IEND", b""))
    try:
        with whole(path) as partial, partial.open("wb") as file:
            file.write(b"\x89PNG\r\n\x1a\n")
            for name, data in parts:
                crc = zlib.crc32(name + data)
                file.write(struct.pack(">I", len(data)) + name + data + struct.pack(">I", crc))
    except OSError as e:
        raise FilesError(
            f"{path} cannot be written ({e}): make room on the disk, or choose a folder that can "
            "be written"
        ) from e
