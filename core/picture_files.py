"""Whether all of a picture's file is there, for kinds of which readers say nothing.

Blender shows grey or black in place of what is missing of a JPEG or a TIFF. Of other kinds of files
it shows nothing, or says so. EXR files have `exr.layout`.

Examples
--------
>>> is_cut(b"\\xff\\xd8\\xff\\xe0 half of a JPEG"), is_cut(b"\\x89PNG")
(True, False)
"""

from __future__ import annotations

import mmap
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

from .regular import open_regular

EXR = b"\x76\x2f\x31\x01"
_JPEG, _END_OF_JPEG = b"\xff\xd8\xff", b"\xff\xd9"
# Cameras write so many bytes behind a JPEG at most: in these its end is looked for.
_BEHIND = 1 << 16
_TIFFS = {b"II*\0": "<", b"MM\0*": ">", b"II+\0": "<", b"MM\0+": ">"}
# Of a TIFF: where strips and tiles begin, how long they are, and how they are compressed.
_OFFSETS, _COUNTS, _COMPRESSION, _DEFLATE = (273, 324), (279, 325), 259, (8, 32946)
# Bytes of a number, by a TIFF's code for its type.
_SIZES = {1: "B", 3: "H", 4: "I", 13: "I", 16: "Q", 18: "Q"}
_MOST_PAGES, _MOST_NUMBERS = 64, 1 << 22


def kind_of(path: Path) -> str:
    """Say what a file is by how it begins, whatever its name ends with.

    Parameters
    ----------
    path : Path

    Returns
    -------
    str
        "EXR", "TIFF", "JPEG", or empty for any other.

    Raises
    ------
    OSError
        The file cannot be read.
    """
    with open_regular(path, follow=True) as file:
        begins = file.read(4)
    if begins == EXR:
        return "EXR"
    return "TIFF" if begins in _TIFFS else "JPEG" if begins.startswith(_JPEG) else ""


def is_cut_file(path: Path, unpacks: bool = True) -> bool:
    """Say whether a part of a file is missing, see `is_cut`.

    Parameters
    ----------
    path : Path
    unpacks : bool

    Returns
    -------
    bool
        True also where the file cannot be read.
    """
    try:
        with open_regular(path, follow=True) as file:
            if not file.seek(0, 2):
                return True
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
                return is_cut(data, unpacks)
    except OSError:
        return True


def is_cut(data: bytes | mmap.mmap, unpacks: bool = True) -> bool:
    """Say whether a part of a JPEG or a TIFF is missing; False for other kinds.

    Parameters
    ----------
    data : bytes or mmap
    unpacks : bool
        Whether the pixels of a TIFF packed with Deflate are unpacked, so that flipped bits are told
        too.

    Returns
    -------
    bool
    """
    begins = data[:4]
    if begins.startswith(_JPEG):
        return _END_OF_JPEG not in data[-_BEHIND:]
    if begins not in _TIFFS:
        return False
    try:
        pages = _pages(data, _TIFFS[begins])
        return any(not _is_there(data, o, c, packed and unpacks) for o, c, packed in pages)
    except (struct.error, IndexError, KeyError, ValueError):
        return True


def _is_there(data: bytes | mmap.mmap, offsets: list[int], counts: list[int], packed: bool) -> bool:
    if not offsets or len(offsets) != len(counts):
        return False
    for at, count in zip(offsets, counts, strict=True):
        if at + count > len(data):
            return False
        if packed and count:
            unpacking = zlib.decompressobj()
            try:
                unpacking.decompress(data[at : at + count])
            except zlib.error:
                return False
            if not unpacking.eof:
                return False
    return True


def _pages(data: bytes | mmap.mmap, order: str) -> Iterator[tuple[list[int], list[int], bool]]:
    """Of each page of a TIFF: the places and lengths of its strips or tiles; whether by Deflate."""
    big = data[2:4] in (b"+\0", b"\0+")
    (at,) = struct.unpack_from(order + ("Q" if big else "I"), data, 8 if big else 4)
    head, entry, number = ("Q", 20, "Q") if big else ("H", 12, "I")
    for _ in range(_MOST_PAGES):
        if not at:
            return
        (entries,) = struct.unpack_from(order + head, data, at)
        first = at + struct.calcsize(head)
        found: dict[int, list[int]] = {}
        for place in range(first, first + entries * entry, entry):
            tag, kind = struct.unpack_from(order + "HH", data, place)
            if tag in (*_OFFSETS, *_COUNTS, _COMPRESSION):
                found[tag] = _numbers(data, order, place + 4, kind, number)
        offsets, counts = (
            next((found[tag] for tag in tags if tag in found), []) for tags in (_OFFSETS, _COUNTS)
        )
        yield offsets, counts, found.get(_COMPRESSION, [1])[0] in _DEFLATE
        (at,) = struct.unpack_from(order + number, data, first + entries * entry)


def _numbers(data: bytes | mmap.mmap, order: str, place: int, kind: int, number: str) -> list[int]:
    """The numbers of an entry of a TIFF, which stand in the entry where they fit."""
    (count,) = struct.unpack_from(order + number, data, place)
    if count > _MOST_NUMBERS:
        raise ValueError(f"{count} strips")
    form = f"{order}{count}{_SIZES[kind]}"
    place += struct.calcsize(number)
    if struct.calcsize(form) > struct.calcsize(number):
        (place,) = struct.unpack_from(order + number, data, place)
    return list(struct.unpack_from(form, data, place))
