"""Capturing: the basis images, rendered by Cycles into a capture set (paper 4)."""

from __future__ import annotations

import hashlib
import json
import time
from pathlib import Path

import bpy

from ...core import exr
from ...core.capture_set import GRAIN, GROUP, VERSION, describe, group_name, write_header
from ...core.errors import CaptureSetError, SceneError
from ...core.hemicube import Hemicube
from ...core.patterns import PatternSet, pattern_set
from ...core.region import Region
from ..shot import paths
from ..shot.shot import shot
from ..stage.bounds import scene_bounds
from ..stage.settings import prepare
from ..stage.stage import Stage, picture_size, set_region, stage
from ..work import Progress, Render, Steps
from . import planes
from .check import check_scene
from .plan import picture_region, render_plan, tiles_of
from .probe import refined
from .resume import empty, finish, unfinished

# How many times as many patches as the grid has the probe may hand out.
ADAPTIVE_SHARE = 2


def geometry(scene: bpy.types.Scene, on: Stage) -> Hemicube:
    """The hemicube to capture with: the artist's, where one was built, else a new one."""
    there = planes.built(scene)
    if there is None:
        return planes.wanted(scene, *scene_bounds(on))
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


def capture(scene: bpy.types.Scene, view_layer: str) -> Steps:
    """Render the basis images of a scene into its capture set; returns the folder.

    A set left unfinished by the same capture is gone on with; an earlier finished one stays until
    the new one is complete. Raises SceneError, CaptureSetError,
    ExrError, CancelledError; the scene stays as it is.
    """
    check_scene(scene)
    settings = scene.arto
    folder = paths.unfinished_capture_folder(scene)
    patterns = pattern_set(settings.patterns)
    region = picture_region(scene)
    with stage(scene, view_layer) as on:
        hemicube = geometry(scene, on)
        # between renders the paths differ, and grain would not be theirs
        grain = settings.grain and settings.route == "all"
        names = [*patterns.patterns, *([GRAIN] if grain else [])]
        prepare(on, layers=len(names))
        about = {
            "scene": scene.name,
            "file": bpy.data.filepath,
            "view_layer": view_layer,
            "shot": shot(scene),
            "frame": scene.frame_current,
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
        size = picture_size(scene)[::-1]
        asked = [describe(hemicube, patterns, size, **about), vars(region), settings.memory]
        key = hashlib.sha256(json.dumps([asked, VERSION], sort_keys=True).encode()).hexdigest()[:16]
        head = unfinished(folder, key)
        if head is None:
            if settings.adaptive:
                hemicube = yield from refined(on, hemicube, ADAPTIVE_SHARE * len(hemicube))
            plan = render_plan(settings.route, hemicube, names)
            tiles = tiles_of(region, max(map(len, plan)), settings.memory)
            head = describe(hemicube, patterns, size, key=key, **about)
            head["tiles"] = [
                {"region": [t.x, t.y, t.width, t.height], "files": [], "done": False} for t in tiles
            ]
            empty(folder)
        hemicube = Hemicube.from_json(head["hemicube"])
        plan = render_plan(settings.route, hemicube, names)
        tiles = [Region(*t["region"]) for t in head["tiles"]]
        head["seconds"] = 0.0
        write_header(folder, head)
        total = len(plan) * len(tiles)
        for t, tile in enumerate(tiles):
            entry = head["tiles"][t]
            if entry["done"]:
                yield Progress((t + 1) / len(tiles), f"tile {t + 1} of {len(tiles)} is there")
                continue
            set_region(on.scene, tile)
            entry["files"] = []
            for i, images in enumerate(plan):
                at = t * len(plan) + i
                text = f"render {at + 1} of {total}: {len(images)} basis images"
                name = f"tile_{t:04d}.exr" if len(plan) == 1 else f"tile_{t:04d}_{i:04d}.exr"
                begun = time.perf_counter()
                yield from _render(on, hemicube, patterns, images, folder / name, at / total, text)
                head["seconds"] += time.perf_counter() - begun
                entry["files"].append(name)
            entry["done"] = True
            write_header(folder, head)
    finish(folder, paths.capture_folder(scene))
    yield Progress(1.0, f"captured {len(hemicube)} patches in {total} renders")
    return paths.capture_folder(scene)


def _render(
    on: Stage,
    hemicube: Hemicube,
    patterns: PatternSet,
    images: list[tuple[int, str]],
    path: Path,
    share: float,
    text: str,
) -> Steps:
    """One render of some basis images into `path`."""
    partial = path.with_name(path.name + ".part")
    on.scene.render.filepath = str(partial)
    request = Render(on.scene.name, share, text)
    try:
        with planes.lit(on, hemicube, patterns, images):
            yield request
            request.check()
        if not partial.is_file():
            raise CaptureSetError(
                f"Blender did not write {path}: make room on the disk, or choose a folder that "
                "can be written"
            )
        _check_file(partial, images)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
