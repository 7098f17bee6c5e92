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
arto.core.exr.layout.LayoutError: it is no EXR file

Source
------
OpenEXR documentation, "OpenEXR File Layout".
"""

from __future__ import annotations

import mmap
import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .window import PICTURE

# The longest name in a header, and the largest side of a picture.
_LONGEST_TEXT = 256
_LARGEST = 1 << 17
_MOST_ATTRIBUTES = 4096
# Lines of a chunk, by compression: none, RLE, ZIPS, ZIP, PIZ, PXR24, B44, B44A, DWAA, DWAB,
# HTJ2K256, HTJ2K32.
_LINES = (1, 1, 1, 16, 32, 16, 32, 32, 32, 256, 256, 32)
_NONE = 0
_UINT = 0
# The most bytes of pixels for one byte of a chunk: the limit of deflate, and for the other
# compressions what pictures of one colour reach.
_MOST_PACKED = {1: 130, 2: 1100, 3: 1100, 5: 1100}
_MOST_PACKED_ELSE = 1 << 15
_PIXEL_BYTES = {0: 4, 1: 2, 2: 4}


class LayoutError(Exception):
    """A file whose bytes are not those of a whole EXR file. The message says why, briefly."""


@dataclass(frozen=True)
class _Part:
    """The values of a header that decide where the chunks of its part are."""

    name: str
    width: int
    height: int
    compression: int
    channels: tuple[tuple[str, int], ...]
    pixel_bytes: int
    sampled: bool
    tiles: tuple[int, int, int] | None
    chunks: int
    # whether its data window is all of the picture
    whole: bool


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


def check(data: mmap.mmap | bytes) -> int:
    """Check that a file is whole.

    Parameters
    ----------
    data : mmap or bytes
        The bytes of the file.

    Returns
    -------
    int
        The number of its parts.

    Raises
    ------
    LayoutError
        The file is truncated, damaged, deep, or no EXR file.
    """
    return len(_checked(data)[0])


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


def _checked(data: mmap.mmap | bytes) -> tuple[list[_Part], list[NDArray], int]:
    """The parts, the table of each, and the bytes before a chunk's size. Raises LayoutError."""
    if len(data) < 8 or data[:4] != b"\x76\x2f\x31\x01":
        raise LayoutError("it is no EXR file")
    flags = struct.unpack_from("<I", data, 4)[0]
    if flags & 0x800:
        raise LayoutError("its pixels are deep: flatten it first")
    multipart, tiled = bool(flags & 0x1000), bool(flags & 0x200)
    parts, at = _headers(data, multipart, tiled)
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


def _headers(data: mmap.mmap | bytes, multipart: bool, tiled: bool) -> tuple[list[_Part], int]:
    """All headers, and where they end."""
    parts, at = [], 8
    while True:
        attributes, at = _attributes(data, at)
        if attributes:
            parts.append(_part(attributes, multipart, tiled))
        if not attributes or not multipart:
            break
    if not parts:
        raise LayoutError("it has no header")
    return parts, at


def _text(data: mmap.mmap | bytes, at: int) -> tuple[bytes, int]:
    """A text that begins at `at`, and where it is over."""
    end = data.find(b"\0", at, at + _LONGEST_TEXT)
    if end < 0:
        raise LayoutError("its header is damaged")
    return data[at:end], end + 1


def _attributes(data: mmap.mmap | bytes, at: int) -> tuple[dict[bytes, bytes], int]:
    """The attributes of the header that begins at `at`, and where it ends."""
    found: dict[bytes, bytes] = {}
    for _ in range(_MOST_ATTRIBUTES):
        name, at = _text(data, at)
        if not name:
            return found, at
        _, at = _text(data, at)
        if at + 4 > len(data):
            break
        size = struct.unpack_from("<I", data, at)[0]
        at += 4
        if at + size > len(data):
            break
        found[name] = data[at : at + size]
        at += size
    raise LayoutError("its header is damaged or cut off")


def _part(attributes: dict[bytes, bytes], multipart: bool, tiled: bool) -> _Part:
    try:
        x0, y0, x1, y1 = struct.unpack("<4i", attributes[b"dataWindow"])
        (compression,) = struct.unpack("<B", attributes[b"compression"])
        channels, sampled = _channels(attributes[b"channels"])
        pixel_bytes = sum(_PIXEL_BYTES[kind] for _, kind in channels)
        kind = attributes.get(b"type", b"").rstrip(b"\0")
        said = attributes.get(b"chunkCount")
        said_chunks = struct.unpack("<i", said)[0] if said is not None else None
        tiles = None
        if tiled or kind == b"tiledimage":
            tile_width, tile_height, mode = struct.unpack("<IIB", attributes[b"tiles"])
            tiles = tile_width, tile_height, mode
    except KeyError as e:
        raise LayoutError(f"its header has no {e.args[0].decode()}") from None
    except struct.error:
        raise LayoutError("its header is damaged") from None
    if kind.startswith(b"deep"):
        raise LayoutError("its pixels are deep: flatten it first")
    width, height = x1 - x0 + 1, y1 - y0 + 1
    if not (0 < width <= _LARGEST and 0 < height <= _LARGEST):
        raise LayoutError(f"it cannot be {width}x{height} pixels")
    if tiles:
        chunks = _tile_count(width, height, *tiles)
    elif compression < len(_LINES):
        chunks = -(-height // _LINES[compression])
    else:
        chunks = said_chunks
    if chunks is None or chunks < 1 or (multipart and said_chunks not in (None, chunks)):
        raise LayoutError("its number of chunks is not that of its pixels")
    name = attributes.get(b"name", b"").rstrip(b"\0").decode("utf-8", "replace")
    # the library itself reports a missing display window
    whole = attributes.get(b"displayWindow") in (None, attributes[b"dataWindow"])
    whole &= PICTURE.encode() not in attributes
    return _Part(
        name, width, height, compression, channels, pixel_bytes, sampled, tiles, chunks, whole
    )


def _channels(data: bytes) -> tuple[tuple[tuple[str, int], ...], bool]:
    """Name and kind of each channel, and whether one of them is subsampled."""
    found, at, sampled = [], 0, False
    while True:
        name, at = _text(data, at)
        if not name:
            break
        kind, _, x, y = struct.unpack_from("<iIii", data, at)
        at += 16
        if kind not in _PIXEL_BYTES or x < 1 or y < 1:
            raise LayoutError("it has a damaged channel")
        found.append((name.decode("utf-8", "replace"), kind))
        sampled |= x > 1 or y > 1
    if not found:
        raise LayoutError("it has no channels")
    return tuple(found), sampled


def _tile_count(width: int, height: int, tile_width: int, tile_height: int, mode: int) -> int:
    """The number of tiles of all levels of a part."""
    if tile_width < 1 or tile_height < 1:
        raise LayoutError("its tiles have no size")
    levels, up = mode & 15, mode >> 4

    def sizes(size: int) -> list[int]:
        """Of each level, down to one pixel."""
        out = [size]
        while out[-1] > 1:
            n = len(out)
            out.append(max(1, -(-size >> n) if up else size >> n))
        return out

    def tiles(w: int, h: int) -> int:
        return -(-w // tile_width) * -(-h // tile_height)

    if levels == 0:
        return tiles(width, height)
    across, down = sizes(width), sizes(height)
    if levels == 1:
        count = max(len(across), len(down))
        across += [1] * (count - len(across))
        down += [1] * (count - len(down))
        return sum(tiles(w, h) for w, h in zip(across, down, strict=True))
    if levels == 2:
        return sum(tiles(w, h) for w in across for h in down)
    raise LayoutError("its levels are of no known kind")


def _check_chunks(
    data: mmap.mmap | bytes, part: _Part, table: NDArray, first: int, number: int | None
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
