"""The header of a plate's EXR: the attributes that Blender would write."""

from __future__ import annotations

import platform
import re
import time
from fractions import Fraction

import bpy

from ...core.exr import TimeCode
from ..blender.markers import camera_of
from ..shot import home


def header(scene: bpy.types.Scene) -> dict[str, object]:
    """The attributes that Blender's own render of the scene would have in its header.

    The artist chooses them in Output properties, Metadata. Render time and memory are left out, as
    a plate is not rendered.
    """
    render = scene.render
    camera, digits = camera_of(scene), len(str(max(scene.frame_end, 1)))
    markers = [m for m in scene.timeline_markers if m.frame <= scene.frame_current]
    marker = max(markers, key=lambda m: m.frame, default=None)
    data = camera.data if camera and camera.type == "CAMERA" else None
    lens = f"{data.lens:.2f}" if data and data.type == "PERSP" else ""
    fields = {
        "filename": ("File", home.file() or "<untitled>"),
        "date": ("Date", time.strftime("%Y/%m/%d %H:%M:%S")),
        "time": ("Time", bpy.utils.smpte_from_frame(scene.frame_current)),
        "frame": ("Frame", f"{scene.frame_current:0{digits}d}"),
        "frame_range": ("FrameRange", f"{scene.frame_start}:{scene.frame_end}"),
        "camera": ("Camera", camera.name if camera else ""),
        "lens": ("Lens", lens),
        "scene": ("Scene", scene.name),
        "note": ("Note", render.stamp_note_text),
        "marker": ("Marker", marker.name if marker else ""),
        "hostname": ("Hostname", platform.node()),
    }
    found: dict[str, object] = {
        name: value
        for flag, (name, value) in fields.items()
        if value and getattr(render, f"use_stamp_{flag}")
    }
    found["Software"] = f"Blender {bpy.app.version_string}"
    found["pixelAspectRatio"] = float(render.pixel_aspect_x / render.pixel_aspect_y)
    # 24 over 1.001: the base is a float of 32 bits
    found["framesPerSecond"] = render.fps / Fraction(render.fps_base).limit_denominator(1000)
    if render.use_stamp_time and (moment := time_code(fields["time"][1])):
        found["timeCode"] = moment
    return found


def time_code(text: str) -> TimeCode | None:
    """The moment that Blender writes as `01:02:03:04`; None where an EXR has no such moment.

    An EXR counts 30 frames to a second.
    """
    found = re.fullmatch(r"(\d\d):(\d\d):(\d\d):(\d\d)", text)
    moment = [int(part) for part in found.groups()] if found else [99]
    if moment[0] > 23 or max(moment[1:]) > 59 or moment[-1] > 29:
        return None
    return TimeCode(*moment)
