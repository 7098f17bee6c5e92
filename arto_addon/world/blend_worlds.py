"""The worlds of a .blend that are marked as assets, read without opening the file in Blender.

A .blend is a row of blocks, each behind a small head. So the names of its worlds are found by
reading the heads alone, in a thread.
"""

from __future__ import annotations

import importlib
import struct
from pathlib import Path
from typing import IO, Any

from ...core.regular import open_regular

# How a compressed file begins.
_ZSTD = b"\x28\xb5\x2f\xfd"
# No .blend of assets has more blocks.
_MOST = 1 << 20
# In a world: where its asset data are pointed to, and where its name begins, behind five pointers.
_ASSET, _NAME = 32, 40


def worlds_in(path: Path) -> list[str]:
    """The names of the worlds that are assets; none for a file that is damaged or cannot be read.

    A compressed file is read where Python has what Blender compresses with.
    """
    try:
        with open_regular(path, follow=True) as file:
            packed = file.read(4) == _ZSTD
            file.seek(0)
            if not packed:
                return sorted(_worlds(file))
            if (library := zstandard()) is None:
                return []
            reader = library.ZstdDecompressor().stream_reader(file, read_across_frames=True)
            try:
                return sorted(_worlds(reader))
            except library.ZstdError:
                return []
    except (OSError, ValueError, struct.error):
        return []


def zstandard() -> Any | None:
    """The library for compressed files, which Blender brings along; None in a Python without it."""
    try:
        return importlib.import_module("zstandard")
    except ImportError:
        return None


def _worlds(file: IO[bytes]) -> list[str]:
    start = file.read(12)
    if not start.startswith(b"BLENDER"):
        return []
    if start[7:8] in b"-_":  # before Blender 5: pointer, order of bytes, three digits
        if start[7:9] != b"-v":
            return []
        head = struct.Struct("<4sIQII")
        length = 1
    else:  # the size of this line, pointer, version of the format, order of bytes, four digits
        file.read(int(start[7:9]) - len(start))
        head = struct.Struct("<4sIQqq")
        length = 3
    found = []
    for _ in range(_MOST):
        block = head.unpack(file.read(head.size))
        code, size = block[0], block[length]
        if code == b"ENDB":
            break
        if size < 0:
            raise ValueError("a block of less than no bytes")
        at = file.tell()
        if code == b"WO\0\0":
            data = file.read(min(size, 400))
            name = data[_NAME:].split(b"\0")[0]
            if name.startswith(b"WO") and any(data[_ASSET:_NAME]):
                found.append(name[2:].decode("utf-8", "replace"))
        file.seek(at + size)
    return found
