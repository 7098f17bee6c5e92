"""What is decided before the first long render: patches, their route, tiles, and whether there is
room for it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import bpy

from ...core.capture.agreement import Caution
from ...core.capture.kinds import Keep, Route
from ...core.capture.names import GRAIN
from ...core.capture.refine import check as can_refine
from ...core.errors import ArtoError
from ...core.fit.choice import check as check_choice
from ...core.hemicube import Hemicube
from ...core.patterns import pattern_set
from ...core.region import Region
from ...core.units import size
from ..stage.settings import samples_of
from ..stage.stage import Stage, picture_region
from ..work import Progress, Steps
from . import planes, room
from .light_check import check_light
from .plan import render_plan, strips_of, tiles_of
from .probe import refined
from .room import Estimate

# How many times as many patches as the grid has the probe may hand out.
ADAPTIVE_SHARE = 2


@dataclass(frozen=True)
class Given:
    """What was looked at before, for all frames of a shot: the patches, whole, and how light gets
    to them; caution: see `check_light`."""

    hemicube: Hemicube
    route: Route
    caution: Caution | None


@dataclass(frozen=True)
class Planned:
    """What a capture will be, before its first long render."""

    hemicube: Hemicube
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
) -> Steps:
    """Look at the scene, by small renders -> `Planned`. strips: into how many tiles the picture is
    cut (default: as the memory says); takes: so many captures like this are to come. Raises
    SceneError where there is no room for them."""
    settings = scene.arto
    if given:
        route, caution = given.route, given.caution
    else:
        if settings.adaptive:
            can_refine(hemicube)  # before anything is rendered
        route, caution = yield from light_route(on, hemicube)
        if settings.adaptive and route != Route.SAMPLED:
            hemicube = yield from refined(on, hemicube, ADAPTIVE_SHARE * len(hemicube))
    grain = grain and route == Route.ALL
    names = [*pattern_set(settings.patterns).patterns, *([GRAIN] if grain else [])]
    plan = [len(images) for images in render_plan(route, hemicube, names)]
    budget = room.budget(settings.memory)

    def estimated(kept: bool) -> tuple[list[Region], Estimate]:
        bytes_a_pixel = room.bytes_a_pixel(max(plan), len(hemicube), not kept)
        tiles = strips_of(region, strips) if strips else tiles_of(region, bytes_a_pixel, budget)
        seconds = None
        if on.pace:
            renders = len(plan) * len(tiles)
            paths_traced = region.pixels * samples_of(scene) * len(plan)
            seconds = renders * on.pace.ready + paths_traced * on.pace.path
            seconds += sum(plan) * len(tiles) * on.pace.layer
        one = room.estimate(plan, tiles, len(hemicube), not kept, seconds)
        return tiles, one.times(takes)

    kept = settings.keep != Keep.NEVER
    tiles, estimate = estimated(kept)
    if settings.keep == Keep.FITS and estimate.kept > settings.keep_limit * 1e9:
        kept = False
        check_choice(settings.support, pattern_set(settings.patterns), settings.separate)
        tiles, estimate = estimated(kept)
    yield Progress(0.0, f"this capture: {estimate.line}")
    room.check_memory(estimate.memory, "this capture")
    room.check_disk(folder, estimate.disk, "this capture")
    return Planned(hemicube, route, grain, kept, caution, tiles, estimate)


def light_route(on: Stage, hemicube: Hemicube) -> Steps:
    """How light gets to the patches -> (route, what the artist is told, see `check_light`)."""
    settings = on.scene.arto
    if not settings.far:
        # a near hemicube is no world: what it lights differs by what it is near to
        return Route(settings.route), None
    sampled, caution = yield from check_light(on, hemicube)
    return (Route.SAMPLED if sampled else Route(settings.route)), caution


def most(scene: bpy.types.Scene) -> Estimate:
    """What a capture may take at most, before anything is looked at. Raises SceneError,
    HemicubeError, PatternError."""
    settings = scene.arto
    hemicube = planes.wanted(scene, (0.0, 0.0, 0.0), 1.0)
    patches = len(hemicube) * (ADAPTIVE_SHARE if settings.adaptive else 1)
    images = patches * (len(pattern_set(settings.patterns)) + settings.grain)
    fitted = settings.keep == Keep.NEVER
    bytes_a_pixel = room.bytes_a_pixel(images, patches, fitted)
    tiles = tiles_of(picture_region(scene), bytes_a_pixel, room.budget(settings.memory))
    return room.estimate([images], tiles, patches, fitted)


def guess(scene: bpy.types.Scene, short: bool = False) -> str:
    """`most` in words, for the button; short: of memory and disk alone, for a panel.

    What it will take, the capture says after its probe. Where it cannot be, why not: a panel raises
    nothing.
    """
    try:
        found = most(scene)
    except ArtoError as e:
        return str(e)
    if short:
        return f"up to {size(found.memory)} memory, {size(found.disk)} disk"
    return f"up to {found.line}"
