"""The state of a shot's capture set and of its reflectance field, each in a line for the panel."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Generic, TypeVar

import bpy

from ...core.capture.capture_set import CaptureSet
from ...core.capture.head import HEADER, CaptureHead
from ...core.errors import ArtoError, ShotError
from ...core.field.field import Field
from ...core.field.head import HEADER as FIELD_HEADER
from ...core.shot import Shot
from . import paths, watch
from .fingerprint import changes
from .paths import Place
from .shot import check_same_shot, layer_of

Line = tuple[str, bool]  # What to say, and whether the files can be used for the shot as it is now.


_Opened = TypeVar("_Opened", CaptureSet, Field)


class _Kept(Generic[_Opened]):
    """What was opened, by the path of its description.

    A panel is drawn with every move of the mouse, so a description is read only when its file has
    changed.
    """

    def __init__(self, opened: Callable[[Path], _Opened]) -> None:
        self._opened = opened
        # With the time of the file.
        self._read: dict[Path, tuple[int, _Opened | None]] = {}

    def get(self, path: Path) -> _Opened | None:
        """None where the description is damaged or of another version. Raises OSError where it is
        not there."""
        changed = path.stat().st_mtime_ns
        if path not in self._read or self._read[path][0] != changed:
            try:
                found = self._opened(path.parent)
            except ArtoError:
                found = None
            self._read[path] = (changed, found)
        return self._read[path][1]


_captures = _Kept(lambda folder: CaptureSet(folder, unfinished=True))
_fields = _Kept(Field)


def _place(scene: bpy.types.Scene, view_layer: str | None) -> Place | None:
    try:
        return paths.place(scene, view_layer, fresh=bpy.app.background)
    except (ArtoError, OSError):
        return None


def unfinished(folder: Path) -> list[str]:
    """Say how far each stopped capture in a shot's folder is, as `2 of 7 tiles`, newest first."""
    return [done(head) for head in stopped(folder)]


def stopped(folder: Path) -> list[CaptureHead]:
    """The heads of the stopped captures in a shot's folder, newest first."""
    found = []
    for path in folder.glob("unfinished-*/" + HEADER):
        there = capture_at(path)
        if there:
            found.append((path.stat().st_mtime_ns, there.head))
    return [head for _, head in sorted(found, key=lambda f: -f[0])]


def done(head: CaptureHead) -> str:
    """How far a capture is, in words."""
    return f"{head.done} of {len(head.tiles)} tiles"


def capture_line(scene: bpy.types.Scene, view_layer: str | None = None) -> Line | None:
    """Say what capture a shot has, and whether the shot as it is now can use it; None without."""
    try:
        place = paths.place(scene, view_layer, fresh=bpy.app.background)
    except ShotError as e:
        return str(e), False
    except (ArtoError, OSError):
        return None
    if place.owner:
        return f"captured for {place.owner}", False
    there = _capture_set(place)
    if isinstance(there, tuple):
        return there
    left = unfinished(place.source)
    if there is None and left:
        # Whether Capture would go on with it depends on all settings, so the line does not say.
        return f"unfinished, {left[0]}", False
    if there is None:
        other = _nearest(scene, view_layer, place)
        return _of_this_shot(scene, view_layer, other, None, "") if other else None
    text = f"{len(there.hemicube)} patches, {there.head.samples} samples"
    return _of_this_shot(scene, view_layer, there.head.shot, there.head.fingerprint, text)


# By the shot's own folder: when another shot was looked for, and the shot that was found. A panel
# is drawn often, so the search is not repeated each time.
_others: dict[Path, tuple[float, Shot | None]] = {}


def _nearest(scene: bpy.types.Scene, view_layer: str | None, place: Place) -> Shot | None:
    """Find another captured shot of the scene, for a shot of which nothing was captured."""
    at, found = _others.get(place.folder, (-2.0, None))
    if bpy.app.background or time.monotonic() - at > 1:
        found = paths.nearest(scene, view_layer)
        _others[place.folder] = time.monotonic(), found
    return found


_alike: dict[Path, tuple[float, Path | None]] = {}


def alike(scene: bpy.types.Scene, view_layer: str) -> Path | None:
    """Captures of a scene of this name in another file, see `paths.alike`; asked now and then."""
    place = _place(scene, view_layer)
    if place is None:
        return None
    at, found = _alike.get(place.folder, (-10.0, None))
    if bpy.app.background or time.monotonic() - at > 3:
        found = paths.alike(scene, view_layer)
        _alike[place.folder] = time.monotonic(), found
    return found


def caution_line(scene: bpy.types.Scene, view_layer: str | None = None) -> Line | None:
    """Say what the check of the light found before the capture; None where it found nothing."""
    place = _place(scene, view_layer)
    there = _capture_set(place) if place and not place.owner else None
    caution = there.head.caution if isinstance(there, CaptureSet) else None
    return (caution.text, False) if caution else None


def _capture_set(place: Place) -> CaptureSet | Line | None:
    try:
        there = _captures.get(place.source / "capture" / HEADER)
    except OSError:
        return None
    return there or ("damaged, or of another version: capture again", False)


def capture_at(header: Path) -> CaptureSet | None:
    """Open the capture set with this description; None where it is missing or damaged."""
    try:
        return _captures.get(header)
    except OSError:
        return None


def field_of(source: Path) -> Field | None:
    """Open the field in a shot's folder; None where it is missing or damaged."""
    try:
        return _fields.get(source / "field" / FIELD_HEADER)
    except OSError:
        return None


def draft_of(source: Path, key: str | None = None) -> Field | None:
    """Open the draft in a shot's folder; None where there is none, or its capture is complete.

    key: of the capture; any by default.
    """
    try:
        there = _fields.get(paths.draft_folder(source) / FIELD_HEADER)
    except OSError:
        return None
    if there is None or not there.about.draft or key not in (None, there.about.key):
        return None
    whole = field_of(source)
    return None if whole and whole.about.key == there.about.key else there


def has_draft(scene: bpy.types.Scene) -> bool:
    """Whether the scene's shot can be looked at in a draft, see `draft_of`."""
    place = _place(scene, None)
    return place is not None and not place.owner and draft_of(place.source) is not None


_sizes: dict[Path, tuple[float, int]] = {}


def disk(folder: Path) -> int:
    """Count the bytes in a folder, anew every three seconds; 0 where there is no such folder."""
    at, found = _sizes.get(folder, (-10.0, 0))
    if bpy.app.background or time.monotonic() - at > 3:
        found = sum(f.stat().st_size for f in folder.rglob("*") if f.is_file())
        _sizes[folder] = time.monotonic(), found
    return found


def field_line(scene: bpy.types.Scene, view_layer: str | None = None) -> Line | None:
    """Say what field a shot has, and whether the shot as it is now can use it; None without."""
    place = _place(scene, view_layer)
    if place is None or place.owner:
        return None
    try:
        path = place.source / "field" / FIELD_HEADER
        there = _fields.get(path)
    except OSError:
        return None
    if there is None:
        return "damaged, or of another version: fit again", False
    captured = _capture_set(place)  # A field works without its capture set, which may be gone.
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
    """Compare a capture with the scene as it is now, and say what differs, or `text`.

    shot, then: the capture's shot and fingerprint.
    """
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
    """List in words what has changed in the scene since a capture, the most telling first.

    then: the capture's fingerprint; now: compare with the scene as it is now. Otherwise the window
    answers with its last look, and the list is empty before the first look.
    """
    if then is None:
        return []
    found = watch.latest(scene, view_layer, dict(then), now or bpy.app.background)
    return changes(dict(then), found) if found is not None else []
