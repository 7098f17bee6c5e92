"""What is asked of a capture, and the description that it begins with.

The artist's settings, the scene as it is now, and what decides whether two captures are the same.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy

from ...core.capture.capture_set import VERSION, describe
from ...core.errors import SceneError
from ...core.hemicube import Hemicube
from ...core.patterns import pattern_set
from ...core.region import Region
from ...core.shot import Shot
from ..blender.colour import working_space
from ..settings.setting import Decides
from ..settings.table import values
from ..shot import home
from ..shot.fingerprint import fingerprint, key_of
from ..shot.shot import shot_of
from ..stage.bounds import Rendered, rendered
from ..stage.settings import prepare, samples_of
from ..stage.stage import Stage, picture_region, stage
from ..stage.takes import THINGS, WHOLE, only_things, take
from ..work import Steps
from . import planes
from .planned import Given, Planned, planned


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


@dataclass(frozen=True)
class Asked:
    """A capture that was asked for, on its stage. hemicube: before it is refined; key: the same for
    the very same capture alone; decides: what of it goes into the description; catchers: whether
    there are shadow catchers, see `takes`; otherwise: the objects that the take has otherwise than
    the artist."""

    scene: bpy.types.Scene
    view_layer: str
    on: Stage
    hemicube: Hemicube
    region: Region
    grain: bool
    shot: Shot
    found: dict[str, str]
    key: str
    decides: dict[str, Any]
    catchers: bool
    otherwise: list[bpy.types.Object]


@contextmanager
def asked(
    scene: bpy.types.Scene, view_layer: str, given: Given | None = None, name: str = WHOLE
) -> Iterator[Asked]:
    """Set the stage for a capture. given: see there; name: of the take. Raises SceneError."""
    settings = scene.arto
    region = picture_region(scene)
    found = fingerprint(scene, view_layer, full=True)
    with ExitStack() as held:
        on = held.enter_context(stage(scene, view_layer))
        seen = rendered(on)
        otherwise = held.enter_context(take(seen, name))
        hemicube = given.hemicube if given else geometry(scene, seen)
        # between renders the paths differ, and grain would not be theirs
        grain = settings.grain and settings.route == "all"
        patterns = pattern_set(settings.patterns)
        prepare(on, layers=len(patterns) + grain)
        # one of hundreds of passes; the takes beside the first hand on nothing but light
        on.scene.view_layers[0].use_pass_position = name == WHOLE
        if name == THINGS:
            only_things(on.scene.view_layers[0])
        shot = shot_of(scene, view_layer, region)
        decides = {
            "samples": samples_of(scene),
            **values(settings, Decides.CAPTURE),
            "grain": grain,
            "blender": bpy.app.version_string,
            "colour_space": working_space(),
            "film_transparent": scene.render.film_transparent,
            "changed": on.changed,
        }
        if seen.catchers:
            decides |= {"catchers": sorted(set(seen.catchers)), "take": name}
        # names are not in it: a renamed file or scene goes on with what it has
        frame = [shot.camera_matrix, shot.lens, shot.frame, shot.subframe, shot.view_layer]
        everything: list[Any] = [
            describe(hemicube, patterns, (shot.height, shot.width), **decides),
            vars(region),
            frame,
            *values(settings, Decides.CAPTURE_TILES).values(),
            key_of(found),
            VERSION,
            *values(settings, Decides.CAPTURE_KEPT).values(),
        ]
        if settings.keep != "always":
            everything += values(settings, Decides.CAPTURE_FIT).values()
        key = hashlib.sha256(json.dumps(everything, sort_keys=True).encode()).hexdigest()[:16]
        catchers = bool(seen.catchers)
        yield Asked(
            scene, view_layer, on, hemicube, region, grain, shot, found, key, decides, catchers,
            otherwise,
        )  # fmt: skip


def begun(
    this: Asked, folder: Path, given: Given | None, strips: int | None = None, takes: int = 1
) -> Steps:
    """Look at the scene and plan the capture -> (`Planned`, the description of its capture set,
    with no tile rendered yet).

    folder: where it will be; strips: into how many tiles the picture is cut (default: as the memory
    says); takes: see `planned`. Raises SceneError.
    """
    settings = this.scene.arto
    plan: Planned = yield from planned(
        this.scene, this.on, this.hemicube, this.region, this.grain, folder, given, strips, takes
    )
    about = {
        "scene": this.scene.name,
        "file": home.file(),
        "view_layer": this.view_layer,
        "shot": this.shot.to_json(),
        "frame": this.scene.frame_current,
        "fingerprint": this.found,
        "caution": plan.caution,
    }
    decides = this.decides | {
        "route": plan.route,
        "grain": plan.grain,
        "kept": plan.kept,
        "choice": settings.support,
        "separate": settings.separate,
    }
    size = (this.shot.height, this.shot.width)
    patterns = pattern_set(settings.patterns)
    head = describe(plan.hemicube, patterns, size, key=this.key, **decides, **about)
    head["seconds"] = 0.0
    head["tiles"] = [
        {"region": [t.x, t.y, t.width, t.height], "files": [], "done": False} for t in plan.tiles
    ]
    return plan, head
