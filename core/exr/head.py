"""The headers of an EXR file: what they say of its parts, without trusting them.

Examples
--------
>>> parsed(b"v/1\\x01" + bytes(8))
Traceback (most recent call last):
...
arto.core.exr.head.LayoutError: it has no header

Source
------
OpenEXR documentation, "OpenEXR File Layout".
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Sequence
from dataclasses import dataclass

from .window import PICTURE

MAGIC = b"\x76\x2f\x31\x01"
# A flag of the version: the file has several parts, or is for them.
MULTIPART = 0x1000
_VERSION = 2
# The flag that a name is longer than those of the first files could be.
_LONG_NAMES, _SHORT_NAME = 0x400, 31
# The longest name in a header, and the largest side of a picture.
_LONGEST_TEXT = 256
_LARGEST = 1 << 17
_MOST_ATTRIBUTES = 4096
# The compressions by their numbers in a file, and the lines of a chunk of each.
COMPRESSIONS = (
    "NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB", "HTJ2K256",
    "HTJ2K32",
)  # fmt: skip
LINES: dict[str, int] = dict(
    zip(COMPRESSIONS, (1, 1, 1, 16, 32, 16, 32, 32, 32, 256, 256, 32), strict=True)
)
_BOX = b"box2i"
_PIXEL_BYTES = {0: 4, 1: 2, 2: 4}
# Kind and value of each attribute of a header, by its name.
Attributes = dict[bytes, tuple[bytes, bytes]]


class LayoutError(Exception):
    """A file whose bytes are not those of a whole EXR file. The message says why, briefly."""


@dataclass(frozen=True)
class PartLayout:
    """The values of a header that decide where the chunks of its part are.

    Parameters
    ----------
    name : str
    width, height : int
        Of the data window.
    compression : int
        As the file has it: a place in `COMPRESSIONS`, or that of a newer one.
    channels : tuple of (str, int)
        Name and kind (0 whole numbers, 1 half, 2 float) of each channel.
    pixel_bytes : int
        Of all channels together.
    sampled : bool
        Whether a channel has fewer pixels than the data window.
    tiles : tuple of int or None
        Width, height and mode of the tiles; None where lines are stored.
    chunks : int
    whole : bool
        Whether the data window is all of the picture.
    attributes : dict of bytes to (bytes, bytes)
        Kind and value of all attributes of the header, by their names.
    """

    name: str
    width: int
    height: int
    compression: int
    channels: tuple[tuple[str, int], ...]
    pixel_bytes: int
    sampled: bool
    tiles: tuple[int, int, int] | None
    chunks: int
    whole: bool
    attributes: Attributes

    @property
    def packing(self) -> str:
        """The name of the compression; empty for a newer one."""
        known = self.compression < len(COMPRESSIONS)
        return COMPRESSIONS[self.compression] if known else ""

    @property
    def lines(self) -> int:
        """Lines of pixels in a chunk, or in a row of tiles."""
        if self.tiles:
            return self.tiles[1]
        return LINES.get(self.packing, 1)


def parsed(data: mmap.mmap | bytes) -> tuple[list[PartLayout], int]:
    """Read the headers of a file.

    Parameters
    ----------
    data : mmap or bytes
        The bytes of the file.

    Returns
    -------
    parts : list of PartLayout
    end : int
        The byte at which the headers end, and the tables of chunks begin.

    Raises
    ------
    LayoutError
        A header is cut off or damaged, a part is deep, or it is no EXR file.
    """
    if len(data) < 8 or data[:4] != MAGIC:
        raise LayoutError("it is no EXR file")
    flags = struct.unpack_from("<I", data, 4)[0]
    if flags & 0x800:
        raise LayoutError("its pixels are deep: flatten it first")
    multipart, tiled = bool(flags & MULTIPART), bool(flags & 0x200)
    parts, at = [], 8
    try:
        while True:
            attributes, at = _attributes(data, at)
            if attributes:
                parts.append(_part(attributes, multipart, tiled))
            if not attributes or not multipart:
                break
    except UnicodeDecodeError:
        raise LayoutError("a name in its header is no UTF-8") from None
    if not parts:
        raise LayoutError("it has no header")
    return parts, at


def packed(heads: Sequence[Attributes]) -> bytes:
    """Give the bytes of headers, with the magic number and the version before them.

    Parameters
    ----------
    heads : sequence of Attributes
        Of each part, with all that a header needs.

    Returns
    -------
    bytes
    """
    several = len(heads) > 1
    out, longest = [], 0
    for head in heads:
        for name, (kind, value) in sorted(head.items()):
            out += [name, b"\0", kind, b"\0", struct.pack("<I", len(value)), value]
            longest = max(longest, len(name), len(kind))
        names = [name.encode() for name, _ in _channels(head[b"channels"][1])[0]]
        longest = max(longest, *map(len, names))
        out.append(b"\0")
    if several:
        out.append(b"\0")
    flags = (MULTIPART if several else 0) | (_LONG_NAMES if longest > _SHORT_NAME else 0)
    return b"".join([MAGIC, struct.pack("<I", _VERSION | flags), *out])


def _text(data: mmap.mmap | bytes, at: int) -> tuple[bytes, int]:
    """A text that begins at `at`, and where it is over."""
    end = data.find(b"\0", at, at + _LONGEST_TEXT)
    if end < 0:
        raise LayoutError("its header is damaged")
    return data[at:end], end + 1


def _attributes(data: mmap.mmap | bytes, at: int) -> tuple[Attributes, int]:
    """The attributes of the header that begins at `at`, and where it ends."""
    found: Attributes = {}
    for _ in range(_MOST_ATTRIBUTES):
        name, at = _text(data, at)
        if not name:
            return found, at
        kind, at = _text(data, at)
        for text in (name, kind):
            text.decode()  # or it is no header that a library reads
        if at + 4 > len(data):
            break
        size = struct.unpack_from("<I", data, at)[0]
        at += 4
        if at + size > len(data):
            break
        found[name] = kind, data[at : at + size]
        at += size
    raise LayoutError("its header is damaged or cut off")


def _part(found: Attributes, multipart: bool, tiled: bool) -> PartLayout:
    attributes = {name: value for name, (_, value) in found.items()}
    try:
        x0, y0, x1, y1 = struct.unpack("<4i", attributes[b"dataWindow"])
        struct.unpack("<4i", attributes[b"displayWindow"])
        boxes = (b"dataWindow", b"displayWindow", PICTURE.encode())
        if any(found.get(name, (_BOX,))[0] != _BOX for name in boxes):
            raise LayoutError("its windows are damaged")
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
    elif compression < len(COMPRESSIONS):
        chunks = -(-height // LINES[COMPRESSIONS[compression]])
    else:
        chunks = said_chunks
    if chunks is None or chunks < 1 or (multipart and said_chunks not in (None, chunks)):
        raise LayoutError("its number of chunks is not that of its pixels")
    name = attributes.get(b"name", b"").rstrip(b"\0").decode()
    whole = attributes[b"displayWindow"] == attributes[b"dataWindow"]
    whole &= PICTURE.encode() not in attributes
    return PartLayout(
        name,
        width,
        height,
        compression,
        channels,
        pixel_bytes,
        sampled,
        tiles,
        chunks,
        whole,
        found,
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
        found.append((name.decode(), kind))
        sampled |= x > 1 or y > 1
    if not found:
        raise LayoutError("it has no channels")
    if len({name for name, _ in found}) < len(found):
        raise LayoutError("two of its channels have one name")
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
