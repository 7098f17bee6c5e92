"""PNG files: written with what Python brings along, of 8 or 16 bits, with texts in them.

Examples
--------
>>> import tempfile
>>> with tempfile.TemporaryDirectory() as folder:
...     path = Path(folder) / "white.png"
...     write(path, np.full((2, 3, 3), 255, np.uint8))
...     path.read_bytes()[1:4]
...     write(path, np.full((2, 3, 3), 255, np.uint8), {"Title": "all white"})
...     texts(path)
b'PNG'
{'Title': 'all white'}
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import FilesError
from ..files import whole
from ..regular import open_regular

_MAGIC = b"\x89PNG\r\n\x1a\n"
# The longest text that is read, in bytes.
_LONG = 1 << 22


def write(path: Path, pixels: NDArray, said: Mapping[str, str] | None = None) -> None:
    """Write a picture as PNG, whole or not at all.

    Parameters
    ----------
    path : Path
    pixels : (H, W, 3) or (H, W) uint8 or uint16
        Values as they are kept; rows from the top.
    said : mapping of str to str, optional
        Texts that the file says of itself, by keyword. ASCII, a keyword of at most 79 letters.

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
    notes = [(b"tEXt", f"{key}\0{text}".encode("ascii")) for key, text in (said or {}).items()]
    packed = zlib.compress(lines.tobytes(), 1)
    parts = ((b"IHDR", head), *notes, (b"IDAT", packed), (b"IEND", b""))
    try:
        with whole(path) as partial, partial.open("wb") as file:
            file.write(_MAGIC)
            for name, data in parts:
                crc = zlib.crc32(name + data)
                file.write(struct.pack(">I", len(data)) + name + data + struct.pack(">I", crc))
    except OSError as e:
        raise FilesError(
            f"{path} cannot be written ({e}): make room on the disk, or choose a folder that can "
            "be written"
        ) from e


def texts(path: Path) -> dict[str, str]:
    """Read the texts that stand before the pixels of a PNG file.

    Parameters
    ----------
    path : Path

    Returns
    -------
    dict of str to str
        By keyword; empty where the file is no PNG file, or says nothing.

    Raises
    ------
    OSError
        The file cannot be opened.
    """
    found: dict[str, str] = {}
    with open_regular(path) as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            return {}
        while len(head := file.read(8)) == 8:
            length, name = struct.unpack(">I4s", head)
            if name == b"IDAT" or length > _LONG:
                break
            data = file.read(length)
            if file.read(4) != struct.pack(">I", zlib.crc32(name + data)):
                break
            if name == b"tEXt":
                key, _, text = data.partition(b"\0")
                found[key.decode("latin-1")] = text.decode("latin-1")
    return found
