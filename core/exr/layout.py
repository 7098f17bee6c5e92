"""The layout of an EXR file's bytes: whether everything is there that its headers announce.

The OpenEXR library reads what is left of a truncated file and fills in the rest, and it allocates
whatever a header asks for. Here a file counts as whole when every chunk of every part lies inside
it and has a size that its pixels can have. Nothing is decoded. The layout is: magic number,
version, headers, a table of chunk offsets for each part, chunks.

Examples
--------
>>> check(b"no picture")
Traceback (most recent call last):
...
arto.core.exr.head.LayoutError: it is no EXR file

Source
------
OpenEXR documentation, "OpenEXR File Layout".
"""

from __future__ import annotations

import io
import mmap
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .head import (
    MULTIPART,
    Attributes,
    LayoutError,
    PartLayout,
    packed,
    parsed,
)

_NONE = 0
_UINT = 0
# The most bytes of pixels for one byte of a chunk: the limit of deflate, and for the other
# compressions what pictures of one colour reach.
_MOST_PACKED = {1: 130, 2: 1100, 3: 1100, 5: 1100}
_MOST_PACKED_ELSE = 1 << 15
_MOVED_AT_ONCE = 1 << 22
# The attributes that tell how the pixels of a part are stored.
_STORED = {b"channels", b"chunkCount", b"compression", b"dataWindow", b"lineOrder"}


@dataclass(frozen=True)
class PlainPart:
    """A part whose lines of pixels lie in the file uncompressed, one after the other.

    Parameters
    ----------
    name : str
    width, height : int
    channels : tuple of (str, int)
        Name and kind (1 half, 2 float) of each channel, in their order within a line.
    offset : int
        The byte at which the pixels of the first line begin.
    stride : int
        Bytes from a line to the next.
    """

    name: str
    width: int
    height: int
    channels: tuple[tuple[str, int], ...]
    offset: int
    stride: int


def check(data: mmap.mmap | bytes) -> list[PartLayout]:
    """Check that a file is whole.

    Parameters
    ----------
    data : mmap or bytes
        The bytes of the file.

    Returns
    -------
    list of PartLayout
        Its parts.

    Raises
    ------
    LayoutError
        The file is truncated, damaged, deep, or no EXR file.
    """
    return _checked(data)[0]


def plain(data: mmap.mmap | bytes) -> list[PlainPart] | None:
    """Find the parts of a file whose pixels can be read where they lie.

    Parameters
    ----------
    data : mmap or bytes
        The bytes of the file.

    Returns
    -------
    list of PlainPart or None
        None where a part is compressed, tiled, out of order, or has not all pixels of the picture.

    Raises
    ------
    LayoutError
        As `check`.
    """
    parts, tables, leader = _checked(data)
    found = []
    for part, table in zip(parts, tables, strict=True):
        stride = leader + 4 + part.width * part.pixel_bytes
        apart = part.compression != _NONE or part.tiles or part.sampled or not part.whole
        if apart or (np.diff(table.astype(np.int64)) != stride).any():
            return None
        if any(kind == _UINT for _, kind in part.channels):
            return None
        first = int(table[0])
        # each line begins with its number and its length; all lines have the length of the first
        if struct.unpack_from("<I", data, first + leader)[0] != stride - leader - 4:
            return None
        offset = first + leader + 4
        found.append(PlainPart(part.name, part.width, part.height, part.channels, offset, stride))
    return found


def put_heads(path: Path, heads: Sequence[Attributes]) -> None:
    """Put other headers into a whole file; the tables of chunks and the chunks move with them.

    What tells how the pixels are stored stays as it is.

    Parameters
    ----------
    path : Path
        A file that nobody reads yet: it is changed in place.
    heads : sequence of Attributes
        The attributes of each part.

    Raises
    ------
    LayoutError
        The file is not whole.
    OSError
        It cannot be written.
    """
    with path.open("r+b") as file:
        size = file.seek(0, io.SEEK_END)
        if not size:
            raise LayoutError("it is empty")
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            parts, tables, _ = _checked(data)
            end = parsed(data)[1]
        headers = packed(
            [
                head | {n: value for n, value in part.attributes.items() if n in _STORED}
                for part, head in zip(parts, heads, strict=True)
            ]
        )
        by = len(headers) - end
        if by:
            starts = range(end, size, _MOVED_AT_ONCE)
            # a block must not be written over one that was not read yet
            for start in reversed(starts) if by > 0 else starts:
                file.seek(start)
                block = file.read(min(_MOVED_AT_ONCE, size - start))
                file.seek(start + by)
                file.write(block)
            file.truncate(size + by)
        file.seek(0)
        file.write(headers)
        for table in tables:
            file.write((table.astype("<i8") + by).tobytes())


def _checked(data: mmap.mmap | bytes) -> tuple[list[PartLayout], list[NDArray], int]:
    """The parts, the table of each, and the bytes before a chunk's size. Raises LayoutError."""
    parts, at = parsed(data)
    multipart = bool(struct.unpack_from("<I", data, 4)[0] & MULTIPART)
    tables = []
    for part in parts:
        end = at + 8 * part.chunks
        if end > len(data):
            raise LayoutError("its table of chunks is cut off")
        tables.append(np.frombuffer(data[at:end], "<u8"))
        at = end
    for number, (part, table) in enumerate(zip(parts, tables, strict=True)):
        _check_chunks(data, part, table, at, number if multipart else None)
        if len(table) and isinstance(data, mmap.mmap):
            # the check read a word of each chunk, which would keep all of the file in memory
            forget(data, int(table.min()), int(table.max()))
    return parts, tables, 8 if multipart else 4


def forget(data: mmap.mmap, start: int, end: int) -> None:
    """Give back the memory of a stretch of a mapped file; it is read again when it is needed.

    Systems without such a call free the memory by themselves when they are short of it.

    Parameters
    ----------
    data : mmap
    start, end : int
        The stretch in bytes.
    """
    first = -(-start // mmap.PAGESIZE) * mmap.PAGESIZE
    length = min(end, len(data)) // mmap.PAGESIZE * mmap.PAGESIZE - first
    if length > 0 and hasattr(data, "madvise"):
        data.madvise(mmap.MADV_DONTNEED, first, length)


def _check_chunks(
    data: mmap.mmap | bytes, part: PartLayout, table: NDArray, first: int, number: int | None
) -> None:
    """Raise LayoutError unless every chunk of a part is there and has a possible size.

    first: the byte at which the chunks begin; number: of the part, None in a file of one part.
    """
    size = len(data)
    leader = (4 if number is not None else 0) + (16 if part.tiles else 4)
    offsets = table.astype(np.int64)
    if (table > size).any() or (offsets < first).any() or (offsets + leader + 4 > size).any():
        raise LayoutError("chunks of it are missing")

    def number_at(places: NDArray) -> NDArray[np.int64]:
        # the numbers are copied, because a view would keep the mapped file open
        view = np.frombuffer(data, np.uint8)
        found = sum(view.take(places + i).astype(np.int64) << 8 * i for i in range(4))
        del view
        return np.asarray(found, np.int64)

    if number is not None and (number_at(offsets) != number).any():
        raise LayoutError("its chunks are mixed up")
    packed = number_at(offsets + leader)
    if (packed < 1).any() or (offsets + leader + 4 + packed > size).any():
        raise LayoutError("chunks of it are cut off")
    pixels = part.width * part.height
    if part.tiles:
        pixels = part.tiles[0] * part.tiles[1] * part.chunks
    room = pixels * part.pixel_bytes
    most = 1 if part.compression == _NONE else _MOST_PACKED.get(part.compression, _MOST_PACKED_ELSE)
    if room > most * int(packed.sum()) and not part.tiles and not part.sampled:
        raise LayoutError("its pixels do not fit into its chunks")
