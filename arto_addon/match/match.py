"""Matching a shot to a picture: the work, in a job or in a batch.

The scene does not change: `apply` makes a look of what was found.
"""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path
from typing import Literal

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ...core.capture.kinds import Route
from ...core.errors import TargetError
from ...core.field.field import Field
from ...core.match import ask, gains
from ...core.match.answers import Answers
from ...core.match.discs import Discs
from ...core.match.match import Matched, free_light
from ...core.match.target import Target
from ...core.preview import Preview
from ..blender.colour import working_space
from ..plate.marks import PLATE
from ..plate.names import relit_file
from ..plate.plate import world_file
from ..relight import looks
from ..relight.outputs import check_beside
from ..relight.shown import Shown
from ..shot.shot import check_same_shot
from ..work import Progress, Steps, Warned, Wrote
from ..world import kept
from ..world.check import check_world
from ..world.disc_render import disc_light
from .asked import asked, masks, named_in
from .found import Found, match_file, write
from .lights import BASE, WORLD, lights_of, own_parts

Change = Literal["LIGHT", "GAINS", "TURN"]
# What a look that is made is called.
LOOK, EVEN = "Matched", "Even"


def match_target(scene: bpy.types.Scene, view_layer: str) -> Steps[Path]:
    """Find the light in which the shot looks like the settings' target.

    Returns the path of what was found, see `found`. Raises TargetError, SceneError, FieldError,
    KitError, and what opening the field and baking the world raise.
    """
    yield Progress(0.0, "reading the target")
    shown = _shown(scene, view_layer)
    wanted = asked(scene, shown.field.shape)
    if wanted.words:
        yield Warned(0.0, wanted.words)
    answers = yield from _answers(shown)
    keep = answers.columns(wanted.keep)
    weights = answers.columns(wanted.mask)
    picture = answers.columns(wanted.picture)
    if keep.any():
        now = yield from _now(scene, view_layer, answers)
        share = np.clip(keep, 0, 1)[:, None]
        picture = picture * (1 - share) + now * share
        weights = np.maximum(weights, keep)
    target = Target(picture, weights * answers.solid * answers.sizes)
    return (yield from _matched(shown, answers, target, LOOK, wanted.words))


def even_out(scene: bpy.types.Scene, view_layer: str) -> Steps[Path]:
    """Find the light that makes the region of the settings' mask even.

    Returns the path of what was found. Raises what `match_target` raises.
    """
    if scene.arto.match_mask is None:
        raise TargetError("there is no region to make even: choose a mask that is white there")
    shown = _shown(scene, view_layer)
    region, keep = masks(scene, shown.field.shape)
    answers = yield from _answers(shown)
    now = yield from _now(scene, view_layer, answers)
    albedo = np.ones_like(now)
    if answers.small.has_layer("albedo") and answers.fine.has_layer("albedo"):
        albedo = answers.layer("albedo")
    counts = answers.solid * answers.sizes
    target = ask.evened(
        now, albedo, answers.columns(region) * counts, answers.columns(keep) * counts
    )
    before = ask.unevenness(now, albedo, answers.columns(region) * counts)
    words = f"the light on the region varied by {before:.0%}"
    return (yield from _matched(shown, answers, target, EVEN, words, asked_scale=False))


def _shown(scene: bpy.types.Scene, layer: str) -> Shown:
    check_world(scene, layer)
    scene.view_layers[layer].update()
    shown = Shown(scene, layer)
    check_same_shot(scene, shown.field.about.shot, "the reflectance field", layer)
    return shown


def _answers(shown: Shown) -> Steps[Answers]:
    yield Progress(0.05, "bringing the field to a matrix")
    return Answers.of(Preview([take.field for take in shown.takes]))


def _now(scene: bpy.types.Scene, layer: str, answers: Answers) -> Steps[NDArray[np.float64]]:
    """The picture in the present light, at the pixels of the matrix."""
    yield Progress(0.2, "bringing the world to an environment map")
    environment = kept.environment(scene, scene.arto.environment_width, layer)
    lamps = own_parts(scene, answers)
    return sum(lamps.values(), answers.under(environment))


def _matched(
    shown: Shown,
    answers: Answers,
    target: Target,
    name: str,
    words: str,
    asked_scale: bool = True,
) -> Steps[Path]:
    """Find the light of a target and write it -> the path of what was found."""
    scene, layer, field = shown.scene, shown.layer, shown.takes[-1].field
    settings = scene.arto
    world = check_world(scene, layer)
    look = looks.free_name(scene, name)
    plate = relit_file(scene)
    exposure = settings.match_exposure and asked_scale
    balance = settings.match_balance and asked_scale
    change: Change = settings.match_change
    yield Progress(0.2, "working out the lights")
    check_beside(scene, match_file(plate), plate, named_in(scene))
    world_path = ""
    if change == "LIGHT":
        lit = world_file(relit_file(scene, look))
        check_beside(scene, lit, relit_file(scene, look), named_in(scene))
        present = kept.environment(scene, settings.environment_width, layer, world)
        own = sum(own_parts(scene, answers).values(), np.zeros_like(target.picture))
        lamps = can_render(scene, field)
        wish = settings.match_near, exposure, balance
        work = free_light(answers, present, target, own, *wish, lamps=lamps)
        done = yield from steps(work, scene, field, answers)
        assert done.environment is not None
        about = {PLATE: relit_file(scene, look).name}
        exr.write(lit, {"": done.environment.image}, about, working_space())
        yield Wrote(0.95, f"wrote {lit}", lit)
        world_path = str(lit)
    else:
        lights = lights_of(scene, layer, world, answers, settings.match_own)
        wish = gains.Wish(
            settings.match_near, settings.match_colours, exposure, balance, lights.grey
        )
        parts = dict(lights.parts)
        base = BASE if BASE in parts else WORLD
        if change == "TURN":
            if base not in parts:
                raise TargetError(
                    "the world has no base that could be turned: give the kit an HDRI as its base"
                )
            # the kit's lights stay as they are
            lamps = {n: p for n, p in parts.items() if n in lights.grey and n != base}
            others = [p for n, p in parts.items() if n != base and n not in lamps]
            fixed = sum(others, lights.fixed)
            work = gains.turned(answers, lights.base, lamps, fixed, target, wish, base)
            done = yield from steps(work, scene, field, answers)
        elif not parts:
            raise TargetError("no light can change: every light of the kit is locked or a flag")
        else:
            done = gains.gains(answers, parts, lights.fixed, target, wish)
    found = Found(
        change,
        done.error,
        done.before,
        said(done, words),
        look,
        world_path,
        {n: [float(x) for x in g] for n, g in done.gains.items()},
        done.turn,
        tuple(float(x) for x in done.scale),
    )
    path = write(scene, plate, found, done.missing.difference)
    if done.missing.told:
        yield Warned(0.98, done.missing.words)
    yield Progress(1.0, found.words)
    return path


def steps(
    work: Generator[float | Discs, NDArray | None, Matched],
    scene: bpy.types.Scene,
    field: Field,
    answers: Answers,
) -> Steps[Matched]:
    """Do the work of the core, tell how far it is, and render the discs that it asks for."""
    share, pictures = 0.0, None
    while True:
        try:
            asked = work.send(pictures)
        except StopIteration as e:
            return e.value
        pictures = None
        if isinstance(asked, Discs):
            factor = answers.factors[1]
            light = yield from disc_light(scene, field, asked, factor, 0.25 + 0.7 * share)
            pictures = np.array([[answers.columns(one) for one in half] for half in light])
        else:
            share = asked
            yield Progress(0.25 + 0.7 * share, "looking for the light")


def can_render(scene: bpy.types.Scene, field: Field) -> bool:
    """Whether lamps can be rendered by themselves, as the plate of a match has them."""
    about = field.about
    if about.route == Route.PHOTOGRAPHS or not scene.arto.lamps:
        return False
    return about.far is not False and about.view_layer is not None


def said(done: Matched, words: str = "") -> str:
    """Say in sentences how near a match came, and what no light makes."""
    text = f"off by {done.error:.3f} of its light in the mean; it was {done.before:.3f}"
    if not np.allclose(done.scale, 1, rtol=0.01):
        stops = np.log2(np.maximum(done.scale.mean(), 1e-9))
        text += f"; the target was taken {stops:+.2f} stops"
        if np.ptp(done.scale) > 0.01 * done.scale.mean():
            r, g, b = done.scale / done.scale.mean()
            text += f", its colours times {r:.2f}, {g:.2f}, {b:.2f}"
    for more in (done.missing.words, words):
        text += f". {more[:1].upper()}{more[1:]}" if more else ""
    return text
