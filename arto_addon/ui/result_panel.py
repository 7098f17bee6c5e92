"""The panel *Result*: the plate, how it compares, and where it goes."""

from __future__ import annotations

import contextlib
import time
from pathlib import Path

import bpy

from ...core import exr
from ...core.errors import ArtoError
from ..blender.words import tr
from ..job import session
from ..job.verbs import Verb
from ..plate.names import relit_file
from ..relight.finished import SAID, finished_file
from ..relight.light_key import HEADER, light_key
from ..relight.verify import verify_file
from ..shot import home, paths, status
from ..shot.shot import layer_of
from ..world.check import world_of
from . import shot_panel, thumbnails
from .places import Draws, say, slot

# The jobs of which this panel says how they ended.
WORKS: tuple[Verb, ...] = (
    "relight",
    "relight_frames",
    "relight_looks",
    "sheet",
    "verify",
    "finish",
    "composite",
    "web",
)
# Seconds for which the line about the plate is kept: a panel is drawn at every mouse move.
_HOLDS = 0.4
_last: dict[str, tuple[float, tuple[str, bool]]] = {}
_headers: dict[Path, tuple[int, dict]] = {}


def header_of(path: Path) -> dict:
    """The header of a plate, read again only after the file changed. Raises OSError, ExrError."""
    changed = path.stat().st_mtime_ns
    if path not in _headers or _headers[path][0] != changed:
        if len(_headers) > 50:
            _headers.clear()
        _headers[path] = changed, exr.header(path)
    return _headers[path][1]


def plate_line(scene: bpy.types.Scene) -> tuple[str, bool]:
    """A line about the plate, and whether the plate is up to date; empty without a plate."""
    key = f"{scene.session_uid} {scene.arto.look}"
    at, found = _last.get(key, (-1.0, ("", False)))
    now = time.monotonic()
    if bpy.app.background or now - at > _HOLDS:
        found = _plate_line(scene)
        _last[key] = now, found
    return found


def _plate_line(scene: bpy.types.Scene) -> tuple[str, bool]:
    try:
        path = relit_file(scene)
        header = header_of(path)
        written = path.stat().st_mtime
        world = world_of(scene)
        layer = layer_of(scene)
        source = paths.place(scene, layer, fresh=bpy.app.background).source
    except (ArtoError, OSError):
        return "", False
    look = scene.arto.look.strip()
    text = time.strftime("%H:%M", time.localtime(written))
    if look:
        text = tr("Look '{look}', {time}", look=look, time=text)
    field = source / "field" / "field.json"
    if field.is_file() and field.stat().st_mtime > written:
        return tr("{plate}, of an earlier capture", plate=text), False
    if world is None or header.get(HEADER) != light_key(scene, world):
        return tr("{plate}, light or settings changed since", plate=text), False
    return tr("{plate}, up to date", plate=text), True


class Result(Draws):
    """The relit picture, and what is done with it"""

    label = "Result"

    @staticmethod
    def draw_column(column: bpy.types.UILayout, context: bpy.types.Context) -> None:
        scene, settings = context.scene, context.scene.arto
        text, good = plate_line(scene)
        try:
            path: Path | None = relit_file(scene)
        except ArtoError:
            path = None
        if text and path:
            row = column.row()
            row.alignment = "CENTER"
            row.template_icon(thumbnails.of_plate(path), scale=5.0)
        row = column.row(align=True)
        row.scale_y = 1.3
        # the button stands out while the plate is out of date
        row.alert = bool(text) and not good and session.asked_for() is None
        row.operator("arto.relight", icon="WORLD")
        _said(column, context, text, good)
        if not text:
            return
        row = column.row(align=True)
        row.operator("arto.show_plate", icon="IMAGE_DATA")
        row.operator("arto.compare", icon="ARROW_LEFTRIGHT")
        if settings.compare != "OFF":
            column.prop(settings, "compare", text="")
            if settings.compare == "WIPE":
                column.prop(settings, "wipe", slider=True)
        column.operator("arto.look_inside", icon="EYEDROPPER")
        column.operator("arto.light_from", icon="LIGHT")
        _seen(column, context)
        column.operator("arto.verify", icon="VIEWZOOM")
        _verified(column, context, path)
        row = column.row(align=True)
        row.operator("arto.finish", icon="SHADING_RENDERED")
        row.prop(settings, "finish_samples")
        _finished(column, context, path)
        column.separator(factor=0.5)
        column.prop(settings, "use_in_compositor", text="")
        column.operator("arto.save_composite", icon="FILE_TICK")
        row = column.row(align=True)
        row.operator("arto.web", icon="URL")
        row.operator("arto.open_page", icon="WINDOW")
        if path:
            say(column, context, home.relative(path), "FILE_IMAGE")


def _said(column: bpy.types.UILayout, context: bpy.types.Context, text: str, good: bool) -> None:
    """Draw what is to be said of the plate, in two lines: of the last job, or of the plate."""
    if shot_panel.ended(column, context, WORKS):
        return
    if text:
        slot(column, context, text, "CHECKMARK" if good else "ERROR")
    elif status.field_line(context.scene) is None:
        slot(column, context, "Capture the shot first", "INFO")
    else:
        slot(column, context, "")


def _seen(column: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw what the last look inside found, if it looked at this scene's picture."""
    if context.window_manager.arto.seen_in != context.scene.name_full:
        return
    for line in context.window_manager.arto.seen.splitlines():
        say(column, context, line)


def _finished(column: bpy.types.UILayout, context: bpy.types.Context, path: Path | None) -> None:
    """Draw in two lines of what the finished picture is, where it is of this plate."""
    text = ""
    with contextlib.suppress(OSError, ArtoError):
        if path and finished_file(path).is_file():
            header = header_of(finished_file(path))
            if header.get(HEADER) == header_of(path).get(HEADER):
                text = f"Finished: {header.get(SAID, '')}"
    slot(column, context, text or "Puts the picture and samples of a render together", "INFO")


def _verified(column: bpy.types.UILayout, context: bpy.types.Context, path: Path | None) -> None:
    """Draw in two lines what Verify found, where it verified this plate; else what it does."""
    text = ""
    with contextlib.suppress(OSError, ArtoError):
        if path and verify_file(path).stat().st_mtime >= path.stat().st_mtime:
            text = str(header_of(verify_file(path)).get("arto.verify", ""))
    text = text[:1].upper() + text[1:] or "Compares the picture with a few samples of a render"
    slot(column, context, text, "INFO")
