"""Markers of the timeline that are bound to cameras: a render takes its camera from them."""

from __future__ import annotations

import bpy


def camera_of(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """The camera that Blender renders a scene's frame with.

    It is the camera of the last marker before the frame, or of the first marker where the frame is
    before them all. Without such a marker it is the scene's own.
    """
    bound = [m for m in scene.timeline_markers if m.camera and not m.camera.hide_render]
    if not bound:
        return scene.camera
    before = [m for m in bound if m.frame <= scene.frame_current]
    marker = max(before, key=_frame) if before else min(bound, key=_frame)
    return marker.camera


def _frame(marker: bpy.types.TimelineMarker) -> int:
    return marker.frame
