"""What is decided before the first long render: patches, their route, tiles, and keeping images.

The plan also checks that there is room for the capture.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import bpy
from numpy.typing import NDArray

from ...core.capture.agreement import Caution
from ...core.capture.kinds import Keep, Route
from ...core.capture.names import GRAIN
from ...core.capture.refine import check as can_refine
from ...core.capture.refine import refine
from ...core.errors import ArtoError, SceneError
from ...core.fit.choice import check as check_choice
from ...core.hemicube import Hemicube
from ...core.patterns import LobedSet, PatternSet
from ...core.region import Region
from ...core.units import size
from ..stage.settings import samples_of
from ..stage.small import threads
from ..stage.stage import Pace, Stage, picture_region
from ..stage.takes import TAKES
from ..work import Progress, Steps
from . import planes, probe, room
from .light_check import check_light
from .look import SAMPLES, look
from .patterns import patterns_of
from .plan import kept_often, render_plan, strips_of, tiles_of
from .room import Estimate

# How many times more patches than the grid has the probe may ask for.
ADAPTIVE_SHARE = 2


@dataclass(frozen=True)
class Given:
    """What was decided before, for all frames or takes of a shot.

    hemicube: all its patches, refined; route: how light gets to them; caution: see `check_light`;
    pace: how fast the scene renders, where that was measured.
    """

    hemicube: Hemicube
    route: Route
    caution: Caution | None
    pace: Pace | None = None


@dataclass(frozen=True)
class Planned:
    """What a capture will be, before its first long render."""

    hemicube: Hemicube
    patterns: PatternSet
    route: Route
    grain: bool
    kept: bool
    caution: Caution | None
    tiles: list[Region]
    estimate: Estimate


def planned(
    scene: bpy.types.Scene,
    on: Stage,
    hemicube: Hemicube,
    region: Region,
    grain: bool,
    folder: Path,
    given: Given | None,
    strips: int | None = None,
    takes: int = 1,
    often: bool = False,
) -> Steps[Planned]:
    """Look at the scene by small renders and plan a capture -> `Planned`.

    strips: the number of tiles of the picture (default: as many as memory makes necessary); takes:
    how many captures like this are to come; often: whether to cut more tiles, so that work is kept
    every minute. Raises SceneError where there is no room for them.
    """
    settings = scene.arto
    if given:
        route, caution = given.route, given.caution
    else:
        if settings.adaptive:
            can_refine(hemicube)  # before anything is rendered
        route, caution, probed = yield from looked_at(on, hemicube)
        if probed is not None:
            hemicube = refine(hemicube, probed, SAMPLES, ADAPTIVE_SHARE * len(hemicube))
    patterns = patterns_of(settings, route)
    if route == Route.SAMPLED and isinstance(patterns, LobedSet):
        # a patch that is hidden from diffuse rays lights nothing diffuse by shadow rays
        raise SceneError(
            "light comes into this scene by shadow rays alone, of which the patterns 'Packed, by "
            "Lobe' know nothing: choose the patterns '1, u, v'"
        )
    grain = grain and route == Route.ALL
    names = [*patterns.patterns, *([GRAIN] if grain else [])]
    plan = [len(images) for images in render_plan(route, hemicube, names)]
    budget = room.budget(settings.memory)

    def estimated(kept: bool) -> tuple[list[Region], Estimate]:
        bytes_a_pixel = room.bytes_a_pixel(max(plan), len(hemicube), not kept)
        tiles = strips_of(region, strips) if strips else tiles_of(region, bytes_a_pixel, budget)
        seconds, pace = None, on.pace or (given.pace if given else None)
        if pace:
            tracing = region.pixels * samples_of(scene) * len(plan) * pace.path * pace.busy
            # with other planes for each render of a tile, each is prepared for
            once = on.is_kept and len(plan) == 1
            ready = pace.again if once else len(plan) * pace.ready
            if often and not strips:
                tiles = kept_often(tiles, region, tracing + len(tiles) * ready, ready)
            seconds = tracing + len(tiles) * ready + (pace.ready if once else 0.0)
            each = room.SAVING + (0.0 if kept else room.FITTING / threads(on.scene))
            seconds += region.pixels * sum(plan) * each * pace.busy
        one = room.estimate(plan, tiles, len(hemicube), not kept, seconds)
        return tiles, one.times(takes)

    kept = settings.keep != Keep.NEVER
    tiles, estimate = estimated(kept)
    if settings.keep == Keep.FITS and estimate.kept > settings.keep_limit * 1e9:
        kept = False
        check_choice(settings.support, patterns, settings.separate)
        tiles, estimate = estimated(kept)
    scene_too = f", beside {size(on.scene_bytes)} for the scene" if on.scene_bytes else ""
    yield Progress(0.0, f"this capture: {estimate.line}{scene_too}")
    if on.is_kept and room.lacks_memory(estimate.memory):
        on.let_go()
        yield Progress(0.0, "memory is short: Cycles prepares the scene again for each render")
    room.check_memory(estimate.memory, "this capture")
    room.check_disk(folder, estimate.disk, "this capture")
    return Planned(hemicube, patterns, route, grain, kept, caution, tiles, estimate)


def looked_at(on: Stage, hemicube: Hemicube) -> Steps[tuple[Route, Caution | None, NDArray | None]]:
    """Choose how light gets to the patches -> (route, the `Caution` of `check_light`, the probe).

    The probe is for `refine`; None where the patches are not refined.
    """
    settings = on.scene.arto
    route, caution, looked = Route(settings.route), None, None
    refines = settings.adaptive and route != Route.SAMPLED
    # A near hemicube lights near things more, so a comparison with a world says nothing.
    if settings.far:
        # What Ray Portals show of the patches is not in the comparison, and is in the probe.
        if refines and not on.portals:
            looked = yield from look(on, hemicube)
        sampled, caution = yield from check_light(on, hemicube, looked)
        route = Route.SAMPLED if sampled else route
    if not refines or route == Route.SAMPLED:
        return route, caution, None
    found = looked.probe if looked else (yield from probe.probed(on, hemicube))
    return route, caution, found


def room_for(scene: bpy.types.Scene, given: Given) -> Estimate:
    """What a capture with given patches takes, before anything of it is rendered."""
    settings = scene.arto
    grain = settings.grain and given.route == Route.ALL
    names = [*patterns_of(settings, given.route).patterns, *([GRAIN] if grain else [])]
    plan = [len(images) for images in render_plan(given.route, given.hemicube, names)]

    def estimated(fitted: bool) -> Estimate:
        bytes_a_pixel = room.bytes_a_pixel(max(plan), len(given.hemicube), fitted)
        tiles = tiles_of(picture_region(scene), bytes_a_pixel, room.budget(settings.memory))
        return room.estimate(plan, tiles, len(given.hemicube), fitted)

    found = estimated(settings.keep == Keep.NEVER)
    too_large = settings.keep == Keep.FITS and found.kept > settings.keep_limit * 1e9
    return estimated(True) if too_large else found


def most(scene: bpy.types.Scene) -> Estimate:
    """What a capture may take at most, without a look at the scene.

    Raises SceneError, HemicubeError, PatternError.
    """
    hemicube = planes.wanted(scene, (0.0, 0.0, 0.0), 1.0)
    return _of_patches(scene, len(hemicube) * (ADAPTIVE_SHARE if scene.arto.adaptive else 1))


def least(scene: bpy.types.Scene) -> Estimate:
    """What a capture takes at least, without a look at the scene. Raises what `most` raises."""
    hemicube = planes.wanted(scene, (0.0, 0.0, 0.0), 1.0)
    return _of_patches(scene, len(hemicube.faces) if scene.arto.adaptive else len(hemicube))


def _of_patches(scene: bpy.types.Scene, patches: int) -> Estimate:
    settings = scene.arto
    images = patches * (len(patterns_of(settings)) + settings.grain)
    fitted = settings.keep == Keep.NEVER
    bytes_a_pixel = room.bytes_a_pixel(images, patches, fitted)
    tiles = tiles_of(picture_region(scene), bytes_a_pixel, room.budget(settings.memory))
    found = room.estimate([images], tiles, patches, fitted)
    catches = any(thing.is_shadow_catcher for thing in scene.objects)
    return found.times(1 + len(TAKES)) if catches else found


def check_room(scene: bpy.types.Scene, folder: Path) -> None:
    """Raise SceneError where there is no room for a capture, however few patches it takes.

    A capture looks again once it knows how many. folder: where it will be.
    """
    found = least(scene)
    room.check_memory(found.memory, "this capture")
    room.check_disk(folder, found.disk, "this capture")


def doubts(scene: bpy.types.Scene, folder: Path) -> str:
    """Say where there may be no room for a capture; empty where there is enough in any case."""
    try:
        found = most(scene)
        room.check_memory(found.memory, "this capture, at most,")
        room.check_disk(folder, found.disk, "this capture, at most,")
    except ArtoError as e:
        return str(e)
    return ""


def guess(scene: bpy.types.Scene, short: bool = False) -> str:
    """Say `most` in words, for the button; short: memory and disk alone, for a panel.

    Where a capture cannot be made, say why instead of raising. Once a capture has made its probe,
    it says what it will really take.
    """
    try:
        found = most(scene)
    except ArtoError as e:
        return str(e)
    if short:
        return f"up to {size(found.memory)} memory, {size(found.disk)} disk"
    return f"up to {found.line}"
