"""Render the world's suns and lamps by themselves, which is sharp and quick.

Cycles finds small lamps in a world well, so few samples are enough. In a capture, a lamp is a small
part of a patch, which Cycles finds badly. So the field does not show the lamps' light.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ...core.capture.names import is_combined
from ...core.errors import FieldError, SceneError
from ...core.field.field import Field
from ...core.light.environment import Environment
from ..blender.colour import working_space
from ..blender.front import set_on_world
from ..blender.nodes import dark_world
from ..stage.bounds import rendered
from ..stage.settings import prepare
from ..stage.small import parts_of, small
from ..stage.stage import Stage, free_mark, set_region, stage
from ..stage.takes import WHOLE, take
from ..work import Steps


def world_showing(on: Stage, shown: Environment, group: str = "") -> bpy.types.World:
    """Make a world that shows a map. group: the world's light group, or "" for none."""
    return Sky(on, shown, group, shown.turn != 0).world


class Sky:
    """A world that shows a map, and can be told to show another one, or the same from elsewhere."""

    def __init__(
        self,
        on: Stage,
        shown: Environment,
        group: str = "",
        turns: bool = True,
        file: Path | None = None,
    ) -> None:
        """Make the world.

        group: its light group, or "" for none; turns: whether it can turn; file: where the map is
        written, so that another one can be shown; None where the map stays in memory.
        """
        width = shown.image.shape[1]
        self._image = image = on.made(_image_of(shown) if file is None else _saved(shown, file))
        self.world = world = on.made(dark_world(on.scene.world, "ARTO Lamps"))
        nodes = world.node_tree.nodes
        texture = nodes.new("ShaderNodeTexEnvironment")
        texture.image = image
        light, out = nodes.new("ShaderNodeBackground"), nodes.new("ShaderNodeOutputWorld")
        world.node_tree.links.new(texture.outputs["Color"], light.inputs["Color"])
        world.node_tree.links.new(light.outputs[0], out.inputs["Surface"])
        self._mapping = None
        if turns:
            self._mapping = mapping = nodes.new("ShaderNodeMapping")
            direction = nodes.new("ShaderNodeTexCoord").outputs["Generated"]
            world.node_tree.links.new(direction, mapping.inputs["Vector"])
            world.node_tree.links.new(mapping.outputs[0], texture.inputs["Vector"])
            self.turn(shown.turn)
        world.lightgroup = group
        # Cycles' automatic choice takes a second for a map of 4096. A sampling map twice as fine as
        # the light also finds the blended rims of the light's texels.
        sampled = {"sampling_method": "MANUAL", "sample_map_resolution": 2 * width}
        set_on_world(world, on.scene, max_bounces=1024, **sampled)

    def turn(self, angle: float) -> None:
        """Turn the world, which must be one that turns, to an angle in radians."""
        assert self._mapping is not None
        self._mapping.inputs["Rotation"].default_value = (0, 0, angle)

    def show(self, shown: Environment, path: Path) -> None:
        """Show another map, from a file that is written: its path must be another each time.

        The scene that Cycles has prepared stays as it is. Another image, as a data-block, would
        have Cycles read all objects again. Other pixels in the same file would not be seen.
        """
        exr.write(path, {"": np.ascontiguousarray(shown.image)})
        self._image.filepath = str(path)
        self.turn(shown.turn)


def _image_of(shown: Environment) -> bpy.types.Image:
    """An image of a map, in memory."""
    height, width = shown.image.shape[:2]
    image = bpy.data.images.new("ARTO Lamps", width, height, alpha=False, float_buffer=True)
    image.colorspace_settings.name = working_space()
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :3] = shown.image[::-1]
    image.pixels.foreach_set(rgba.ravel())
    image.update()
    return image


def _saved(shown: Environment, file: Path) -> bpy.types.Image:
    """An image of a map, in a file."""
    exr.write(file, {"": np.ascontiguousarray(shown.image)})
    image = bpy.data.images.load(str(file))
    image.colorspace_settings.name = working_space()
    return image


# The least samples of the lamps: fewer leave edges rough.
LEAST_SAMPLES = 4
# Where the artist gives no number, lamps that have all the light get this part of the capture's
# samples, and no fewer than FEW_SAMPLES. Else a finer capture would not make such a plate cleaner.
OF_CAPTURE, FEW_SAMPLES = 0.25, 32


def lamp_samples(scene: bpy.types.Scene, share: float, captured: float | None) -> int:
    """How many samples lamps get that have this share of the world's light, 0 to 1.

    captured: the samples of a pixel of the capture; None where they are not known.
    """
    told = scene.arto.lamp_samples
    whole = told or max(FEW_SAMPLES, OF_CAPTURE * (captured or 0))
    return max(LEAST_SAMPLES, math.ceil(whole * share))


def lamp_light(
    scene: bpy.types.Scene, field: Field, lamps: Environment, samples: int, share: float = 0.0
) -> Steps[NDArray[np.float32]]:
    """Render the light of `lamps` on the picture of a field -> (H, W, 3), scene-linear.

    The light is 0 outside the field's region. share: how much of the whole work was done before,
    0 to 1. The artist's scene is not changed. Raises SceneError, CancelledError.
    """
    region = field.region
    out: NDArray[np.float32] = np.zeros((*field.shape, 3), np.float32)
    with lit_by(scene, field) as (on, group):
        on.scene.world = world_showing(on, lamps, group)
        on.change("cycles.samples", samples)
        parts = yield from parts_of(on, "rendering the world's lamps", share)
        light = light_in(parts, group)
        # At an outline a few paths hit what no path of the capture hit: light without alpha, which
        # stands beside the thing in a composite. Where neither has alpha the light is a volume's.
        whole = next((p for name, p in parts.items() if is_combined(name)), None)
        if whole is not None and whole.shape[-1] == 4:
            missed = field.layer("alpha")[region.slices] == 0
            light = np.where((missed & (whole[..., 3] > 0))[..., None], np.float32(0), light)
        out[region.slices] = light
    return out


# Samples of the small picture with which a field's brightness is compared.
HELD_SAMPLES = 96


def brightness(
    scene: bpy.types.Scene, field: Field, light: Environment, share: float
) -> Steps[NDArray[np.float64]]:
    """Render a field's picture in the light of a map, small -> (3,), the mean radiance.

    share: how much of the whole work was done before, 0 to 1. The artist's scene is not changed.
    Raises SceneError, CancelledError.
    """
    with lit_by(scene, field) as (on, group), small(on, HELD_SAMPLES):
        on.scene.world = world_showing(on, light, group)
        parts = yield from parts_of(on, "looking how bright the world's light is", share)
        return light_in(parts, group).mean(axis=(0, 1), dtype=np.float64)


@contextmanager
def lit_by(scene: bpy.types.Scene, field: Field) -> Iterator[tuple[Stage, str]]:
    """Make a stage of a field's picture -> (stage, the light group of the world that it is to get).

    The stage has a black world. Raises FieldError, SceneError.
    """
    with ExitStack() as held:
        about = field.about
        if about.view_layer is None:
            raise FieldError(
                f"{field.folder} does not say of which view layer it is: capture again"
            )
        on = held.enter_context(stage(scene, about.view_layer))
        if about.catchers:
            held.enter_context(take(rendered(on), about.take or WHOLE))
        # The field was rendered by Cycles, whatever engine the artist works with now.
        on.change("render.engine", "CYCLES")
        prepare(on, layers=0)
        # Clamping as in the artist's renders. This render is not fitted, so clamping does no harm.
        for name in ("sample_clamp_direct", "sample_clamp_indirect"):
            on.change(f"cycles.{name}", getattr(scene.cycles, name))
        group = free_mark() + "lamps"
        on.scene.view_layers[0].lightgroups.add(name=group)
        set_region(on.scene, field.region)
        yield on, group


def light_in(parts: dict[str, NDArray], group: str) -> NDArray[np.float32]:
    """Take the light of a light group from a render's parts -> (H, W, 3).

    Raises SceneError where the light is missing or has pixels that are not finite.
    """
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
