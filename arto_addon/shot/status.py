"""What there is of a shot, in a line, for the panel: its capture set, its reflectance field."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import bpy

from ...core.capture.capture_set import CaptureSet
from ...core.capture.head import HEADER
from ...core.errors import ArtoError
from ...core.field.field import Field
from ...core.field.head import HEADER as FIELD_HEADER
from ...core.shot import Shot
from . import paths, watch
from .fingerprint import changes
from .paths import Place
from .shot import check_same_shot, layer_of

# A panel is drawn with every move of the mouse; a description is read when it has changed.
_read: dict[Path, tuple[int, CaptureSet | Field | None]] = {}

Line = tuple[str, bool]  # what to say, and whether it serves the shot as it is


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


def _place(scene: bpy.types.Scene, view_layer: str | None) -> Place | None:
    try:
        return paths.place(scene, view_layer, fresh=bpy.app.background)
    except (ArtoError, OSError):
        return None


def unfinished(folder: Path) -> list[str]:
    """The captures in a shot's folder that were stopped, the newest first: `2 of 7 tiles`."""
    found = []
    for path in folder.glob("unfinished-*/" + HEADER):
        try:
            there = _opened(CaptureSet, path, unfinished=True)
        except OSError:
            continue
        if there:
            head = there.head
            found.append((path.stat().st_mtime_ns, f"{head.done} of {len(head.tiles)} tiles"))
    return [text for _, text in sorted(found, reverse=True)]


def capture_line(scene: bpy.types.Scene, view_layer: str | None = None) -> Line | None:
    """What there is of a capture, and whether it serves the shot as it is; None for nothing."""
    place = _place(scene, view_layer)
    if place is None:
        return None
    if place.owner:
        return f"captured for {place.owner}", False
    there = _capture_set(place)
    if isinstance(there, tuple):
        return there
    stopped = unfinished(place.source)
    if there is None and stopped:
        # whether Capture goes on with it hangs on every setting
        return f"unfinished, {stopped[0]}", False
    if there is None:
        other = _nearest(scene, view_layer, place)
        return _of_this_shot(scene, view_layer, other, None, "") if other else None
    text = f"{len(there.hemicube)} patches, {there.head.samples} samples"
    return _of_this_shot(scene, view_layer, there.head.shot, there.head.fingerprint, text)


# By the shot's own folder, for a panel that is drawn often: when it was looked for, and found.
_others: dict[Path, tuple[float, Shot | None]] = {}


def _nearest(scene: bpy.types.Scene, view_layer: str | None, place: Place) -> Shot | None:
    """Another shot of the scene, where nothing was captured of this one."""
    at, found = _others.get(place.folder, (-2.0, None))
    if bpy.app.background or time.monotonic() - at > 1:
        found = paths.nearest(scene, view_layer)
        _others[place.folder] = time.monotonic(), found
    return found


def caution_line(scene: bpy.types.Scene, view_layer: str | None = None) -> Line | None:
    """What the check of the light found before the capture; None for nothing."""
    place = _place(scene, view_layer)
    there = _capture_set(place) if place and not place.owner else None
    caution = there.head.caution if isinstance(there, CaptureSet) else None
    return (caution.text, False) if caution else None


def _capture_set(place: Place) -> CaptureSet | Line | None:
    try:
        there = _opened(CaptureSet, place.source / "capture" / HEADER, unfinished=True)
    except OSError:
        return None
    return there or ("damaged, or of another version: capture again", False)


def capture_at(header: Path) -> CaptureSet | None:
    """The capture set whose description that is; None where it is not there, or damaged."""
    try:
        return _opened(CaptureSet, header, unfinished=True)
    except OSError:
        return None


def field_of(source: Path) -> Field | None:
    """The field in a shot's folder; None where it is not there, or damaged."""
    try:
        return _opened(Field, source / "field" / FIELD_HEADER)
    except OSError:
        return None


_sizes: dict[Path, tuple[float, int]] = {}


def disk(folder: Path) -> int:
    """Bytes in a folder, looked at once every few seconds; 0 where it is not there."""
    at, found = _sizes.get(folder, (-10.0, 0))
    if bpy.app.background or time.monotonic() - at > 3:
        found = sum(f.stat().st_size for f in folder.rglob("*") if f.is_file())
        _sizes[folder] = time.monotonic(), found
    return found


def field_line(scene: bpy.types.Scene, view_layer: str | None = None) -> Line | None:
    """What there is of a field, and whether it serves the shot as it is; None for nothing."""
    place = _place(scene, view_layer)
    if place is None or place.owner:
        return None
    try:
        path = place.source / "field" / FIELD_HEADER
        there: Field | None = _opened(Field, path)
    except OSError:
        return None
    if there is None:
        return "damaged, or of another version: fit again", False
    captured = _capture_set(place)  # which a field does not need any more
    if isinstance(captured, CaptureSet):
        keys = there.about.key, captured.head.key
        if keys[0] != keys[1]:
            return "of an earlier capture: fit again", False
    text = f"{len(there.hemicube)} patches, {there.about.choice}"
    return _of_this_shot(scene, view_layer, there.about.shot, there.about.fingerprint, text)


def _of_this_shot(
    scene: bpy.types.Scene,
    view_layer: str | None,
    shot: Shot | None,
    then: Mapping[str, str] | None,
    text: str,
) -> Line:
    """What to say of what a shot and a fingerprint are of: `text`, where they are the scene's."""
    layer = view_layer or layer_of(scene)
    try:
        check_same_shot(scene, shot, "it", layer)
    except ArtoError as e:
        return str(e).removeprefix("it ").split(":")[0] + ": capture again", False
    changed = changed_since(scene, layer, then)
    if changed:
        more = f" (and {len(changed) - 1} more)" if len(changed) > 1 else ""
        return f"{changed[0]}{more}", False
    return text, True


def changed_since(
    scene: bpy.types.Scene,
    view_layer: str,
    then: Mapping[str, str] | None,
    now: bool = False,
) -> list[str]:
    """What of the scene has changed since a capture, in words, the most telling first.

    then: the capture's fingerprint; now: look now; else, in the window, the answer is that of the
    last look after a change.
    """
    if then is None:
        return []
    found = watch.latest(scene, view_layer, dict(then), now or bpy.app.background)
    return changes(dict(then), found) if found is not None else []
