"""What is asked of a capture, and the head that its capture set begins with.

The artist's settings, the scene as it is now, and what decides whether two captures are the same.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import bpy

from ...core.capture.head import VERSION, CaptureHead
from ...core.capture.kinds import Keep, Route, Take
from ...core.capture.tile_entry import TileEntry
from ...core.errors import SceneError
from ...core.hemicube import Hemicube
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
from ..work import Steps, Warned
from . import planes
from .behind import portals_seen, see_behind
from .looked import key_of_look, looked_before, noted
from .patterns import patterns_of
from .planned import Given, Planned, planned


def geometry(scene: bpy.types.Scene, seen: Rendered) -> Hemicube:
    """The hemicube to capture with: the artist's, if built in the scene, else a new hemicube."""
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


def key_of_settings(scene: bpy.types.Scene) -> str:
    """A digest of the settings that decide a capture, quickly: the scene is not looked at."""
    settings = scene.arto
    kinds = [Decides.CAPTURE, Decides.CAPTURE_TILES, Decides.CAPTURE_KEPT]
    kinds += [Decides.CAPTURE_FIT] if settings.keep != Keep.ALWAYS else []
    hemicube = planes.wanted(scene, (0.0, 0.0, 0.0), 1.0).to_json()
    of = [values(settings, kind) for kind in kinds]
    of += [samples_of(scene), settings.patterns, settings.route, settings.grain, hemicube, VERSION]
    return hashlib.sha256(json.dumps(of, sort_keys=True).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Asked:
    """A capture that was asked for, on its stage.

    hemicube: before it is refined; key: two captures have the same key only if all that decides
    their pictures is the same; head: the head before any probe; catchers: whether there are shadow
    catchers, see `takes`; otherwise: the objects that the take shows in another way than the
    artist's scene does.
    """

    scene: bpy.types.Scene
    view_layer: str
    on: Stage
    hemicube: Hemicube
    region: Region
    grain: bool
    shot: Shot
    found: dict[str, str]
    key: str
    head: CaptureHead
    catchers: bool
    otherwise: list[bpy.types.Object]

    def named(self, head: CaptureHead) -> CaptureHead:
        """A head that says what is captured."""
        return replace(
            head,
            key=self.key,
            scene=self.scene.name,
            file=home.file(),
            view_layer=self.view_layer,
            shot=self.shot,
            frame=self.scene.frame_current,
            fingerprint=self.found,
        )


@contextmanager
def asked(
    scene: bpy.types.Scene, view_layer: str, given: Given | None = None, name: Take = WHOLE
) -> Iterator[Asked]:
    """Set the stage for a capture. given: see `Given`; name: the take. Raises SceneError."""
    settings = scene.arto
    region = picture_region(scene)
    found = fingerprint(scene, view_layer, full=True)
    with ExitStack() as held:
        on = held.enter_context(stage(scene, view_layer))
        seen = rendered(on)
        otherwise = held.enter_context(take(seen, name))
        hemicube = given.hemicube if given else geometry(scene, seen)
        # other routes need several renders, whose paths differ: no grain belongs to all
        patterns = patterns_of(settings, given.route if given else None)
        # packed patterns have theirs
        grain = settings.grain and settings.route == Route.ALL and patterns.grey
        prepare(on, layers=len(patterns) + grain)
        # the other takes need light alone, and each pass less saves memory
        on.scene.view_layers[0].use_pass_position = name == WHOLE
        on.portals = portals_seen(on, seen)
        if name == WHOLE:
            see_behind(on)
        if name == THINGS:
            only_things(on.scene.view_layers[0])
        shot = shot_of(scene, view_layer, region)
        head = CaptureHead(
            hemicube=hemicube,
            patterns=patterns,
            height=shot.height,
            width=shot.width,
            samples=samples_of(scene),
            blender=bpy.app.version_string,
            colour_space=working_space(),
            film_transparent=scene.render.film_transparent,
            portals=on.portals,
            changed=dict(on.changed),
            catchers=tuple(sorted(set(seen.catchers))) if seen.catchers else None,
            take=name if seen.catchers else None,
            **(
                values(settings, Decides.CAPTURE) | {"route": Route(settings.route), "grain": grain}
            ),
        )
        # the key holds no names: a renamed file or scene goes on with its unfinished capture
        frame = [shot.camera_matrix, shot.lens, shot.frame, shot.subframe, shot.view_layer]
        everything: list[object] = [
            head.to_json(),
            vars(region),
            frame,
            *values(settings, Decides.CAPTURE_TILES).values(),
            key_of(found),
            VERSION,
            *values(settings, Decides.CAPTURE_KEPT).values(),
        ]
        if settings.keep != Keep.ALWAYS:
            everything += values(settings, Decides.CAPTURE_FIT).values()
        key = hashlib.sha256(json.dumps(everything, sort_keys=True).encode()).hexdigest()[:16]
        # it follows from what the key holds already
        head = replace(head, behind=True if name == WHOLE else None)
        catchers = bool(seen.catchers)
        yield Asked(
            scene, view_layer, on, hemicube, region, grain, shot, found, key, head, catchers,
            otherwise,
        )  # fmt: skip


def begun(
    this: Asked,
    folder: Path,
    given: Given | None,
    strips: int | None = None,
    takes: int = 1,
    often: bool = False,
    place: Path | None = None,
) -> Steps[tuple[Planned, CaptureHead]]:
    """Look at the scene and plan the capture -> (`Planned`, the head of its capture set).

    The head has no rendered tile yet.

    folder: where the set will be; strips: the number of tiles of the picture (default: as many as
    memory makes necessary); takes, often: see `planned`; place: a folder with earlier captures of
    this shot, which may have looked at the very same scene. Raises SceneError.
    """
    settings, hemicube = this.scene.arto, this.hemicube
    look, others = "", dict[str, object]()
    if given is None:
        look = key_of_look(this.head, this.hemicube, this.shot, this.found)
        on_cpu = this.scene.cycles.device == "CPU"
        given = looked_before(place, look, on_cpu) if place else None
        if given:
            hemicube = given.hemicube
        if given and given.caution:
            yield Warned(0.0, f"CAUTION: {given.caution.text}")
    plan = yield from planned(
        this.scene,
        this.on,
        hemicube,
        this.region,
        this.grain,
        folder,
        given,
        strips,
        takes,
        often,
    )
    if look:
        others = noted(look, this.on.pace or (given.pace if given else None))
    head = replace(
        this.named(this.head),
        hemicube=plan.hemicube,
        tiles=tuple(TileEntry(region) for region in plan.tiles),
        patterns=plan.patterns,
        asked=key_of_settings(this.scene),
        route=plan.route,
        # of sampled lights Cycles leaves out the faint ones
        radiance=None if plan.route == Route.SAMPLED else planes.FAINT,
        grain=plan.grain,
        kept=plan.kept,
        choice=settings.support,
        separate=settings.separate,
        caution=plan.caution,
        seconds=0.0,
        others=others,
    )
    return plan, head
