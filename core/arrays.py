"""Arrays in files of their own (.npy), with a digest of what was written.

The digest, a checksum, stands after the array, where other readers of .npy do not look. Nothing in
a file is trusted: the head of an array is text of Python's, and the shape in it decides how much
memory is taken.

Examples
--------
>>> import tempfile
>>> with tempfile.TemporaryDirectory() as folder:
...     path = Path(folder) / "map.npy"
...     write(path, np.array([1.0, 2.0]))
...     read(path, most=100).tolist()
[1.0, 2.0]
"""

from __future__ import annotations

import io
import math
import tokenize
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .checksum import crc32
from .files import whole
from .regular import open_regular, read_regular

_BEFORE, _AFTER = b"\nARTO digest ", b"\n"
_DIGITS = 32
_TAIL = len(_BEFORE) + _DIGITS + len(_AFTER)
# No head of an array is longer.
LONGEST_HEAD = 1 << 16


def write(path: Path, array: NDArray) -> None:
    """Write an array and its digest, whole or not at all.

    Parameters
    ----------
    path : Path
    array : array
        Of any shape and any plain type.

    Raises
    ------
    OSError
        The file cannot be written.
    """
    data = io.BytesIO()
    np.save(data, np.ascontiguousarray(array))
    with whole(path) as partial, partial.open("wb") as f:
        f.write(data.getbuffer())
        f.write(_BEFORE + _digest(path, data.getbuffer()) + _AFTER)


def read(path: Path, most: int, signed: bool = True) -> NDArray:
    """Read an array that is what was written.

    Parameters
    ----------
    path : Path
    most : int
        The largest size of the array in bytes.
    signed : bool
        Whether the file must have the digest that `write` puts after the array.

    Returns
    -------
    array
        Read only, of the shape and type that the file says.

    Raises
    ------
    OSError
        The file cannot be read, is too large, or is no regular file.
    ValueError
        The file is damaged, or it holds no plain array.
    """
    data = read_regular(path, most + LONGEST_HEAD + _TAIL)
    end = len(data)
    if signed:
        end -= _TAIL
        tail = data[max(end, 0) :]
        if tail != _BEFORE + _digest(path, memoryview(data)[: max(end, 0)]) + _AFTER:
            raise ValueError(f"{path} is not what was written: its digest differs")
    shape, dtype, first = head(data[: min(end, LONGEST_HEAD)])
    if first + math.prod(shape) * dtype.itemsize != end:
        raise ValueError(f"{path} has not the size of its shape {shape}")
    return np.frombuffer(data, dtype, math.prod(shape), first).reshape(shape)


def head(data: bytes) -> tuple[tuple[int, ...], np.dtype, int]:
    """Read the head of an array in a file.

    Parameters
    ----------
    data : bytes
        The beginning of the file.

    Returns
    -------
    shape : tuple of int
    dtype : numpy.dtype
    first : int
        The byte at which the values begin.

    Raises
    ------
    ValueError
        This is no array, or one of Python's objects, or one that is stored column by column.
    """
    file = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(file)
        read_head = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }[version]
        shape, columns, dtype = read_head(file)
    except (ValueError, KeyError, TypeError, SyntaxError, EOFError, OverflowError) as e:
        raise ValueError(f"it is no array ({e})") from e
    except (tokenize.TokenError, MemoryError, RecursionError) as e:
        raise ValueError(f"it is no array ({e!r})") from e
    if columns or dtype.hasobject or any(n < 0 for n in shape):
        raise ValueError("it is no plain array")
    return shape, dtype, file.tell()


def is_signed(path: Path) -> bool:
    """Say whether a file ends as `write` ends one, by which it is known to be ARTO's.

    Parameters
    ----------
    path : Path

    Returns
    -------
    bool
    """
    try:
        with open_regular(path) as file:
            size = file.seek(0, io.SEEK_END)
            file.seek(max(size - _TAIL, 0))
            tail = file.read(_TAIL)
    except OSError:
        return False
    return len(tail) == _TAIL and tail.startswith(_BEFORE) and tail.endswith(_AFTER)


def _digest(path: Path, data: memoryview) -> bytes:
    """The checksum of an array, and that of its file's name: an array of another name is another.

    Of a map of 4096 x 2048 texels, a cryptographic digest would take four times as long as reading.
    """
    name = zlib.crc32(path.name.encode("utf-8", "surrogatepass"))
    return f"{crc32(data):08x}{name:08x}".rjust(_DIGITS, "0").encode()
