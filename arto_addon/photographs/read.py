"""Read photographs: the reflectance field of a scene that is of photographs, and what they tell."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...core import exr, marked
from ...core.capture.capture_set import CaptureSet
from ...core.capture.kinds import Keep, Route
from ...core.errors import FilesError, PhotographsError, SceneError
from ...core.files import Lock, replace_folder, write_text
from ...core.fit.fit import fit
from ...core.photographs import agree, dome_set, held_out, monitor_set
from ...core.photographs.description import Kind
from ...core.photographs.dome_set import Written
from ...core.photographs.opened import Photographs
from ..capture.check import check_place
from ..relight.relight import compute
from ..shot import paths
from ..shot.shot import layer_of, shot_of
from ..stage.stage import picture_size
from ..work import Progress, Steps, Warned, Wrote, part_of
from ..world.check import world_of
from .opening import SPACE, check_space, of_scene

# What is written into the shot's folder beside the field.
TABLE, WORST = "held_out.txt", "held_out.exr"
# How much of the work is done after the shifts were found, and after the pictures were read.
FOUND, READ, FITTED = 0.15, 0.6, 0.9


def read_photographs(scene: bpy.types.Scene, view_layer: str | None = None) -> Steps[Path]:
    """Read the photographs that a scene is of, and fit them; returns the field's folder.

    An older field stays until the new one is complete. Raises PhotographsError, SceneError,
    FieldError, BusyError.
    """
    layer = view_layer or layer_of(scene)
    photos = of_scene(scene)
    check_space()
    height, width = photos.shape
    if picture_size(scene) != (width, height):
        raise SceneError(
            f"the photographs are {width} x {height}, and the scene's picture is not: set the "
            "resolution back, at 100%"
        )
    check_place(scene, layer)
    folder = paths.claim(scene, layer)
    target = folder / "field"
    with Lock(folder, f"reading the photographs of {shot_of(scene, layer).title}"):
        scratch = marked.scratch(folder / "capture", "capture")
        try:
            found = yield from _captured(scene, layer, photos, scratch)
            captured = CaptureSet(scratch)
            for share, text in fit(captured, target, captured.head.told_choice[0]):
                yield Progress(READ + (FITTED - READ) * share, text)
            if found:
                yield from _held_out(photos, found, folder)
            if scene.arto.keep == Keep.ALWAYS:
                replace_folder(scratch, folder / "capture")
            elif (folder / "capture").exists():
                marked.remove(folder / "capture", "capture", folder)
        finally:
            if scratch.exists():
                marked.remove_quietly(scratch, "capture", folder)
    paths.forget()
    text = f"read {len(photos.pictures)} photographs as {len(captured.hemicube)} patches"
    yield Wrote(1.0, text, target)
    return target


def _captured(
    scene: bpy.types.Scene, layer: str, photos: Photographs, scratch: Path
) -> Steps[Written | None]:
    """Write the photographs as a capture set -> what was found of a dome, None for monitors."""
    for share in photos.find_shifts():
        yield Progress(FOUND * share, "looking whether photographs moved")
    for name, shift in photos.moved.items():
        text = f"'{name}' moved by {shift.x} pixels to the right and {shift.y} down: put back"
        yield Warned(FOUND, text)
    about: dict[str, Any] = {
        "key": key_of(photos),
        "scene": scene.name,
        "view_layer": layer,
        "frame": scene.frame_current,
        "shot": shot_of(scene, layer).to_json(),
        "route": Route.PHOTOGRAPHS.value,
        "colour_space": SPACE,
        "far": True,
        "film_transparent": scene.render.film_transparent,
        "kept": True,
    }
    if photos.said.of(Kind.LIGHT):
        work = dome_set.write(scratch, photos, **about)
        found = yield from _told(work)
        yield from _say(photos, found)
        return found
    photos.check_light()
    alpha = dome_set.alpha_of(photos)
    yield from _told(monitor_set.write(scratch, photos.said, photos.light, alpha=alpha, **about))
    if photos.assumed:
        yield Warned(READ, photos.assumed)
    return None


def _told(work: Iterator[float]) -> Steps[Any]:
    """Pass on how much of reading is done."""
    while True:
        try:
            share = next(work)
        except StopIteration as end:
            return end.value
        yield Progress(FOUND + (READ - FOUND) * share, "reading the photographs")


def _say(photos: Photographs, found: Written) -> Iterator[Progress]:
    """Say what an artist must know of the photographs."""
    if photos.assumed:
        yield Warned(READ, photos.assumed)
    if found.hole > 0.002:
        yield Warned(
            READ,
            f"no lamp covers {found.hole:.0%} of all directions "
            f"({4 * np.pi * found.hole:.2f} of 12.57 steradians; lamps reach "
            f"{found.reach:.0f} degrees): light from there is not shown",
        )
    if found.saturated > 0.0005:
        yield Warned(
            READ,
            f"{found.saturated:.1%} of the pixels are saturated in every exposure of some lamp, "
            "and are brighter than they are shown",
        )


def _held_out(photos: Photographs, found: Written, folder: Path) -> Steps[None]:
    """Predict each lamp from the others, and write down how well that went."""
    yield Progress(FITTED, "predicting each lamp from the others")
    pictures, weight = dome_set.small_pictures(photos)
    if said := agree.turned(pictures, found.lamps.directions, weight):
        yield Warned(FITTED, said)
    told = held_out.of_dome(pictures, found.lamps, weight)
    if told is None:
        return
    files = {k: photos.group(Kind.LIGHT, lamp=k)[0].file for k in range(len(pictures))}
    try:
        write_text(folder / TABLE, told.table(files) + "\n")
        exr.write(folder / WORST, {"": told.worst}, {"arto.photographs": "held out"})
    except OSError as e:
        raise FilesError(f"{folder} cannot be written ({e}): make room on the disk") from e
    worst = max(told.rows, key=lambda row: row.error)
    yield Progress(
        0.99,
        f"half of the lamps are predicted from the others to {told.error:.0%} or better, the "
        f"worst, '{files[worst.lamp]}', to {worst.error:.0%}: see {TABLE}",
    )


def key_of(photos: Photographs) -> str:
    """A digest of what photographs are of: their description, and their files' sizes and times."""
    out = hashlib.sha256(repr(photos.said).encode("utf-8", "surrogatepass"))
    for name in sorted(photos.pictures):
        try:
            there = (photos.folder / name).stat()
        except OSError as e:
            raise PhotographsError(f"{photos.folder / name} cannot be read ({e})") from e
        out.update(f"{name}\0{there.st_size}\0{there.st_mtime_ns}".encode())
    return out.hexdigest()[:16]


def read_and_relight(scene: bpy.types.Scene, view_layer: str | None = None) -> Steps[Path | None]:
    """Read the photographs that a scene is of, and relight them with its world.

    Returns the path of the plate, None without a world. The scene does not change, except that it
    gets an ID. Raises what both raise.
    """
    layer = view_layer or layer_of(scene)
    yield from part_of(read_photographs(scene, layer), 0.0, 0.95)
    if world_of(scene, layer) is None:
        yield Progress(1.0, "read: add a world with an HDRI to see the thing in its light")
        return None
    path, _ = yield from part_of(compute(scene, layer), 0.95, 0.05)
    return path
