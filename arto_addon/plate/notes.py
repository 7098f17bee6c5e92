"""What ARTO has written in formats that have no room for its marks: a list in ARTO's folder."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from pathlib import Path

import bpy

from ...core import checksum, signed
from ...core.errors import ArtoError, SceneError
from ...core.file_names import folded
from ...core.values import Values
from ..shot import paths

# The file of the list, in ARTO's folder.
NOTES = "composites.json"


def noted(scene: bpy.types.Scene, path: Path) -> Mapping[str, object]:
    """What was noted of a file; empty where it is missing, or not as it was written."""
    said = _notes(scene).get(folded(path), {})
    with contextlib.suppress(OSError):
        if isinstance(said, dict) and said.get("sum") == checksum.of_file(path):
            return said
    return {}


def note(scene: bpy.types.Scene, path: Path, plate: str = "") -> None:
    """Note that a file was written. plate: the key of the plate it was made of. Raises OSError."""
    every = _notes(scene) | {folded(path): {"sum": checksum.of_file(path), "plate": plate}}
    signed.write(_file(scene), {"files": every})


def _notes(scene: bpy.types.Scene) -> dict[str, object]:
    path = _file(scene)
    with contextlib.suppress(ArtoError):
        if path.is_file():
            return Values(path, SceneError).kind("files", dict, {})
    return {}


def _file(scene: bpy.types.Scene) -> Path:
    return paths.worlds_folder(scene).with_name(NOTES)
