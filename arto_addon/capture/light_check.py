"""A check of the light before the long render: do the patches light the scene as a world does?

A small picture is rendered under all patches, and twice in a plain white world (`look`). Some
settings of a scene and some tricks in materials let a world's light in and keep the patches' light
out. They show as a difference between the pictures, whether this module knows of them or not.
"""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.capture.agreement import DIFFERENT, SUSPECTED, Agreement, Caution, agreement
from ...core.capture.names import combined
from ...core.hemicube import Hemicube
from ...core.patterns import pattern_set
from ..blender.reached import gives, reached
from ..stage.small import parts_of, small
from ..stage.stage import Stage
from ..work import Steps, Warned
from . import planes
from .look import Looked, own_bounces, white_world

SAMPLES = 48


def check_light(
    on: Stage, hemicube: Hemicube, looked: Looked | None = None
) -> Steps[tuple[bool, Caution | None]]:
    """Compare the light of the prepared stage's patches with a white world's.

    -> (whether the patches must be sampled, a `Caution` or None). Some light reaches the picture by
    shadow rays alone. Patches must then be sampled: Cycles casts shadow rays at them. The caution
    says what this costs. looked: pictures of the stage, where there are some. The stage is left as
    it was. Raises CancelledError.
    """
    with small(on, SAMPLES):
        if looked:
            own, found, truth = looked.own, looked.patches, looked.white
        else:
            own = combined((yield from parts_of(on, "looking at the scene's own light")))[..., :3]
            found = yield from _of_patches(on, hemicube, own, sampled=False)
            # light passes as many transparent surfaces as in the artist's render
            truth = yield from _whites(on, hemicube, own_bounces(on), "a white world")
        tricked = _tricks_shadows()
        different = SUSPECTED if tricked else DIFFERENT
        white = on.scene.cycles.film_exposure
        seen = agreement(found, truth, own, different, white)
        sampled, text = False, ""
        if not seen.agrees and (seen.worst < 1 or tricked):
            found = yield from _of_patches(on, hemicube, own, sampled=True)
            again = agreement(found, truth, own, different, white)
            sampled = abs(again.ratio - 1) < abs(seen.ratio - 1)
            if sampled and again.agrees:
                text = f"{_cause(on)}: it takes a render for each pattern, in which it is right"
            seen = again if sampled else seen
        if not seen.agrees and not text:
            deep = yield from _through_more(on, hemicube, found, own)
            text = _words(on, seen, deep)
    text = text or _words(on, seen)
    if not text:
        return False, None
    yield Warned(0.0, f"CAUTION: {text}")
    return sampled, Caution(text, seen.ratio, seen.worst, seen.share, seen.dark)


def _whites(on: Stage, hemicube: Hemicube, bounces: int, what: str) -> Steps[NDArray]:
    """Render the stage in a white world, with two seeds -> (2, H, W, 3).

    bounces: how many transparent surfaces light passes; what: is looked at, in words.
    """
    scene, found = on.scene, []
    black, seed, through = scene.world, scene.cycles.seed, scene.cycles.transparent_max_bounces
    try:
        scene.world = white_world(on, hemicube)
        scene.cycles.transparent_max_bounces = bounces
        for i in (1, 2):
            scene.cycles.seed = seed + i
            parts = yield from parts_of(on, f"looking at the light of {what}")
            found.append(combined(parts)[..., :3])
    finally:
        scene.world = black
        scene.cycles.seed = seed
        scene.cycles.transparent_max_bounces = through
    return np.stack(found)


def _of_patches(on: Stage, hemicube: Hemicube, own: np.ndarray, sampled: bool) -> Steps[NDArray]:
    """Render the picture in the light of all patches and the scene's own lights, (H, W, 3)."""
    total = own
    images = [(k, "white") for k in range(len(hemicube))]
    most = planes.MOST_SAMPLED if sampled else len(images)
    for start in range(0, len(images), most):
        some = images[start : start + most]
        with planes.lit(on, hemicube, pattern_set("white"), some, sampled):
            parts = yield from parts_of(on, "looking at the light of the patches")
        total = total + (combined(parts)[..., :3] - own)
    return total


def _through_more(on: Stage, hemicube: Hemicube, found: np.ndarray, own: np.ndarray) -> Steps[bool]:
    """Find out whether the scene's own limit of transparent bounces makes the difference -> bool.

    The patches' light passes more surfaces than that limit, as the patches are transparent too. So
    a white world is rendered once more without the limit.
    """
    through = on.scene.cycles.transparent_max_bounces
    more = yield from _whites(on, hemicube, through, "a white world through more surfaces")
    return agreement(found, more, own, white=on.scene.cycles.film_exposure).agrees


def _words(on: Stage, seen: Agreement, deep: bool = False) -> str:
    """Say to an artist what is wrong and what the cause may be; empty where nothing is wrong.

    deep: see `_through_more`.
    """
    if seen.dark and seen.agrees:
        return (
            "no light from outside reaches the picture: every world will look the same. Is the "
            "scene inside a closed room or a dome? Hide it from the render, or let light in"
        )
    if seen.agrees:
        return ""
    cause = _cause(on)
    if deep:
        most = on.changed["cycles.transparent_max_bounces"][0]
        cause = (
            f"light passes more than {most} transparent surfaces, as leaves or smoke behind each "
            "other, where your render ends: raise Transparent (Render properties, Light Paths, Max "
            "Bounces) until your render does not change any more"
        )
    light = f"{seen.worst:.0%} of a world's light"
    where = f"{seen.share:.0%} of the picture"
    if seen.worst < 1:
        return f"only {light} reaches {where} in this capture: {cause}"
    return f"{light} is on {where} in this capture: {cause}"


def _tricks_shadows() -> bool:
    """Whether an object in the file is visible to shadow rays and not to others, or vice versa.

    If so, the stricter threshold is used. The difference that such an object makes is soft, as a
    shadow that is a tenth too dark on all of a ground, and could be taken for noise.
    """
    return any(
        thing.type not in {"LIGHT", "CAMERA", "EMPTY"}
        and not thing.hide_render
        and planes.PATTERN not in thing
        and thing.visible_shadow != thing.visible_diffuse
        for thing in bpy.data.objects
    )


def _cause(on: Stage) -> str:
    """The likeliest cause, judged by what the scene contains."""
    layer = on.scene.view_layers[0]
    if layer.material_override:
        return "the view layer overrides all materials"
    if getattr(layer, "world_override", None):
        return "the view layer has a world of its own"
    for thing in on.scene.objects:
        if thing.hide_render or thing.type in {"LIGHT", "CAMERA", "EMPTY"}:
            continue
        if not thing.visible_shadow:
            return f"'{thing.name}' throws no shadow, and what a world lights through it is dark"
        if not thing.visible_diffuse:
            return f"'{thing.name}' is hidden from diffuse rays, and its shadow is not a world's"
        for slot in thing.material_slots:
            if slot.material and (why := _cause_in(slot.material)):
                return why
    return "a material or a setting treats a world's light otherwise than light from surfaces"


# Nodes that look around from a point, and the socket that says how far. Ambient Occlusion looks
# around too, and agrees: it was tried to a distance beyond the patches.
_LOOKING = {"ShaderNodeRaycast": "Length"}


def _cause_in(material: bpy.types.Material) -> str:
    """Why a material is lit by patches otherwise than by a world; empty where none is known."""
    for node in reached(material):
        if node.bl_idname == "ShaderNodeLightPath" and "Is Shadow Ray" in gives(node):
            return (
                f"the material '{material.name}' lets shadow rays through (Light Path), and only a "
                "world's light comes that way"
            )
        if node.bl_idname in _LOOKING:
            socket = _LOOKING[node.bl_idname]
            return (
                f"the material '{material.name}' looks around (node {node.bl_label}), and finds "
                f"the patches far outside where a world has nothing: give the node a {socket} that "
                "ends within the scene"
            )
    return ""
