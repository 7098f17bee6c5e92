"""The layout of an EXR file's bytes: whether all is there that its headers say, before it is read.

The library reads what is left of a truncated file and fills the rest, and takes a header at its
word when it makes room. Here a file is whole when every chunk of every part lies inside it, with a
size that its pixels can have. Nothing is decoded. Layout: magic, version, headers, a table of chunk
offsets for each part, chunks. Source: the file layout of the OpenEXR documentation.
"""

from __future__ import annotations

import mmap
import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .window import PICTURE

# No name in a header is longer, and no picture larger.
_LONGEST_TEXT = 256
_LARGEST = 1 << 17
_MOST_ATTRIBUTES = 4096
# Lines of a chunk, by compression: none, RLE, ZIPS, ZIP, PIZ, PXR24, B44, B44A, DWAA, DWAB,
# HTJ2K256, HTJ2K32.
_LINES = (1, 1, 1, 16, 32, 16, 32, 32, 32, 256, 256, 32)
_NONE = 0
_UINT = 0
# Bytes that one byte of a chunk may stand for: deflate's limit, and what flat pictures come to in
# the others.
_MOST_PACKED = {1: 130, 2: 1100, 3: 1100, 5: 1100}
_MOST_PACKED_ELSE = 1 << 15
_PIXEL_BYTES = {0: 4, 1: 2, 2: 4}


class LayoutError(Exception):
    """What is wrong with the file, in a few words."""


@dataclass(frozen=True)
class _Part:
    """What of a header decides where its chunks are."""

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
    """A part whose lines lie in the file as they are, one after the other.

    channels: name and kind (1 half, 2 float) of each, in the order that they have in a line;
    offset: where the first line's pixels begin; stride: from a line to the next, in bytes.
    """

    name: str
    width: int
    height: int
    channels: tuple[tuple[str, int], ...]
    offset: int
    stride: int


def check(data: mmap.mmap | bytes) -> int:
    """How many parts the file has. Raises LayoutError for one that is not whole."""
    return len(_checked(data)[0])


def plain(data: mmap.mmap | bytes) -> list[PlainPart] | None:
    """The parts of a file whose pixels may be read where they lie; None where any is packed, tiled,
    out of order, or not all of the picture. Raises LayoutError for a file that is not whole."""
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
        # each line says how long it is, and which one: the first is enough where all are alike
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
            # a word of each chunk was looked at, and all of the file would stay in memory
            forget(data, int(table.min()), int(table.max()))
    return parts, tables, 8 if multipart else 4


def forget(data: mmap.mmap, start: int, end: int) -> None:
    """Give back the pages that lie in a stretch of a mapped file; they are read again when asked
    for. Systems that have no such call do so by themselves when memory is short."""
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
    # of what has no display window the library says that itself
    whole = attributes.get(b"displayWindow") in (None, attributes[b"dataWindow"])
    whole &= PICTURE.encode() not in attributes
    return _Part(
        name, width, height, compression, channels, pixel_bytes, sampled, tiles, chunks, whole
    )


def _channels(data: bytes) -> tuple[tuple[tuple[str, int], ...], bool]:
    """Name and kind of each channel, and whether any has not all pixels."""
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
    """Tiles of all levels of a part."""
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
    """Raise LayoutError unless every chunk of a part is there, of a size that it can have.

    first: where the chunks begin; number: of the part, None in a file of one.
    """
    size = len(data)
    leader = (4 if number is not None else 0) + (16 if part.tiles else 4)
    offsets = table.astype(np.int64)
    if (table > size).any() or (offsets < first).any() or (offsets + leader + 4 > size).any():
        raise LayoutError("chunks of it are missing")

    def number_at(places: NDArray) -> NDArray[np.int64]:
        # a copy of what is there: a view of a mapped file would keep it open
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
