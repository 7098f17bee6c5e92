"""The world's suns and lamps, rendered by themselves: sharp, and quick.

Cycles finds lamps well, which is why few samples are enough for them, and badly when they hide in a
patch, which is why the field is better off without them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.errors import FieldError, SceneError
from ...core.field.field import Field
from ...core.light.environment import Environment
from ..blender.colour import working_space
from ..blender.nodes import new_world
from ..stage.bounds import rendered
from ..stage.settings import prepare
from ..stage.small import parts_of, small
from ..stage.stage import Stage, free_mark, set_region, stage
from ..stage.takes import WHOLE, take
from ..work import Steps


def world_showing(on: Stage, shown: Environment, group: str = "") -> bpy.types.World:
    """A world that shows a map, in a light group of its own where one is named."""
    height, width = shown.image.shape[:2]
    image = on.made(
        bpy.data.images.new("ARTO Lamps", width, height, alpha=False, float_buffer=True)
    )
    image.colorspace_settings.name = working_space()
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :3] = shown.image[::-1]
    image.pixels.foreach_set(rgba.ravel())
    image.update()
    world = on.made(new_world("ARTO Lamps"))
    nodes = world.node_tree.nodes
    texture = nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    world.node_tree.links.new(texture.outputs["Color"], nodes["Background"].inputs["Color"])
    if shown.turn:
        mapping = nodes.new("ShaderNodeMapping")
        mapping.inputs["Rotation"].default_value = (0, 0, shown.turn)
        direction = nodes.new("ShaderNodeTexCoord").outputs["Generated"]
        world.node_tree.links.new(direction, mapping.inputs["Vector"])
        world.node_tree.links.new(mapping.outputs[0], texture.inputs["Vector"])
    world.lightgroup = group
    # left to itself, Cycles takes a second for a map of 4096; twice as fine as the light finds the
    # rims of its texels, which are blended
    world.cycles.sampling_method = "MANUAL"
    world.cycles.sample_map_resolution = 2 * width
    return world


# Fewer samples of the lamps than this have no time to smooth an edge.
LEAST_SAMPLES = 4


def lamp_samples(scene: bpy.types.Scene, share: float) -> int:
    """Samples of the render of lamps that have this share of the light."""
    return max(LEAST_SAMPLES, math.ceil(scene.arto.lamp_samples * share))


def lamp_light(
    scene: bpy.types.Scene, field: Field, lamps: Environment, samples: int, share: float = 0.0
) -> Steps:
    """Render what `lamps` bring to the picture of a field -> (H, W, 3), scene-linear.

    Zero outside the field's tiles; share: how far the whole work is. Raises SceneError,
    CancelledError; the scene stays as it is.
    """
    region = field.region
    out: NDArray[np.float32] = np.zeros((*field.shape, 3), np.float32)
    with _lit_by(scene, field, lamps) as (on, group):
        on.change("cycles.samples", samples)
        parts = yield from parts_of(on, "rendering the world's lamps", share)
        out[region.slices] = _light_in(parts, group)
    return out


# Samples of the small picture that a field's brightness is held against.
HELD_SAMPLES = 96


def brightness(scene: bpy.types.Scene, field: Field, light: Environment, share: float) -> Steps:
    """Render, small, what a map brings to the picture of a field -> (3,), its mean radiance.

    Raises SceneError, CancelledError; the scene stays as it is.
    """
    with _lit_by(scene, field, light) as (on, group), small(on, HELD_SAMPLES):
        parts = yield from parts_of(on, "looking how bright the world's light is", share)
        return _light_in(parts, group).mean(axis=(0, 1), dtype=np.float64)


@contextmanager
def _lit_by(
    scene: bpy.types.Scene, field: Field, shown: Environment
) -> Iterator[tuple[Stage, str]]:
    """A stage of a field's picture with a map as its world, and the light group of that."""
    with ExitStack() as held:
        about = field.about
        if about.view_layer is None:
            raise FieldError(
                f"{field.folder} does not say of which view layer it is: capture again"
            )
        on = held.enter_context(stage(scene, about.view_layer))
        if about.catchers:
            held.enter_context(take(rendered(on), about.take or WHOLE))
        # whatever the artist looks at meanwhile: the field is Cycles'
        on.change("render.engine", "CYCLES")
        prepare(on, layers=0)
        # a render like any of the artist's: what tames its fireflies does no harm to a field
        for name in ("sample_clamp_direct", "sample_clamp_indirect"):
            on.change(f"cycles.{name}", getattr(scene.cycles, name))
        group = free_mark() + "lamps"
        on.scene.world = world_showing(on, shown, group)
        on.scene.view_layers[0].lightgroups.add(name=group)
        set_region(on.scene, field.region)
        yield on, group


def _light_in(parts: dict[str, NDArray], group: str) -> NDArray[np.float32]:
    """The light of a group in a render's parts, (H, W, 3). Raises SceneError."""
    light = next((p for name, p in parts.items() if name.endswith(group)), None)
    if light is None:
        raise SceneError(
            "Blender wrote no light of the world's lamps: turn Render Lamps off to relight "
            "without them"
        )
    if bad := int((~np.isfinite(light[..., :3])).any(axis=-1).sum()):
        raise SceneError(
            f"the light of the world's lamps has {bad} pixels that are infinite or not a "
            "number: find the material there, or turn Render Lamps off"
        )
    return light[..., :3]
