"""What is there of a shot, in a line, for the panel: its capture set, its reflectance field."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy

from ...core import capture_set, field
from ...core.capture_set import CaptureSet
from ...core.errors import ArtoError
from ...core.field import Field
from . import paths
from .shot import check_same_shot

# A panel is drawn with every move of the mouse; a description is read when it has changed.
_read: dict[Path, tuple[int, CaptureSet | Field | None]] = {}


def _opened(kind: type, path: Path, **options: Any) -> Any:
    """What a description describes, None where it is damaged or of another version.

    Raises OSError where it is not there.
    """
    changed = path.stat().st_mtime_ns
    if path not in _read or _read[path][0] != changed:
        try:
            found = kind(path.parent, **options)
        except ArtoError:
            found = None
        _read[path] = (changed, found)
    return _read[path][1]


def capture_line(scene: bpy.types.Scene) -> tuple[str, bool] | None:
    """What there is of a capture, and whether it serves the shot as it is; None for nothing."""
    try:
        path = paths.capture_folder(scene) / capture_set.HEADER
        if not path.is_file():
            path = paths.unfinished_capture_folder(scene) / capture_set.HEADER
        there: CaptureSet | None = _opened(CaptureSet, path, unfinished=True)
    except (ArtoError, OSError):
        return None
    if there is None:
        return "damaged, or of another version: capture again", False
    tiles = there.head["tiles"]
    done = sum(t["done"] for t in tiles)
    if done < len(tiles):
        # whether Capture goes on with it hangs on every setting
        return f"unfinished, {done} of {len(tiles)} tiles", False
    text = f"{len(there.hemicube)} patches, {there.head.get('samples')} samples"
    return _of_this_shot(scene, there.head, text)


def field_line(scene: bpy.types.Scene) -> tuple[str, bool] | None:
    """What there is of a field, and whether it serves the shot as it is; None for nothing."""
    try:
        path = paths.field_folder(scene) / field.HEADER
        there: Field | None = _opened(Field, path)
        captured = paths.capture_folder(scene) / capture_set.HEADER
        # a field needs no capture set any more
        older = captured.is_file() and path.stat().st_mtime_ns < captured.stat().st_mtime_ns
    except (ArtoError, OSError):
        return None
    if there is None:
        return "damaged, or of another version: fit again", False
    if older:
        return "of an earlier capture: fit again", False
    text = f"{len(there.hemicube)} patches, {there.about.get('choice')}"
    return _of_this_shot(scene, there.about, text)


def _of_this_shot(scene: bpy.types.Scene, head: dict[str, Any], text: str) -> tuple[str, bool]:
    try:
        check_same_shot(scene, head, "it")
    except ArtoError as e:
        return str(e).removeprefix("it ").split(":")[0] + ": capture again", False
    return text, True
