"""Capturing: the basis images, rendered by Cycles into a capture set (paper 4)."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import bpy

from ...core import exr
from ...core.basis_images import GRAIN, GROUP, group_name
from ...core.capture_set import VERSION, describe, write_header
from ...core.choice import check as check_choice
from ...core.errors import ArtoError, CaptureSetError, SceneError
from ...core.files import Lock, whole
from ...core.hemicube import Hemicube
from ...core.patterns import pattern_set
from ...core.region import Region
from ...core.shot import Shot
from ..blender.output import write_to
from ..relight.denoise import cleaned
from ..shot import home, paths
from ..shot.fingerprint import fingerprint, key_of
from ..shot.shot import shot_of
from ..stage.bounds import Rendered, rendered
from ..stage.settings import prepare
from ..stage.stage import Stage, picture_region, set_region, stage
from ..work import Progress, Render, Steps
from . import planes
from .check import check_scene
from .plan import SAMPLED, render_plan
from .planned import Given, planned
from .resume import empty, finish, finish_field, let_go, unfinished
from .stream import Stream


def geometry(scene: bpy.types.Scene, seen: Rendered) -> Hemicube:
    """The hemicube to capture with: the artist's, where one was built, else a new one."""
    bounds = seen.bounds()
    there = planes.built(scene)
    if there is None:
        return planes.wanted(scene, *bounds)
    hemicube, radius = there
    if planes.wanted(scene, hemicube.centre, radius).to_json() != hemicube.to_json():
        raise SceneError(
            "the hemicube in the scene was built with other settings: press Build Hemicube again, "
            "or remove it"
        )
    return hemicube


def _check_file(path: Path, images: list[tuple[int, str]]) -> None:
    """Raise CaptureSetError unless Blender wrote all of a render."""
    expected = {group_name(k, name) for k, name in images}
    found = set()
    for name in exr.part_names(path):
        if match := GROUP.search(name):
            found.add(f"ARTO_{match[1]}_{match[2]}")
    if missing := expected - found:
        raise CaptureSetError(
            f"{path} lacks {len(missing)} of {len(expected)} light groups: make room on the disk "
            "and capture again"
        )


def capture(
    scene: bpy.types.Scene,
    view_layer: str,
    only_estimate: bool = False,
    given: Given | None = None,
) -> Steps:
    """Render the basis images of a scene into its capture set; returns the folder.

    Where the settings keep no basis images, each tile is fitted as it comes, and the field takes
    the place of the shot's. A set left unfinished by the same capture of the same scene is gone on
    with; an earlier finished one stays until the new one is complete, and so do unfinished ones of
    other settings. only_estimate: stop before the first long render; returns the `room.Estimate`;
    given: see there. Raises SceneError, CaptureSetError, FieldError, PatternError, BusyError
    (another process captures this shot), ExrError, CancelledError; the scene stays as it is, but
    for the ID that its shots are found by.
    """
    check_scene(scene, view_layer)
    # whatever a script has moved is where it should be
    scene.view_layers[view_layer].update()
    if scene.arto.keep == "never":
        check_choice(scene.arto.support, pattern_set(scene.arto.patterns), scene.arto.separate)
    claimed = paths.claim(scene, view_layer)
    with Lock(claimed, f"capturing {shot_of(scene, view_layer).title}"):
        return (yield from _capture(scene, view_layer, claimed, only_estimate, given))


def _capture(
    scene: bpy.types.Scene,
    view_layer: str,
    claimed: Path,
    only_estimate: bool,
    given: Given | None,
) -> Steps:
    settings = scene.arto
    region = picture_region(scene)
    found = fingerprint(scene, view_layer, full=True)
    with stage(scene, view_layer) as on:
        seen = rendered(on)
        seen.check()
        hemicube = given.hemicube if given else geometry(scene, seen)
        # between renders the paths differ, and grain would not be theirs
        grain = settings.grain and settings.route == "all"
        prepare(on, layers=len(pattern_set(settings.patterns)) + grain)
        shot = shot_of(scene, view_layer, region)
        asked, decides = _asked(scene, on, hemicube, shot, region, grain, found)
        key = hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()[:16]
        folder = paths.unfinished_folder(claimed, key)
        head = unfinished(folder, key)
        if head is None or only_estimate:
            plan = yield from planned(scene, on, hemicube, region, grain, folder, given)
            if only_estimate:
                return plan.estimate
            about = {
                "scene": scene.name,
                "file": home.file(),
                "view_layer": view_layer,
                "shot": shot.to_json(),
                "frame": scene.frame_current,
                "fingerprint": found,
                "caution": plan.caution,
            }
            decides |= {
                "route": plan.route,
                "grain": plan.grain,
                "kept": plan.kept,
                "choice": settings.support,
                "separate": settings.separate,
            }
            size = (shot.height, shot.width)
            patterns = pattern_set(settings.patterns)
            head = describe(plan.hemicube, patterns, size, key=key, **decides, **about)
            head["seconds"] = 0.0
            head["tiles"] = [
                {"region": [t.x, t.y, t.width, t.height], "files": [], "done": False}
                for t in plan.tiles
            ]
            empty(folder)
        yield from _render_tiles(on, folder, head)
    if not head["kept"]:
        finish_field(folder, claimed / "field", head)
        yield from cleaned(scene, claimed / "field")
    finish(folder, claimed / "capture")
    paths.forget()
    caution = f". CAUTION: {head['caution']['text']}" if head.get("caution") else ""
    yield Progress(1.0, f"captured {head['patches']} patches{caution}")
    return claimed / "capture"


def _asked(
    scene: bpy.types.Scene,
    on: Stage,
    hemicube: Hemicube,
    shot: Shot,
    region: Region,
    grain: bool,
    found: dict[str, str],
) -> tuple[list[Any], dict[str, Any]]:
    """What tells a capture from another, and what of it goes into its description."""
    settings = scene.arto
    patterns = pattern_set(settings.patterns)
    decides = {
        "samples": settings.samples,
        "seed": settings.seed,
        "route": settings.route,
        "grain": grain,
        "adaptive": settings.adaptive,
        "far": settings.far,
        "blender": bpy.app.version_string,
        "colour_space": bpy.data.colorspace.working_space,
        "film_transparent": scene.render.film_transparent,
        "changed": on.changed,
    }
    # names are not in it: a renamed file or scene goes on with what it has
    frame = [shot.camera_matrix, shot.lens, shot.frame, shot.subframe, shot.view_layer]
    asked = [describe(hemicube, patterns, (shot.height, shot.width), **decides), vars(region)]
    asked += [frame, settings.memory, key_of(found), VERSION, settings.keep]
    if settings.keep != "always":
        asked += [settings.keep_limit, settings.support, settings.separate]
    return asked, decides


def _render_tiles(on: Stage, folder: Path, head: dict[str, Any]) -> Steps:
    """Render what is not there yet of a capture set, and fit it where it is not kept."""
    hemicube = Hemicube.from_json(head["hemicube"])
    patterns = pattern_set(head["patterns"])
    names = [*patterns.patterns, *([GRAIN] if head["grain"] else [])]
    plan = render_plan(head["route"], hemicube, names)
    tiles = [Region(*t["region"]) for t in head["tiles"]]
    stream = None if head["kept"] else Stream(folder, head["choice"], head["separate"])
    write_header(folder, head)
    total = len(plan) * len(tiles)

    def take(patience: float | None) -> bool:
        """Note down the tile that was fitted; whether one still is being fitted."""
        if stream and (ended := stream.ended(patience)):
            number, fitted = ended
            let_go(folder, head, number, fitted)
        return stream is not None and stream.busy

    def fit(number: int) -> Iterator[Progress]:
        while take(0.1):
            yield Progress((number + 0.5) / len(tiles), f"fitting tile {number} of {len(tiles)}")
        if stream:
            stream.start(number)

    try:
        for t, tile in enumerate(tiles):
            entry = head["tiles"][t]
            if entry["done"]:
                yield Progress((t + 1) / len(tiles), f"tile {t + 1} of {len(tiles)} is there")
                if stream and "fitted" not in entry:
                    yield from fit(t)
                continue
            set_region(on.scene, tile)
            entry["files"] = []
            for i, images in enumerate(plan):
                at = t * len(plan) + i
                text = f"render {at + 1} of {total}: {len(images)} basis images"
                name = f"tile_{t:04d}.exr" if len(plan) == 1 else f"tile_{t:04d}_{i:04d}.exr"
                # a process that was killed may have finished it without noting it down
                if not _is_whole(folder / name, images):
                    begun = time.perf_counter()
                    work = Render(on.scene.name, at / total, text, 1 / total)
                    around = planes.lit(
                        on, hemicube, patterns, images, sampled=head["route"] == SAMPLED
                    )
                    yield from _render(on, around, images, folder / name, work)
                    head["seconds"] += time.perf_counter() - begun
                entry["files"].append(name)
            entry["done"] = True
            write_header(folder, head)
            take(0.0)
            yield from fit(t)
        while take(0.1):
            yield Progress(0.99, f"fitting tile {len(tiles)} of {len(tiles)}")
    finally:
        if stream:
            stream.stop()


def _is_whole(path: Path, images: list[tuple[int, str]]) -> bool:
    """Whether the basis images of a render are there already."""
    if not path.is_file():
        return False
    try:
        _check_file(path, images)
    except ArtoError:
        return False  # rendered again
    return True


def _render(
    on: Stage,
    around: AbstractContextManager[None],
    images: list[tuple[int, str]],
    path: Path,
    request: Render,
) -> Steps:
    """One render of some basis images into `path`; around: has their planes around the stage."""
    with whole(path) as partial:
        write_to(on.scene.render, partial)
        with around:
            yield request
            request.check()
        if not partial.is_file():
            raise CaptureSetError(
                f"Blender did not write {path}: make room on the disk, or choose a folder that "
                "can be written"
            )
        _check_file(partial, images)
