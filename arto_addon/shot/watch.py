"""Keep the scene's fingerprint up to date: it is made after a change, never while drawing.

It is made in pieces, between which the window goes on. A change begins it anew.
"""

from __future__ import annotations

import time

import bpy
from bpy.app.handlers import persistent

from ..blender import handlers
from . import fingerprint as prints
from . import pixels
from .fingerprint import Fingerprint

# Seconds without a change before the scene is looked at.
REST = 0.3
# By the type of an area, the region that panels are in.
_PANELS = {"PROPERTIES": "WINDOW", "VIEW_3D": "UI", "IMAGE_EDITOR": "UI", "NODE_EDITOR": "UI"}
# Of which scene, which view layer, and with what it will be compared: a shot's field and a capture
# that was stopped may be of two states of a scene, and the panels ask for both.
_Key = tuple[int, str, int]
_latest: dict[_Key, Fingerprint] = {}
_asked: dict[_Key, Fingerprint] = {}
_stale: set[_Key] = set()
# What was asked for since it was made last. What nobody asks for any more is not made anew.
_wanted: set[_Key] = set()
# The fingerprint that is being made, in pieces.
_making: list[tuple[_Key, prints.Pieces]] = []
# Seconds of the window's thread that are spent on pieces at a time, and seconds between two times.
SLICE, PAUSE = 0.015, 0.01


def latest(
    scene: bpy.types.Scene, view_layer: str, then: Fingerprint, now: bool
) -> Fingerprint | None:
    """The latest fingerprint of a view layer; None where it is still being made.

    then: the fingerprint that the latest will be compared with; now: make the fingerprint before
    returning, which takes a while.
    """
    if now:
        prints.forget()  # Without a window, no handler has noted what changed.
        return prints.fingerprint(scene, view_layer, then)
    # By value: an equal fingerprint that was read anew is no reason to look again. Each look
    # redraws the panels, and the panels ask here.
    key = scene.session_uid, view_layer, hash(frozenset(then.items()))
    _wanted.add(key)
    if key not in _asked:
        _asked[key] = then
        _stale.add(key)
        _look_soon()
    return _latest.get(key)


def _look_soon() -> None:
    # A timer that runs already starts again, so that nothing is looked at in the middle of a drag.
    if bpy.app.timers.is_registered(_look):
        bpy.app.timers.unregister(_look)
    bpy.app.timers.register(_look, first_interval=REST)


def _look() -> float | None:
    """Make stale fingerprints anew and redraw the panels, once no animation or render runs."""
    manager = bpy.context.window_manager
    if any(w.screen.is_animation_playing for w in manager.windows):
        return REST
    if bpy.app.is_job_running("RENDER"):
        return REST
    until = time.perf_counter() + SLICE
    while _making or _stale:
        if _making and _making[0][0] in _stale:
            _making.clear()  # the scene has changed meanwhile
        if not _making and not _begin(_stale.pop()):
            continue
        key, pieces = _making[0]
        try:
            while time.perf_counter() < until:
                next(pieces)
            return PAUSE
        except StopIteration as end:
            _latest[key] = end.value
            _wanted.discard(key)
        except (ReferenceError, KeyError):  # it was removed, which Blender has not reported yet
            _stale.add(key)
            _making.clear()
            return REST
        _making.clear()
    redraw()
    return None


def _begin(key: _Key) -> bool:
    """Begin a fingerprint -> whether it is wanted, and its scene and view layer are there."""
    uid, view_layer, _ = key
    scene = next((s for s in bpy.data.scenes if s.session_uid == uid), None)
    if scene is None or view_layer not in scene.view_layers or key not in _wanted:
        _latest.pop(key, None)
        _asked.pop(key, None)
        return False
    _making[:] = [(key, prints.in_pieces(scene, view_layer, _asked[key]))]
    return True


def _read_soon() -> None:
    """Look again once the digest of a large image is there, which a thread makes."""
    if not bpy.app.timers.is_registered(_await_pixels):
        bpy.app.timers.register(_await_pixels, first_interval=REST)


def _await_pixels() -> float | None:
    if pixels.reading():
        return REST
    if _asked:
        _stale.update(_asked)
        _look_soon()
    redraw()
    return None


def redraw() -> None:
    """Redraw the regions that may show ARTO's panels, and nothing beside them."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            for region in area.regions:
                if region.type == _PANELS.get(area.type) and region.width > 1:
                    region.tag_redraw()


@persistent
def _changed(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    images = [u.id.original for u in depsgraph.updates if isinstance(u.id, bpy.types.Image)]
    pixels.forget(image.session_uid for image in images)
    if not _asked:
        return
    # Digests are kept of a mesh's arrays, of its shape keys, and of its object's deformed shape. A
    # change of geometry makes all of them stale.
    geometry = set()
    for update in depsgraph.updates:
        if update.is_updated_geometry:
            block = update.id.original
            geometry.add(block.session_uid)
            data = getattr(block, "data", None)
            if data is not None and isinstance(data, bpy.types.ID):
                geometry.add(data.session_uid)
                keys = getattr(data, "shape_keys", None)
                if keys:
                    geometry.add(keys.session_uid)
    prints.forget(geometry)
    _stale.update(_asked)
    _look_soon()


@persistent
def _all_changed(*_: object) -> None:
    """Look at everything again, after undo, redo, or another file."""
    _making.clear()
    prints.forget()
    pixels.forget()
    scenes = {s.session_uid for s in bpy.data.scenes}
    for kept in (_latest, _asked):
        for key in [k for k in kept if k[0] not in scenes]:
            del kept[key]
    if _asked:
        _stale.update(_asked)
        _look_soon()


_HANDLERS = {
    "depsgraph_update_post": _changed,
    "frame_change_post": _changed,
    "undo_post": _all_changed,
    "redo_post": _all_changed,
    "load_post": _all_changed,
}


def register() -> None:
    if bpy.app.background:
        return  # Without a window nothing is drawn, and `latest` makes the fingerprint itself.
    handlers.add(_HANDLERS)
    pixels.begun = _read_soon


def unregister() -> None:
    handlers.remove(_HANDLERS)
    for timer in (_look, _await_pixels):
        if bpy.app.timers.is_registered(timer):
            bpy.app.timers.unregister(timer)
    pixels.begun = None
    for kept in (_latest, _asked, _stale, _wanted, _making):
        kept.clear()
