"""Opening EXR files, once all of a file is known to be there.

Examples
--------
>>> headers(Path("none.exr"))
Traceback (most recent call last):
...
arto.core.errors.ExrError: there is no file none.exr: it was moved or deleted; make it again
"""

from __future__ import annotations

import mmap
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from ..errors import ExrError
from ..regular import check_files_left
from .attributes import decoded as value_of
from .head import LayoutError, PartLayout
from .layout import PlainPart
from .layout import check as check_layout
from .layout import plain as plain_parts
from .library import chosen
from .window import place


def headers(path: Path) -> tuple[list[PartLayout], list[dict[str, Any]]]:
    """Read the headers of a file, without its pixels.

    Parameters
    ----------
    path : Path

    Returns
    -------
    parts : list of PartLayout
    heads : list of dict
        The attributes of each part by their names, see `attributes`.

    Raises
    ------
    ExrError
        The file is missing, truncated or damaged.
    """
    with _opened(path) as data, _telling(path):
        parts = check_layout(data)
        return parts, [
            {
                name.decode(): value_of(kind, value)
                for name, (kind, value) in part.attributes.items()
            }
            for part in parts
        ]


def decoded(path: Path) -> tuple[list[dict[str, Any]], list[dict[str, NDArray]]]:
    """Read all of a file.

    Parameters
    ----------
    path : Path

    Returns
    -------
    heads : list of dict
        The header of each part.
    channels : list of dict of str to (H, W) array
        The channels of each part, of the whole picture.

    Raises
    ------
    ExrError
        The file cannot be read.
    """
    parts, heads = headers(path)
    if any(part.sampled for part in parts):
        raise ExrError(f"{path} has channels of different sizes: save it without subsampling")
    check_name(path)
    channels = chosen().decode(path, parts)
    for part, found in zip(parts, channels, strict=True):
        shape = part.height, part.width
        if any(n not in found or found[n].shape != shape for n, _ in part.channels):
            raise ExrError(f"{path} has a damaged part: make it again")
    try:
        place(heads, channels)
    except ExrError as e:
        raise ExrError(f"{path} is damaged, {e}: make it again") from None
    return heads, channels


def check_name(path: Path) -> None:
    """Check that a library can be told the name of a file.

    Parameters
    ----------
    path : Path

    Raises
    ------
    ExrError
        The name is not UTF-8, as old archives leave them on Linux.
    """
    try:
        str(path).encode()
    except UnicodeEncodeError:
        raise ExrError(
            f"the name of {str(path)!a} is no UTF-8, so no library of EXR files can be given it: "
            "rename the file or its folder"
        ) from None


def mapped(path: Path) -> tuple[mmap.mmap, list[PlainPart] | None]:
    """Map a file's bytes into memory.

    Parameters
    ----------
    path : Path

    Returns
    -------
    data : mmap
        To be closed.
    parts : list of PlainPart or None
        The parts of the file where they can be read in place.

    Raises
    ------
    ExrError
        The file is missing, truncated or damaged.
    """
    data = _opened(path)
    try:
        with _telling(path):
            return data, plain_parts(data)
    except ExrError:
        data.close()
        raise


def _opened(path: Path) -> mmap.mmap:
    """The bytes of a file. Raises ExrError."""
    if not path.is_file():
        raise ExrError(f"there is no file {path}: it was moved or deleted; make it again")
    try:
        if path.stat().st_size < 8:
            raise ExrError(f"{path} is no EXR file (or an empty one): make it again")
        with path.open("rb") as f:
            return mmap.mmap(f.fileno(), 0, access=mmap.ACCESS_READ)
    except OSError as e:
        check_files_left(e)
        raise ExrError(f"{path} cannot be read ({e}): look at its permissions and disk") from e


@contextmanager
def _telling(path: Path) -> Iterator[None]:
    """Turn a LayoutError into an ExrError that names the file."""
    try:
        yield
    except LayoutError as e:
        raise ExrError(f"{path} is truncated or damaged, {e}: make it again") from None
