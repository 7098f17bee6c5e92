"""The file of a tile: some arrays with an index, of which one map gives all of them.

A head of 64 bytes says where the index is. The index says of each array its name, type, shape,
place and checksum. docs/field-format.md has it byte by byte.

>>> import tempfile
>>> with tempfile.TemporaryDirectory() as folder:
...     path = Path(folder) / "tile.arto"
...     with written(path) as out:
...         out.add("peaks", np.array([1, 2.5], np.float32))
...     found = TileFile(path)
...     print(sorted(found.sizes.items()), found.load("peaks").tolist())
...     del found
[('peaks', 8)] [1.0, 2.5]
"""

from __future__ import annotations

import contextlib
import json
import mmap
import re
import struct
import sys
import zlib
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from .. import checksum
from ..errors import FieldError
from ..files import whole
from ..regular import WITHHELD, open_regular

MAGIC = b"ARTOTILE"
VERSION = 1
# Arrays begin at multiples of so many bytes: a line of the cache, and more than any type needs.
ALIGNED = 64
# Magic, version, 4 bytes of nothing, place and bytes of the index, its checksum, and that of the
# head up to here.
_HEAD = struct.Struct("<8sIIQQI")
_SUM = struct.Struct("<I")
# An index of a tile with a hundred light groups has under 20,000 bytes.
MOST_INDEX, MOST_ARRAYS, MOST_AXES = 1 << 20, 4096, 4
TYPES = {"u1": np.uint8, "u2": np.uint16, "u4": np.uint32, "f2": np.float16, "f4": np.float32}
_NAME = re.compile(r"[\w][\w .~-]{0,120}")
# Bytes that are copied at a time.
_STEP = 1 << 24


@dataclass(frozen=True)
class Stored:
    """An array in the file of a tile.

    Parameters
    ----------
    name : str
        What it is found by.
    type : str
        One of `TYPES`; in the file little endian.
    shape : tuple of int
        Its sides.
    offset : int
        Where its first byte is in the file.
    bytes : int
        How many it has.
    crc32 : int
        The checksum of these, as in zlib.
    """

    name: str
    type: str
    shape: tuple[int, ...]
    offset: int
    bytes: int
    crc32: int

    @property
    def dtype(self) -> np.dtype:
        """The type of its numbers, as numpy has it."""
        return np.dtype(TYPES[self.type]).newbyteorder("<")


class TileFile:
    """The file of a tile, mapped: arrays are read from the disk as they are used.

    An array is compared with its checksum the first time that it is asked for. The map is let go
    with the last array of it.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    FieldError
        If the file is missing, is no file, or its index is damaged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with _opened(path) as file:
            self.index = _index(file, path)
            self._map = _mapped(file)
        self._compared: set[str] = set()

    @property
    def sizes(self) -> dict[str, int]:
        """The names of its arrays, and how many bytes each has."""
        return {name: stored.bytes for name, stored in self.index.items()}

    def check(self) -> None:
        """Compare all arrays with their checksums.

        Raises
        ------
        FieldError
            If one is not what was written.
        """
        for name in self.index:
            self.load(name)

    def load(self, name: str) -> NDArray:
        """One of its arrays.

        Parameters
        ----------
        name : str

        Returns
        -------
        array
            Mapped, and read only.

        Raises
        ------
        FieldError
            If there is none of that name, or its bytes are not those that were written.
        """
        stored = self.index.get(name)
        if stored is None:
            raise FieldError(f"{self.path} lacks '{name}': fit again")
        if name not in self._compared:
            end = stored.offset + stored.bytes
            with memoryview(self._map) as mapped, mapped[stored.offset : end] as data:
                found = checksum.crc32(data)
            if found != stored.crc32:
                raise _damaged(self.path, f"'{name}' is not what was written")
            self._compared.add(name)
        return np.ndarray(stored.shape, stored.dtype, self._map, stored.offset)


class TileFileWriter:
    """Writes the file of a tile, array after array; see `written`.

    Parameters
    ----------
    file : IO[bytes]
        Open to be written, and empty.
    """

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self._stored: list[Stored] = []
        file.write(bytes(ALIGNED))

    @property
    def stored(self) -> tuple[Stored, ...]:
        """The arrays that were added so far."""
        return tuple(self._stored)

    def add(self, name: str, array: NDArray) -> None:
        """Write an array.

        Parameters
        ----------
        name : str
            What it will be found by.
        array : array
            Of one of `TYPES`.

        Raises
        ------
        OSError
            If it cannot be written.
        """
        kind = f"{array.dtype.kind}{array.dtype.itemsize}"
        # little endian on every machine, row by row
        array = np.ascontiguousarray(array, np.dtype(TYPES[kind]).newbyteorder("<"))
        data = array.reshape(-1).view(np.uint8).data
        offset = self._aligned()
        self._file.write(data)
        size = (array.nbytes, checksum.crc32(data))
        self._stored.append(Stored(name, kind, array.shape, offset, *size))

    def copy(self, stored: Stored, source: IO[bytes], path: Path) -> None:
        """Write an array as it is in another tile's file.

        Parameters
        ----------
        stored : Stored
            The array.
        source : IO[bytes]
            The file that has it, open.
        path : Path
            Of that file, for messages.

        Raises
        ------
        FieldError
            If its checksum is not that of its bytes.
        OSError
            If it cannot be read or written.
        """
        offset, found, left = self._aligned(), 0, stored.bytes
        source.seek(stored.offset)
        while left and (data := source.read(min(left, _STEP))):
            found, left = zlib.crc32(data, found), left - len(data)
            self._file.write(data)
        if left or found != stored.crc32:
            raise _damaged(path, f"'{stored.name}' is not what was written")
        kept = (stored.bytes, stored.crc32)
        self._stored.append(Stored(stored.name, stored.type, stored.shape, offset, *kept))

    def close(self) -> None:
        """Write the index, then the head: with it the file is one.

        Raises
        ------
        OSError
            If they cannot be written.
        """
        index = json.dumps([asdict(s) for s in self._stored]).encode()
        offset = self._aligned()
        self._file.write(index)
        head = _HEAD.pack(MAGIC, VERSION, 0, offset, len(index), zlib.crc32(index))
        self._file.seek(0)
        self._file.write(head + _SUM.pack(zlib.crc32(head)))

    def _aligned(self) -> int:
        """Go on at the next multiple of `ALIGNED`."""
        at = self._file.tell()
        self._file.write(bytes(-at % ALIGNED))
        return at + -at % ALIGNED


@contextlib.contextmanager
def written(path: Path) -> Iterator[TileFileWriter]:
    """Write the file of a tile, whole or not at all.

    Parameters
    ----------
    path : Path
        The file; folders above it are made.

    Yields
    ------
    TileFileWriter
        What takes the arrays.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    with whole(path) as partial, partial.open("wb") as file:
        out = TileFileWriter(file)
        yield out
        out.close()


def rewrite(path: Path, arrays: dict[str, NDArray]) -> None:
    """Put arrays into the file of a tile, new ones or in the place of those of their names.

    Parameters
    ----------
    path : Path
        The file. Nothing may have it mapped: Windows does not replace such a file.
    arrays : dict of str to array
        By their names.

    Raises
    ------
    FieldError
        If the file is missing or damaged, what is copied included; then it stays as it is.
    OSError
        If it cannot be written.
    """
    with written(path) as out, _opened(path) as source:
        for stored in _index(source, path).values():
            if stored.name not in arrays:
                out.copy(stored, source, path)
        for name, array in arrays.items():
            out.add(name, array)


def _damaged(path: Path, why: object) -> FieldError:
    return FieldError(f"{path} is missing or damaged ({why}): fit again")


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[IO[bytes]]:
    """The file, to be read. Raises FieldError where there is none."""
    try:
        # a pipe or a device in its place would be waited for
        file = open_regular(path, follow=True)
    except OSError as e:
        if e.errno in WITHHELD:
            raise FieldError(f"{path} cannot be read ({e}): see its permissions and disk") from e
        raise _damaged(path, e) from e
    with file:
        yield file


def _mapped(file: IO[bytes]) -> mmap.mmap:
    """All of a file as memory that is read as it is used."""
    options: dict[str, Any] = {"access": mmap.ACCESS_READ}
    if sys.version_info >= (3, 13) and sys.platform != "win32":
        # a map needs no open file, of which a process has few
        options["trackfd"] = False
    return mmap.mmap(file.fileno(), 0, **options)


def _index(file: IO[bytes], path: Path) -> dict[str, Stored]:
    """The arrays of a file by their names. Raises FieldError where they cannot be."""
    try:
        size = file.seek(0, 2)
        file.seek(0)
        head = file.read(ALIGNED)
        if len(head) < ALIGNED or head[: len(MAGIC)] != MAGIC:
            raise _damaged(path, "it is no tile of a field")
        _, version, nothing, offset, length, of_index = _HEAD.unpack_from(head)
        (of_head,) = _SUM.unpack_from(head, _HEAD.size)
        if zlib.crc32(head[: _HEAD.size]) != of_head:
            raise _damaged(path, "its head is not what was written")
        if version != VERSION:
            raise FieldError(
                f"{path} is a tile of version {version}; this ARTO reads version {VERSION}: "
                "update ARTO, or fit again"
            )
        if nothing or length > MOST_INDEX or offset < ALIGNED or offset + length != size:
            raise _damaged(path, f"of {offset + length} bytes it has {size}")
        file.seek(offset)
        text = file.read(length)
        if zlib.crc32(text) != of_index:
            raise _damaged(path, "its index is not what was written")
        entries = json.loads(text)
        if not isinstance(entries, list) or len(entries) > MOST_ARRAYS:
            raise _damaged(path, "its index is no list of arrays")
        found = [_stored(entry, path) for entry in entries]
    except (OSError, ValueError, RecursionError) as e:
        raise _damaged(path, e) from e
    end = ALIGNED
    for stored in sorted(found, key=lambda s: s.offset):
        if stored.offset < end or stored.offset + stored.bytes > offset:
            raise _damaged(path, f"'{stored.name}' is where it cannot be")
        end = stored.offset + stored.bytes
    index = {stored.name: stored for stored in found}
    if len(index) != len(found):
        raise _damaged(path, "two of its arrays have one name")
    return index


def _stored(entry: Any, path: Path) -> Stored:
    """An entry of the index, without trusting it. Raises FieldError."""
    wrong = _damaged(path, f"its index cannot have {entry!r:.80}")
    if not isinstance(entry, dict) or entry.keys() != Stored.__dataclass_fields__.keys():
        raise wrong
    name, kind, shape = entry["name"], entry["type"], entry["shape"]
    if not isinstance(name, str) or not _NAME.fullmatch(name) or not isinstance(kind, str):
        raise wrong
    if kind not in TYPES or not isinstance(shape, list) or not 1 <= len(shape) <= MOST_AXES:
        raise wrong
    numbers = entry["offset"], entry["bytes"], entry["crc32"]
    if any(type(n) is not int or not 0 <= n < 1 << 62 for n in (*shape, *numbers)):
        raise wrong
    size = np.dtype(TYPES[kind]).itemsize
    for side in shape:
        size *= side
    offset, length, crc32 = numbers
    if length != size or offset % ALIGNED or crc32 >= 1 << 32:
        raise wrong
    return Stored(name, kind, tuple(shape), offset, length, crc32)
