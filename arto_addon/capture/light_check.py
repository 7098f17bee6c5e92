"""A check of the light before the long render: do the patches light the scene as a world does?

A small picture is rendered under all patches, and twice in a plain white world. Some settings of a
scene and some tricks in materials let a world's light in and keep the patches' light out. They show
as a difference between the pictures, whether this module knows of them or not.
"""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.capture.agreement import DIFFERENT, SUSPECTED, Agreement, Caution, agreement
from ...core.capture.names import combined
from ...core.hemicube import Hemicube
from ...core.light.environment import Environment, directions, sample_directions
from ...core.patterns import pattern_set
from ..blender.nodes import shader_tree, trees
from ..stage.small import parts_of, small
from ..stage.stage import Stage
from ..work import Steps, Warned
from ..world.lamp_render import world_showing
from . import planes

SAMPLES = 48
# Rows of the white world's map, which is black where the hemicube has no patch.
HEIGHT = 256


def check_light(on: Stage, hemicube: Hemicube) -> Steps[tuple[bool, Caution | None]]:
    """Compare the light of the prepared stage's patches with a white world's.

    -> (whether the patches must be sampled, a `Caution` or None). Some light reaches the picture by
    shadow rays alone. Patches must then be sampled: Cycles casts shadow rays at them. The caution
    says what this costs. The stage is left as it was. Raises CancelledError.
    """
    seed = on.scene.cycles.seed
    black, through = on.scene.world, on.scene.cycles.transparent_max_bounces
    with small(on, SAMPLES):
        own = combined((yield from parts_of(on, "looking at the scene's own light")))[..., :3]
        found = yield from _of_patches(on, hemicube, own, sampled=False)
        expected = []
        try:
            on.scene.world = _white(on, hemicube)
            # light passes as many transparent surfaces as in the artist's render
            asked = on.changed.get("cycles.transparent_max_bounces", [through])[0]
            on.scene.cycles.transparent_max_bounces = asked
            for i in (1, 2):
                on.scene.cycles.seed = seed + i
                parts = yield from parts_of(on, "looking at the light of a white world")
                expected.append(combined(parts)[..., :3])
        finally:
            on.scene.world = black
            on.scene.cycles.seed = seed
            on.scene.cycles.transparent_max_bounces = through
        truth = np.stack(expected)
        tricked = _tricks_shadows()
        different = SUSPECTED if tricked else DIFFERENT
        seen = agreement(found, truth, own, different)
        sampled, text = False, ""
        if not seen.agrees and (seen.worst < 1 or tricked):
            found = yield from _of_patches(on, hemicube, own, sampled=True)
            again = agreement(found, truth, own, different)
            sampled = abs(again.ratio - 1) < abs(seen.ratio - 1)
            if sampled and again.agrees:
                text = f"{_cause(on)}: it takes a render for each pattern, in which it is right"
            seen = again if sampled else seen
    text = text or _words(on, seen)
    if not text:
        return False, None
    yield Warned(0.0, f"CAUTION: {text}")
    return sampled, Caution(text, seen.ratio, seen.worst, seen.share, seen.dark)


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


def _white(on: Stage, hemicube: Hemicube) -> bpy.types.World:
    """A white world, black in directions where no patch is.

    The world shows a map, though it has one colour: Cycles does not sample an even colour as a
    light, so that such a world would have the same faults as the patches.
    """
    azimuth, latitude, _ = sample_directions(HEIGHT, 2 * HEIGHT, 1)
    there = hemicube.locate(directions(azimuth, latitude))[0] >= 0
    return world_showing(
        on, Environment(np.repeat(there[..., None], 3, axis=-1).astype(np.float32))
    )


def _words(on: Stage, seen: Agreement) -> str:
    """Say to an artist what is wrong and what the cause may be; empty where nothing is wrong."""
    if seen.dark and seen.agrees:
        return (
            "no light from outside reaches the picture: every world will look the same. Is the "
            "scene inside a closed room or a dome? Hide it from the render, or let light in"
        )
    if seen.agrees:
        return ""
    least = f"{seen.worst:.0%} of a world's light reaches {seen.share:.0%} of the picture"
    return (
        f"only {least} in this capture: {_cause(on)}"
        if seen.worst < 1
        else (
            f"{seen.worst:.0%} of a world's light is on {seen.share:.0%} of the picture in this "
            f"capture: {_cause(on)}"
        )
    )


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
            if slot.material and _asks_for_shadow_rays(slot.material):
                return (
                    f"the material '{slot.material.name}' lets shadow rays through (Light Path), "
                    "and only a world's light comes that way"
                )
    return "a material or a setting treats a world's light otherwise than light from surfaces"


def _asks_for_shadow_rays(material: bpy.types.Material) -> bool:
    return any(
        node.bl_idname == "ShaderNodeLightPath" and node.outputs["Is Shadow Ray"].is_linked
        for tree in trees(shader_tree(material), set())
        for node in tree.nodes
    )
