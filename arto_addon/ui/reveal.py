"""Showing a picture in the window."""

from __future__ import annotations

import bpy


def reveal(image: bpy.types.Image) -> None:
    """Show an image in an open image editor; without one, where Blender would show a render."""
    if bpy.app.background:
        return
    area = editor()
    if area is None:
        bpy.ops.render.view_show("INVOKE_DEFAULT")
        area = editor()
    if area is not None:
        area.spaces.active.image = image
        area.tag_redraw()


def editor() -> bpy.types.Area | None:
    """The image editor to show a picture in; an editor that already shows a picture comes first."""
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
