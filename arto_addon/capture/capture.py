"""Capturing: the basis images, rendered by Cycles into a capture set (paper 4)."""

from __future__ import annotations

import hashlib
import json
import time
from contextlib import AbstractContextManager
from pathlib import Path

import bpy

from ...core import exr
from ...core.basis_images import GRAIN, GROUP, group_name
from ...core.capture_set import VERSION, describe, write_header
from ...core.errors import ArtoError, CaptureSetError, SceneError
from ...core.files import Lock, whole
from ...core.hemicube import Hemicube
from ...core.patterns import pattern_set
from ...core.refine import check as can_refine
from ...core.region import Region
from ..blender.output import write_to
from ..shot import home, paths
from ..shot.fingerprint import fingerprint, key_of
from ..shot.shot import shot_of
from ..stage.bounds import Rendered, rendered
from ..stage.settings import prepare
from ..stage.stage import Stage, picture_region, set_region, stage
from ..work import Progress, Render, Steps
from . import planes
from .check import check_scene
from .light_check import check_light
from .plan import SAMPLED, render_plan, tiles_of
from .probe import refined
from .resume import empty, finish, unfinished

# How many times as many patches as the grid has the probe may hand out.
ADAPTIVE_SHARE = 2


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


def capture(scene: bpy.types.Scene, view_layer: str) -> Steps:
    """Render the basis images of a scene into its capture set; returns the folder.

    A set left unfinished by the same capture of the same scene is gone on with; an earlier finished
    one stays until the new one is complete, and so do unfinished ones of other settings. Raises
    SceneError, CaptureSetError, BusyError (another process captures this shot), ExrError,
    CancelledError; the scene stays as it is, but for the ID that its shots are found by.
    """
    check_scene(scene, view_layer)
    # whatever a script has moved is where it should be
    scene.view_layers[view_layer].update()
    claimed = paths.claim(scene, view_layer)
    with Lock(claimed, f"capturing {shot_of(scene, view_layer).title}"):
        return (yield from _capture(scene, view_layer, claimed))


def _capture(scene: bpy.types.Scene, view_layer: str, claimed: Path) -> Steps:
    settings = scene.arto
    patterns = pattern_set(settings.patterns)
    region = picture_region(scene)
    found = fingerprint(scene, view_layer, full=True)
    with stage(scene, view_layer) as on:
        seen = rendered(on)
        seen.check()
        hemicube = geometry(scene, seen)
        # between renders the paths differ, and grain would not be theirs
        grain = settings.grain and settings.route == "all"
        names = [*patterns.patterns, *([GRAIN] if grain else [])]
        prepare(on, layers=len(names))
        shot = shot_of(scene, view_layer, region)
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
        size = (shot.height, shot.width)
        # names are not in it: a renamed file or scene goes on with what it has
        frame = [shot.camera_matrix, shot.lens, shot.frame, shot.subframe, shot.view_layer]
        asked = [describe(hemicube, patterns, size, **decides), vars(region), frame]
        asked += [settings.memory, key_of(found), VERSION]
        key = hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()[:16]
        folder = paths.unfinished_folder(claimed, key)
        head = unfinished(folder, key)
        if head is None:
            if settings.adaptive:
                can_refine(hemicube)  # before anything is rendered
            route, light = settings.route, None
            if settings.far:
                # a near hemicube is no world: what it lights differs by what it is near to
                sampled, light = yield from check_light(on, hemicube)
                route = SAMPLED if sampled else route
            if settings.adaptive and route != SAMPLED:
                hemicube = yield from refined(on, hemicube, ADAPTIVE_SHARE * len(hemicube))
            names = [n for n in names if n != GRAIN or route == "all"]
            plan = render_plan(route, hemicube, names)
            tiles = tiles_of(region, max(map(len, plan)), settings.memory)
            about = {
                "scene": scene.name,
                "file": home.file(),
                "view_layer": view_layer,
                "shot": shot.to_json(),
                "frame": scene.frame_current,
                "fingerprint": found,
                "caution": light,
            }
            decides |= {"route": route, "grain": GRAIN in names}
            head = describe(hemicube, patterns, size, key=key, **decides, **about)
            head["seconds"] = 0.0
            head["tiles"] = [
                {"region": [t.x, t.y, t.width, t.height], "files": [], "done": False} for t in tiles
            ]
            empty(folder)
        hemicube = Hemicube.from_json(head["hemicube"])
        names = [*patterns.patterns, *([GRAIN] if head["grain"] else [])]
        plan = render_plan(head["route"], hemicube, names)
        tiles = [Region(*t["region"]) for t in head["tiles"]]
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
    finish(folder, claimed / "capture")
    paths.forget()
    caution = f". CAUTION: {head['caution']['text']}" if head.get("caution") else ""
    yield Progress(1.0, f"captured {len(hemicube)} patches in {total} renders{caution}")
    return claimed / "capture"


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
