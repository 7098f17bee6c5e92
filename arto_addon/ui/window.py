"""What happens in the window besides the buttons: a finished plate is shown, ESC ends a job."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy

from ..job import session
from ..job.session import Job
from ..relight.many import frames_of
from ..relight.present import present, present_frames

_keys: list[tuple[Any, Any]] = []


def show_relit(job: Job) -> str:
    """A relight has ended: put the plate, or its frames, into the file, if that is still open, and
    show it."""
    path = Path(job.state.result)
    scene = next((s for s in bpy.data.scenes if s.arto.scene_id == job.scene_id), None)
    if scene is None or bpy.data.filepath != job.blend:
        return f"wrote {path} (its scene is not open any more)"
    window = bpy.context.window_manager.windows[0]
    with bpy.context.temp_override(window=window):
        if job.verb == "relight_frames":
            reveal(present_frames(scene, path, frames_of(scene), job.light))
        else:
            reveal(present(scene, path, job.light))
    return job.state.text


def reveal(image: bpy.types.Image) -> None:
    """Show an image in an image editor that is open, else where a render would be shown."""
    area = _editor()
    if area is None:
        bpy.ops.render.view_show("INVOKE_DEFAULT")
        area = _editor()
    if area is not None:
        area.spaces.active.image = image
        area.tag_redraw()


def _editor() -> bpy.types.Area | None:
    """The image editor to show a picture in: one that shows a picture already comes first."""
    found = []
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "IMAGE_EDITOR" and area.ui_type == "IMAGE_EDITOR":
                space = area.spaces.active
                shown = space.image
                ours = shown is None or shown.type == "RENDER_RESULT" or "ARTO" in shown.name
                if space.mode == "VIEW":
                    found.append((not ours, -area.width * area.height, area))
    return min(found, key=lambda f: f[:2])[2] if found else None


def register() -> None:
    session.finishers["relight"] = session.finishers["relight_frames"] = show_relit
    keys = bpy.context.window_manager.keyconfigs.addon
    if keys:  # none without a window
        # the last one to be asked: whatever else takes an ESC has it first
        keymap = keys.keymaps.new(name="Window", space_type="EMPTY")
        _keys.append((keymap, keymap.keymap_items.new("arto.cancel", "ESC", "PRESS")))


def unregister() -> None:
    session.finishers.pop("relight", None)
    session.finishers.pop("relight_frames", None)
    while _keys:
        keymap, item = _keys.pop()
        keymap.keymap_items.remove(item)
