"""The artist's file, whose folder is where paths that begin with `//` start.

A job works on a copy of the .blend in another folder. Its paths that begin with `//` still start at
the folder of the original .blend.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from pathlib import Path
from typing import TypeVar

import bpy

from ...core.errors import SceneError
from ...core.places import around

_Block = TypeVar("_Block", bound=bpy.types.ID)
_home: list[str] = []


def set_file(path: str) -> None:
    """Note that this process works on a copy of a .blend.

    path: the original, empty where the original was never saved.
    """
    _home[:] = [path]


def file() -> str:
    """The path of the artist's .blend; empty where the .blend was never saved."""
    return _home[0] if _home else bpy.data.filepath


def absolute(path: str, library: bpy.types.Library | None = None) -> Path:
    """Make a path from the artist's file absolute.

    library: the library that the path comes from. Raises SceneError where the path begins with `//`
    and the .blend was never saved.
    """
    if not path.startswith("//") or library:
        return Path(bpy.path.abspath(path, library=library))
    if not file():
        raise SceneError(
            "this .blend was never saved, so its files have no place to go: save it, or set "
            "ARTO's folder and output to absolute paths"
        )
    return Path(bpy.path.abspath(path, start=str(Path(file()).parent)))


def check_outside(path: Path, what: str) -> None:
    """Raise SceneError where a path lies in a folder that ARTO has made and removes as a whole.

    what: is to be written there, for the message.
    """
    if folder := around(path):
        raise SceneError(
            f"{path} lies in {folder}, a folder of ARTO's that is removed with all that is in it: "
            f"choose another place for {what}"
        )


def relative(path: Path) -> str:
    """A path as the open file has it: from its folder with `//`, where it lies on the same disk."""
    if bpy.data.filepath:
        # Windows has no way from one drive to another
        with contextlib.suppress(ValueError):
            return bpy.path.relpath(str(path))
    return str(path)


def library_of(block: bpy.types.ID) -> str:
    """The absolute path of the library that a data-block is from; empty for one of the file."""
    library = block.library
    if library is None:
        return ""
    return str(Path(bpy.path.abspath(library.filepath, library=library.parent)).resolve())


def of_library(blocks: Iterable[_Block], name: str, library: str) -> _Block | None:
    """The data-block of a name that is from a library, or from the file itself (empty), or None.

    A library may have one of the same name as the file has.
    """
    return next((b for b in blocks if b.name == name and library_of(b) == library), None)
