"""What the artist is told of a shot, in two short lines, and what its one button does next."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, replace
from pathlib import Path

import bpy

from ...core.capture.head import HEADER, CaptureHead
from ...core.errors import ArtoError, ShotError
from ...core.field.head import HEADER as FIELD_HEADER
from ...core.shot import Shot
from ...core.units import clock, size
from ..blender.markers import camera_of
from ..blender.words import tr
from ..capture.asked import key_of_settings
from ..capture.planned import most
from ..shot import home, paths, status
from ..shot.shot import check_same_shot, layer_of, shot_of
from ..stage.settings import samples_of
from ..stage.stage import picture_region

# Guess of the seconds that one core needs for a path, until it was measured on this scene.
_GUESS = 5e-6
# Seconds for all other work: starting, probing, fitting the last tile.
OTHERS = 8.0
# How many times longer all takes of a shot with shadow catchers last than one take.
ALL_TAKES = 1.6


@dataclass(frozen=True)
class Told:
    """What the artist is told of a shot.

    kind: `blocked`, `none`, `unfinished`, `unfitted`, `ready`, `changed`, `elsewhere` (captured for
    another camera, frame or size) or `other` (captured for another file or scene); lines: at most
    two; button: the text of the large button; stopped: whether captures were stopped, which can be
    discarded; goes_on: the one of them that the button goes on with.
    """

    kind: str
    lines: tuple[str, ...]
    button: str
    stopped: bool = False
    goes_on: CaptureHead | None = None


def told(scene: bpy.types.Scene) -> Told:
    """Find what has been captured of the scene's shot, and what to do next."""
    if scene.render.engine != "CYCLES":
        return Told("blocked", ("ARTO captures with Cycles:", "choose it as the engine"), "Capture")
    if camera_of(scene) is None:
        return Told("blocked", ("The scene has no camera",), "Capture")
    layer = layer_of(scene)
    try:
        place = paths.place(scene, layer, fresh=bpy.app.background)
    except ShotError:
        return Told("blocked", ("A file of the shot is damaged:", paths.HEADER), "Capture")
    except ArtoError:
        return Told("blocked", ("This file was never saved:", "save it first"), "Capture")
    except OSError as e:
        return Told("blocked", ("The folder cannot be read:", str(e.strerror)), "Capture")
    if scene.arto.photographs and not (place.source / "field").exists():
        return Told("none", ("The photographs are not read yet",), "Capture")
    if place.owner:
        return Told("other", (tr("Captured for {owner}", owner=place.owner),), "Capture")
    stopped = status.stopped(place.source)
    goes_on = next((head for head in stopped if _goes_on(scene, layer, head)), None)
    found = _told(scene, layer, place, goes_on)
    button = "Continue" if goes_on else found.button
    return replace(found, button=button, stopped=bool(stopped), goes_on=goes_on)


def _told(
    scene: bpy.types.Scene, layer: str, place: paths.Place, goes_on: CaptureHead | None
) -> Told:
    """What is told of a shot whose folder can be read. goes_on: see `Told`."""
    field_line = status.field_line(scene, layer)
    capture_line = status.capture_line(scene, layer)
    if field_line is None and goes_on:
        tiles = status.done(goes_on)
        lines = tr("{tiles} done,", tiles=tiles), "continues where it stopped"
        return Told("unfinished", lines, "Continue")
    if field_line is None and capture_line is None:
        if other := status.alike(scene, layer):
            whose = tr("Of a scene of this name: {folder}", folder=home.relative(other))
            return Told("other", ("No capture yet", whose), "Capture")
        return Told("none", ("No capture yet",), "Capture")
    if field_line is None and not (place.source / "capture").exists():
        then = paths.nearest(scene, layer)
        if then is not None:
            return Told("elsewhere", (_elsewhere(then, shot_of(scene, layer)),), "Capture This Too")
        return Told("none", ("No capture yet",), "Capture")
    if field_line is None:
        return Told("unfitted", ("Captured, but not fitted yet",), "Continue")
    text, serves = field_line
    if serves and scene.arto.photographs:
        there = status.field_of(place.source)
        when = _when(place.source / "field" / FIELD_HEADER)
        patches = len(there.hemicube) if there else 0
        text = tr("Ready, read {when}, {patches} patches", when=when, patches=patches)
        return Told("ready", (text,), "Capture Again")
    more = (tr("Another capture: {tiles} done", tiles=status.done(goes_on)),) if goes_on else ()
    if not serves:
        then = _shot(place.source)
        if then is not None and then.difference(shot_of(scene, layer)):
            text = _elsewhere(then, shot_of(scene, layer))
            return Told("elsewhere", (text, *more), "Capture Again")
        text = text[0].upper() + text[1:]
        return Told("changed", (text, *more), "Capture Again")
    there = status.field_of(place.source)
    when = _when(place.source / "field" / FIELD_HEADER)
    known = there.about.samples if there else None
    samples = "?" if known is None else f"{known:g}"
    text = tr("Ready, captured {when}, {samples} samples", when=when, samples=samples)
    return Told("ready", (text, *more), "Capture Again")


def _goes_on(scene: bpy.types.Scene, layer: str, head: CaptureHead) -> bool:
    """Whether Capture would go on with a capture that was stopped: something of it is done, and
    scene and settings are as they were.
    """
    if not head.done or head.asked != key_of_settings(scene):
        return False
    try:
        check_same_shot(scene, head.shot, "it", layer)
    except ArtoError:
        return False
    return not status.changed_since(scene, layer, head.fingerprint)


def better(scene: bpy.types.Scene) -> float | None:
    """The samples of the capture that a new one would take the place of, if these are more."""
    try:
        place = paths.place(scene, layer_of(scene))
    except (ArtoError, OSError):
        return None
    there = None if place.owner else status.field_of(place.folder)
    samples = there.about.samples if there else None
    return samples if samples is not None and samples > samples_of(scene) else None


def _elsewhere(then: Shot, now: Shot) -> str:
    """How the captured shot differs from the present one, in an artist's words."""
    if then.camera != now.camera:
        text = "Captured through {then}, the camera is {now}"
        return tr(text, then=then.camera, now=now.camera)
    if then.frame != now.frame or (then.subframe or 0) != (now.subframe or 0):
        text = "Captured at frame {then}, this is frame {now}"
        return tr(text, then=then.frame, now=now.frame)
    if (then.width, then.height) != (now.width, now.height):
        sizes = f"{then.width} x {then.height}", f"{now.width} x {now.height}"
        return tr("Captured at {then}, the picture is {now}", then=sizes[0], now=sizes[1])
    if then.view_layer != now.view_layer:
        text = "Captured of the view layer {then}, this is {now}"
        return tr(text, then=then.view_layer, now=now.view_layer)
    difference = then.difference(now) or "another shot"
    return "The camera has moved since" if "camera" in difference else f"Captured of {difference}"


def _shot(source: Path) -> Shot | None:
    there = status.field_of(source)
    return there.about.shot if there else None


def captured_shot(scene: bpy.types.Scene) -> Shot | None:
    """The shot that the capture on disk is of; without one, the nearest captured shot of the scene.

    None where nothing was captured. Raises SceneError.
    """
    layer = layer_of(scene)
    place = paths.place(scene, layer)
    return _shot(place.source) or paths.nearest(scene, layer)


def _when(path: Path) -> str:
    """When a file was written: the time if today, else the day."""
    at, now = time.localtime(path.stat().st_mtime), time.localtime()
    same = at[:3] == now[:3]
    return time.strftime("%H:%M" if same else "%d %b", at)


def price(scene: bpy.types.Scene, goes_on: CaptureHead | None = None) -> tuple[str, ...]:
    """What a capture costs, in two lines: time, and disk space. It raises nothing, for panels.

    goes_on: see `Told`.
    """
    try:
        found = most(scene)
        pixels = picture_region(scene).pixels
        catches = any(thing.is_shadow_catcher for thing in scene.objects)
    except ArtoError as e:
        return (str(e),)
    samples = samples_of(scene)
    left, known = _seconds(scene, pixels * samples, goes_on)
    left *= ALL_TAKES if catches else 1.0
    text = "About {time}, {samples} samples" if known else "Perhaps {time}, {samples} samples"
    first = tr(text, time=clock(left), samples=samples)
    disk, kept = size(found.disk), size(found.kept)
    return first, tr("{disk} while it runs, keeps {kept}", disk=disk, kept=kept)


def _seconds(
    scene: bpy.types.Scene, paths_traced: int, goes_on: CaptureHead | None
) -> tuple[float, bool]:
    """The seconds that a capture takes, and whether they were measured on this shot."""
    heads = [goes_on] if goes_on else []
    try:
        source = paths.place(scene, layer_of(scene), fresh=bpy.app.background).source
        there = status.capture_at(source / "capture" / HEADER)
    except (ArtoError, OSError):
        there = None
    heads += [there.head] if there else []
    for head in heads:
        if head.seconds and head.traced:
            done = sum(tile.region.pixels for tile in head.tiles if tile.done)
            share = 1 - done / sum(tile.region.pixels for tile in head.tiles)
            share = share if head is goes_on else 1.0
            whole = head.seconds * paths_traced / head.traced
            return OTHERS + whole * (share or 1.0), True
    return OTHERS + paths_traced * _GUESS / (os.cpu_count() or 1), False
