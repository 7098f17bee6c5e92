"""The libraries that pack and unpack the pixels of EXR files, behind one interface.

There are two: `open_exr` is the package OpenEXR, for Python without Blender. `open_image_io` is
Blender's own OpenImageIO, for Python inside Blender. The package brings a library OpenEXR of its
own, whose symbols have the names of those in Blender's. In a Blender the two would work on each
other's data. Blender's OpenImageIO uses Blender's OpenEXR, so there is only one.

A library is told of pixels alone. What a header says is read and written by this room itself
(`head`, `attributes`), so it is the same with both.

The package is used unless another library is chosen (`choose`), as the add-on does when Blender
registers it. No library stands in for another that is missing: that would be an error of imports
in one place and another's pixels in the next.

Examples
--------
>>> chosen().name in ("OpenEXR", "OpenImageIO")
True
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from numpy.typing import NDArray

from .head import PartLayout
from .open_exr import OpenExr
from .window import Box

# The planes of each part of a file, by the names of their channels.
Planes = Sequence[dict[str, NDArray]]


class Library(Protocol):
    """What packs and unpacks pixels.

    Parameters
    ----------
    name : str
        What it is called, for messages.
    """

    name: str

    def decode(self, path: Path, parts: Sequence[PartLayout]) -> list[dict[str, NDArray]]:
        """Read all pixels of a file.

        Parameters
        ----------
        path : Path
        parts : sequence of PartLayout
            What its headers say. None of its channels is subsampled.

        Returns
        -------
        list of dict of str to (H, W) array
            For each part its planes by their channels, of its data window: uint32, float16 or
            float32, as they are stored.

        Raises
        ------
        ExrError
            Pixels cannot be decoded.
        """
        ...

    def encode(self, path: Path, parts: Planes, box: Box, compression: str) -> None:
        """Write a file that has the pixels, and any header that fits them.

        Parameters
        ----------
        path : Path
        parts : sequence of dict of str to (H, W) array
            float16 or float32, all of one size.
        box : Box
            The data window of all parts.
        compression : str
            One of `head.COMPRESSIONS`.

        Raises
        ------
        OSError, RuntimeError
            The file cannot be written.
        """
        ...


class _Choice:
    library: Library = OpenExr()


def choose(library: Library) -> None:
    """Use a library from now on, in all of this process.

    Parameters
    ----------
    library : Library
    """
    _Choice.library = library


def chosen() -> Library:
    """Give the library that is in use.

    Returns
    -------
    Library
        The package OpenEXR until another is chosen.
    """
    return _Choice.library
