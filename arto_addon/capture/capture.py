"""Capturing: the basis images, rendered by Cycles into a capture set (paper 4)."""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import json
import shutil
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy

from ...core import exr
from ...core.capture_set import (
    GRAIN,
    GROUP,
    HEADER,
    VERSION,
    CaptureSet,
    describe,
    group_name,
    write_header,
)
from ...core.errors import ArtoError, CaptureSetError, SceneError
from ...core.region import Region
from ...core.hemicube import Hemicube
from ...core.patterns import PatternSet, pattern_set
from . import hemicube_planes, paths
from .bounds import scene_bounds
from .probe import refined
from .stage import Stage, float_exr, picture_size, set_region, stage
from .work import Progress, Render, Steps
from .world import check_no_volume

# Cycles and Blender's result each hold a group's pass: 3 floats, twice.
BYTES_PER_PASS = 24
OTHER_PASSES = 8
# Blender itself renders none smaller, denoising and the world behind included.
LEAST_PIXELS = 4
# How many times as many patches as the grid has the probe may hand out.
ADAPTIVE_SHARE = 2


def check_scene(scene: bpy.types.Scene) -> None:
    """Raise SceneError for a scene that cannot be captured."""
    if scene.render.engine != "CYCLES":
        raise SceneError(
            f"the render engine is {scene.render.engine}: ARTO captures with Cycles; choose it in "
            "the render properties"
        )
    if scene.camera is None:
        raise SceneError("the scene has no camera: add one, or make one the scene's camera")
    if scene.world:
        check_no_volume(scene.world)
    width, height = picture_size(scene)
    if min(width, height) < LEAST_PIXELS:
        raise SceneError(
            f"the picture has only {width}x{height} pixels: raise the resolution or its percentage"
        )
    things = list(scene.objects)
    things += [
        o for e in things if e.instance_collection for o in e.instance_collection.all_objects
    ]
    # a lamp's own flag means nothing
    catchers = [
        o.name for o in things if o.type != "LIGHT" and o.is_shadow_catcher and not o.hide_render
    ]
    if catchers:
        raise SceneError(
            f"'{catchers[0]}' is a shadow catcher, which writes no light groups: turn Shadow "
            "Catcher off (Object properties, Visibility) and capture it as an object"
        )
    if not scene.arto.faces:
        raise SceneError("the hemicube has no faces: choose at least one")


def tiles_of(region: Region, passes: int, budget_megabytes: int) -> list[Region]:
    """Cut a region into strips whose passes fit the budget."""
    row = region.width * (passes + OTHER_PASSES) * BYTES_PER_PASS
    rows = budget_megabytes * 2**20 // row
    if rows < 1:
        raise SceneError(
            f"a single row of the picture takes {row / 2**20:.0f} MB in {passes} passes: raise "
            "the memory budget, or capture fewer patches or patterns"
        )
    count = -(-region.height // rows)
    edges = [region.height * i // count for i in range(count + 1)]
    return [
        Region(region.x, region.y + a, region.width, b - a) for a, b in itertools.pairwise(edges)
    ]


def render_plan(
    route: str, hemicube: Hemicube, names: Sequence[str]
) -> list[list[tuple[int, str]]]:
    """The (patch, pattern name) images of each render."""
    k = range(len(hemicube))
    if route == "all":
        return [[(i, name) for i in k for name in names]]
    if route == "pattern":
        return [[(i, name) for i in k] for name in names]
    return [[(i, name)] for i in k for name in names]


def picture_region(scene: bpy.types.Scene) -> Region:
    """What the scene renders of its picture: all of it, or the artist's render region."""
    width, height = picture_size(scene)
    r = scene.render
    if not r.use_border:
        return Region(0, 0, width, height)
    x0, x1 = int(r.border_min_x * width + 0.5), int(r.border_max_x * width + 0.5)
    y0, y1 = int(r.border_min_y * height + 0.5), int(r.border_max_y * height + 0.5)
    if x1 <= x0 or y1 <= y0:
        raise SceneError("the render region is empty: draw it again, or turn it off")
    return Region(x0, height - y1, x1 - x0, y1 - y0)


def shot(scene: bpy.types.Scene) -> dict[str, Any]:
    """What tells one shot from another: which picture of which scene this is."""
    width, height = picture_size(scene)
    camera = scene.camera
    return {
        "scene": scene.name,
        "frame": scene.frame_current,
        "width": width,
        "height": height,
        "camera": [round(x, 5) for row in camera.matrix_world for x in row] if camera else [],
        "lens": _lens(scene),
    }


def _lens(scene: bpy.types.Scene) -> list[Any]:
    """What of the camera decides the framing, beside where it stands."""
    if not scene.camera or scene.camera.type != "CAMERA":
        return []
    lens, render = scene.camera.data, scene.render
    kind = lens.type
    names = ["shift_x", "shift_y", "sensor_fit", "sensor_width", "sensor_height"]
    names += {"PERSP": ["lens"], "ORTHO": ["ortho_scale"]}.get(kind, ["panorama_type"])
    values = [getattr(lens, name) for name in names]
    values += [render.pixel_aspect_x, render.pixel_aspect_y]
    return [kind, *(round(v, 5) if isinstance(v, float) else v for v in values)]


def check_same_shot(scene: bpy.types.Scene, head: dict[str, Any], what: str) -> None:
    """Raise CaptureSetError where a capture set or field is of another shot than the scene's."""
    now = shot(scene)
    then = head.get("shot") or {}
    for key in ("scene", "width", "height", "frame", "camera", "lens"):
        if key in then and then[key] != now[key]:
            shown = "" if key in ("camera", "lens") else f" ({then[key]}, now {now[key]})"
            raise CaptureSetError(
                f"{what} is of another {key}{shown}: set it back, or capture and fit again"
            )


def prepare(on: Stage, layers: int) -> None:
    """Switch off on the stage whatever would bend the light or take it apart."""
    s = on.scene.arto
    for path, value in {
        "cycles.samples": s.samples,
        "cycles.seed": s.seed,
        "cycles.use_animated_seed": False,
        "cycles.use_layer_samples": "IGNORE",
        "cycles.use_sample_subset": False,
        "cycles.time_limit": 0.0,
        "cycles.use_adaptive_sampling": False,
        "cycles.use_denoising": False,
        "cycles.sample_clamp_direct": 0.0,
        "cycles.sample_clamp_indirect": 0.0,
        "cycles.use_fast_gi": False,
        "cycles.transparent_max_bounces": on.scene.cycles.transparent_max_bounces + layers,
        "render.film_transparent": True,
        # glass that lets the film through would let the patches through as well
        "cycles.film_transparent_glass": False,
        "render.use_persistent_data": False,
    }.items():
        on.change(path, value)
    layer = on.scene.view_layers[0]
    layer.cycles.denoising_store_passes = True
    layer.use_pass_z = True
    world = on.made(bpy.data.worlds.new("ARTO Black"))
    world.node_tree.nodes.clear()
    on.changed["world"] = [on.scene.world.name if on.scene.world else None, None]
    on.scene.world = world
    float_exr(on.scene.render)


def geometry(scene: bpy.types.Scene, on: Stage) -> Hemicube:
    """The hemicube to capture with: the artist's, where one was built, else a new one."""
    there = hemicube_planes.built(scene)
    if there is None:
        return hemicube_planes.wanted(scene, *scene_bounds(on))
    hemicube, radius = there
    if hemicube_planes.wanted(scene, hemicube.centre, radius).to_json() != hemicube.to_json():
        raise SceneError(
            "the hemicube in the scene was built with other settings: press Build Hemicube again, "
            "or remove it"
        )
    return hemicube


def _unfinished(folder: Path, key: str) -> dict[str, Any] | None:
    """The description of the very same capture, left unfinished, to go on with."""
    if (folder / HEADER).is_file():
        with contextlib.suppress(ArtoError):
            there = CaptureSet(folder, unfinished=True).head
            if there.get("key") == key:
                return there
    return None


def _empty(folder: Path) -> None:
    try:
        if folder.exists():
            shutil.rmtree(folder)
    except OSError as e:
        raise CaptureSetError(f"{folder} cannot be emptied ({e}): choose another folder") from e


def _finish(unfinished: Path, folder: Path) -> None:
    """Put the complete capture set where the last one is."""
    old = folder.with_name(folder.name + ".old")
    try:
        if folder.exists():
            if old.exists():  # a crash left it
                shutil.rmtree(old)
            folder.replace(old)
        unfinished.replace(folder)
        if old.exists():
            shutil.rmtree(old)
    except OSError as e:
        raise CaptureSetError(
            f"{unfinished} is complete but cannot take the place of {folder} ({e}): close what "
            "uses that folder and capture again, no render is repeated"
        ) from e


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
        head = _unfinished(folder, key)
        if head is None:
            if settings.adaptive:
                hemicube = yield from refined(on, hemicube, ADAPTIVE_SHARE * len(hemicube))
            plan = render_plan(settings.route, hemicube, names)
            tiles = tiles_of(region, max(map(len, plan)), settings.memory)
            head = describe(hemicube, patterns, size, key=key, **about)
            head["tiles"] = [
                {"region": [t.x, t.y, t.width, t.height], "files": [], "done": False} for t in tiles
            ]
            _empty(folder)
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
    _finish(folder, paths.capture_folder(scene))
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
        with hemicube_planes.lit(on, hemicube, patterns, images):
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
