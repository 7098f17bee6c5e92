"""The render settings that a capture changes on the stage, and why.

A capture needs light that adds up, so settings that bend the light are switched off. The changes
are made on the stage, a copy of the scene. The page docs/capture-changes.md is made of this table.
From it the panel also knows where the artist's own setting makes a render look otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from ...core.capture.kinds import Quality
from ..blender.nodes import dark_world
from ..blender.words import tr
from .stage import Stage


@dataclass(frozen=True)
class Change:
    """A setting that a capture changes.

    setting: the path from the scene; to: the value while capturing, or words for that value; why:
    the reason; look: the sentence of the panel where the artist's own value makes a render look
    otherwise than the relit picture, with `{}` for the artist's value.
    """

    setting: str
    to: object
    why: str
    look: str = ""


# Words for values that depend on the capture's settings.
SAMPLES, SEED, THROUGH = "the capture's samples", "the capture's seed", "as before, and the patches"
CHANGES = (
    Change("cycles.samples", SAMPLES, "its noise is the main error of the relit picture"),
    Change("cycles.seed", SEED, "all patterns share their paths"),
    Change("cycles.use_layer_samples", "IGNORE", "the capture's samples count"),
    Change("cycles.use_sample_subset", False, "the capture's samples count"),
    Change("cycles.time_limit", 0.0, "every pixel has the same samples"),
    Change("cycles.use_adaptive_sampling", False, "every pixel has the same samples"),
    Change("cycles.use_denoising", False, "light adds up; the relit picture is denoised"),
    Change(
        "cycles.sample_clamp_direct", 0.0, "a sum of clamped lights is not the clamped sum",
        "Your render clamps direct light at {}; the relit picture does not",
    ),
    Change(
        "cycles.sample_clamp_indirect", 0.0, "a sum of clamped lights is not the clamped sum",
        "Your render clamps at {}; the relit picture does not",
    ),
    Change(
        "cycles.use_fast_gi", False, "it puts the world's light in the place of bounces",
        "Your render uses Fast GI; the relit picture has all its bounces",
    ),
    Change("cycles.transparent_max_bounces", THROUGH, "a path crosses every pattern"),
    Change("cycles.min_transparent_bounces", THROUGH, "none ends by a coin between two patterns"),
    Change("render.film_transparent", True, "alpha is needed; the world behind is added after"),
    Change(
        "cycles.film_transparent_glass", False, "it would let the patches through as well",
        "Your render shows the film through glass; the relit picture shows the world",
    ),
)  # fmt: skip


def prepare(on: Stage, layers: int) -> None:
    """Make all changes of the table on the stage, and give it a black world.

    layers: how many patterns a path may cross, each of which counts as a transparent bounce.
    """
    s = on.scene.arto
    # and the shell before them, see `planes`
    through = on.scene.cycles.transparent_max_bounces + layers + 1
    words: dict[object, object] = {SAMPLES: samples_of(on.scene), SEED: s.seed, THROUGH: through}
    for change in CHANGES:
        on.change(change.setting, words.get(change.to, change.to))
    layer = on.scene.view_layers[0]
    layer.cycles.denoising_store_passes = True
    layer.use_pass_z = True
    on.keep_prepared()
    world = on.made(dark_world(on.scene.world, "ARTO Black"))
    on.changed["world"] = [on.scene.world.name if on.scene.world else None, None]
    on.scene.world = world
    layer.world_override = None


# By quality: the factor on a scene's own samples. Where a scene has a noise threshold, few pixels
# take all samples, so no more than MOST_ADAPTIVE count.
QUALITIES = {Quality.DRAFT: 0.25, Quality.GOOD: 1.0, Quality.FINAL: 4.0}
MOST_ADAPTIVE = 256


def samples_told(scene: bpy.types.Scene) -> bool:
    """Whether the samples were set and the quality was not.

    This is so in files from before the setting `quality`, and in scripts that set samples alone.
    """
    return scene.arto.is_property_set("samples") and not scene.arto.is_property_set("quality")


def samples_of(scene: bpy.types.Scene) -> int:
    """The samples of a capture, by the quality or the number that the artist chose."""
    s, cycles = scene.arto, scene.cycles
    if s.quality == Quality.CUSTOM or samples_told(scene):
        return s.samples
    own = min(cycles.samples, MOST_ADAPTIVE) if cycles.use_adaptive_sampling else cycles.samples
    return max(1, round(own * QUALITIES[Quality(s.quality)]))


def looks_otherwise(scene: bpy.types.Scene) -> list[str]:
    """Say by which of its settings the artist's render looks otherwise than the relit picture.

    A sentence for each such setting, in the language of the interface.
    """
    found = []
    for change in CHANGES:
        value = scene.path_resolve(change.setting)
        if change.look and value != change.to:
            shown = f"{value:g}" if isinstance(value, float) else value
            found.append(tr(change.look).format(shown))
    if scene.render.use_stamp:
        found.append(tr("Your render burns metadata into the picture; the relit picture does not"))
    if scene.render.use_sequencer and _has_strips(scene):
        found.append(tr("Your render shows the sequencer; the relit picture shows the scene"))
    return found


def _has_strips(scene: bpy.types.Scene) -> bool:
    editor = scene.sequence_editor
    return any(s.type != "SOUND" and not s.mute for s in (editor.strips_all if editor else ()))
