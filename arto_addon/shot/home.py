"""The artist's file: where paths that hang on the .blend begin.

A job works on a copy of the .blend in another folder. Whatever it reads or writes by a path of the
artist's goes by the file that the copy is of.
"""

from __future__ import annotations

from pathlib import Path

import bpy

from ...core.errors import SceneError

_home: list[str] = []


def set_file(path: str) -> None:
    """This process works on a copy of that .blend (empty: of one that was never saved)."""
    _home[:] = [path]


def file() -> str:
    """The artist's .blend, empty where it was never saved."""
    return _home[0] if _home else bpy.data.filepath


def absolute(path: str, library: bpy.types.Library | None = None) -> Path:
    """A path of the artist's, made absolute. Raises SceneError where it hangs on a .blend that
    was never saved."""
    if not path.startswith("//") or library:
        return Path(bpy.path.abspath(path, library=library))
    if not file():
        raise SceneError(
            "this .blend was never saved, so its files have no place to go: save it, or set "
            "ARTO's folder and output to absolute paths"
        )
    return Path(bpy.path.abspath(path, start=str(Path(file()).parent)))
