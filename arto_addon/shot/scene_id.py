"""A scene's lasting ID, by which its captures are found when the scene or the file is renamed.

The ID is a property of the scene and saved with the scene. A copy of a scene carries the ID of its
original. The scene that had the ID first in this session then keeps it by right.
"""

from __future__ import annotations

import uuid

import bpy
from bpy.app.handlers import persistent

from ..blender import handlers

# The ID that each scene was given, by `session_uid`, which survives renames and undo.
_given: dict[int, str] = {}


def _owner(scene_id: str) -> bpy.types.Scene | None:
    """The scene that has this ID by right."""
    scenes = [s for s in bpy.data.scenes if s.arto.scene_id == scene_id]
    for scene in scenes:
        if _given.get(scene.session_uid) == scene_id:
            return scene
    # No scene is known to have had the ID first. A copy's name is longer or comes later.
    return min(scenes, key=lambda s: (len(s.name), s.name), default=None)


def of(scene: bpy.types.Scene) -> str | None:
    """The scene's ID; None where the scene has no ID yet, or only its original's."""
    found = scene.arto.scene_id
    return found if found and _owner(found) == scene else None


def copied_from(scene: bpy.types.Scene) -> bpy.types.Scene | None:
    """The scene that a scene was copied from, as far as the IDs tell; else None."""
    found = scene.arto.scene_id
    owner = _owner(found) if found else None
    return owner if owner != scene else None


def give(scene: bpy.types.Scene, scene_id: str | None = None) -> bool:
    """Give the scene an ID, and return whether an ID was given.

    scene_id: the ID to give; None for a new ID, unless the scene has one of its own already.
    """
    if scene_id is None and of(scene):
        _given[scene.session_uid] = scene.arto.scene_id
        return False
    scene.arto.scene_id = scene_id or uuid.uuid4().hex
    _given[scene.session_uid] = scene.arto.scene_id
    _note_alone(scene)
    return True


def _note_alone(scene: bpy.types.Scene) -> None:
    if len(bpy.data.scenes) == 1:
        scene.arto.alone = scene.arto.scene_id


def is_alone(scene: bpy.types.Scene) -> bool:
    """Whether the names of the scene's plates need not tell the scene.

    So it is for a file's only scene, and stays so when other scenes come to the file: a plate keeps
    its name. At most one scene of a file is alone.
    """
    marked = [s for s in bpy.data.scenes if s.arto.alone and s.arto.alone == of(s)]
    # a scene that was appended brings its mark along: the one that was here first has it by right
    uids = list(_given)
    order = [s.session_uid for s in marked if s.session_uid in uids]
    first = min(order, key=uids.index, default=None)
    if marked:
        return scene == next((s for s in marked if s.session_uid == first), marked[0])
    return len(bpy.data.scenes) == 1 and not of(scene)


@persistent
def _after_undo(*_: object) -> None:
    """Give scenes their IDs back: undo takes an ID away where its step is older than the ID."""
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
            _note_alone(scene)  # a file of an earlier version says nothing of it


_HANDLERS = {"undo_post": _after_undo, "redo_post": _after_undo, "load_post": _after_load}


def register() -> None:
    handlers.add(_HANDLERS)


def unregister() -> None:
    handlers.remove(_HANDLERS)
