"""A scene's lasting ID, by which what was captured of it is found when scene or file are renamed.

It is kept in the scene and saved with it. A copy of a scene carries the ID of the one it was copied
from: it is then whoever had it first in this session that keeps it.
"""

from __future__ import annotations

import uuid

import bpy
from bpy.app.handlers import persistent

# By `session_uid`, which stays with a scene over renames and undo: the ID that it was given.
_given: dict[int, str] = {}


def _owner(scene_id: str) -> bpy.types.Scene | None:
    """The scene that has this ID by right."""
    scenes = [s for s in bpy.data.scenes if s.arto.scene_id == scene_id]
    for scene in scenes:
        if _given.get(scene.session_uid) == scene_id:
            return scene
    # a copy's name is longer, or comes later
    return min(scenes, key=lambda s: (len(s.name), s.name), default=None)


def of(scene: bpy.types.Scene) -> str | None:
    """The scene's ID; None for one that has none yet, or only a copy of another's."""
    found = scene.arto.scene_id
    return found if found and _owner(found) == scene else None


def copied_from(scene: bpy.types.Scene) -> bpy.types.Scene | None:
    """The scene that this one is a copy of, as far as its ID tells."""
    found = scene.arto.scene_id
    owner = _owner(found) if found else None
    return owner if owner != scene else None


def give(scene: bpy.types.Scene, scene_id: str | None = None) -> bool:
    """Give the scene an ID of its own (or that one), unless it has one; whether it was given."""
    if scene_id is None and of(scene):
        _given[scene.session_uid] = scene.arto.scene_id
        return False
    scene.arto.scene_id = scene_id or uuid.uuid4().hex
    _given[scene.session_uid] = scene.arto.scene_id
    return True


@persistent
def _after_undo(*_: object) -> None:
    """An undo step from before the ID was given takes it away: the scene gets it back."""
    for scene in bpy.data.scenes:
        given = _given.get(scene.session_uid)
        if given and scene.arto.scene_id != given:
            scene.arto.scene_id = given


@persistent
def _after_load(*_: object) -> None:
    _given.clear()
    for scene in bpy.data.scenes:
        if found := of(scene):
            _given[scene.session_uid] = found


_HANDLERS = {"undo_post": _after_undo, "redo_post": _after_undo, "load_post": _after_load}


def register() -> None:
    for name, handler in _HANDLERS.items():
        getattr(bpy.app.handlers, name).append(handler)


def unregister() -> None:
    for name, handler in _HANDLERS.items():
        getattr(bpy.app.handlers, name).remove(handler)
