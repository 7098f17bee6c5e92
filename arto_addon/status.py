"""What is there of a shot, in a line, for the panel: its capture set, its reflectance field."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy

from ..core import capture_set, field
from ..core.errors import ArtoError
from . import paths
from .capture import check_same_shot

# A panel is drawn with every move of the mouse; a description is read when it has changed.
_read: dict[Path, tuple[int, dict[str, Any]]] = {}


def _description(path: Path) -> dict[str, Any]:
    """A description on disk, empty where there is none that can be read."""
    try:
        changed = path.stat().st_mtime_ns
        if path not in _read or _read[path][0] != changed:
            found = json.loads(path.read_text())
            _read[path] = (changed, found if isinstance(found, dict) else {})
        return _read[path][1]
    except (OSError, ValueError):
        return {}


def capture_line(scene: bpy.types.Scene) -> tuple[str, bool] | None:
    """What there is of a capture, and whether it serves the shot as it is; None for nothing."""
    try:
        there = _description(paths.capture_folder(scene) / capture_set.HEADER)
        begun = _description(paths.unfinished_capture_folder(scene) / capture_set.HEADER)
    except ArtoError:
        return None
    if begun and not there:
        tiles = begun.get("tiles") or []
        done = sum(bool(t.get("done")) for t in tiles)
        # whether Capture goes on with it hangs on every setting
        return f"unfinished, {done} of {len(tiles)} tiles", False
    if not there:
        return None
    if there.get("version") != capture_set.VERSION:
        return "of another version: capture again", False
    text = f"{there.get('patches')} patches, {there.get('samples')} samples"
    return _of_this_shot(scene, there, text)


def field_line(scene: bpy.types.Scene) -> tuple[str, bool] | None:
    """What there is of a field, and whether it serves the shot as it is; None for nothing."""
    try:
        path = paths.field_folder(scene) / field.HEADER
        there = _description(path)
        captured = paths.capture_folder(scene) / capture_set.HEADER
    except ArtoError:
        return None
    if not there:
        return None
    try:
        older = path.stat().st_mtime_ns < captured.stat().st_mtime_ns
    except OSError:
        older = False  # a field needs no capture set any more
    if older:
        return "of an earlier capture: fit again", False
    if there.get("version") != field.VERSION:
        return "of another version: fit again", False
    about = there.get("about") or {}
    text = f"{there.get('patches')} patches, {about.get('choice')}"
    return _of_this_shot(scene, about, text)


def _of_this_shot(scene: bpy.types.Scene, head: dict[str, Any], text: str) -> tuple[str, bool]:
    try:
        check_same_shot(scene, head, "it")
    except ArtoError as e:
        return str(e).removeprefix("it ").split(":")[0] + ": capture again", False
    return text, True
