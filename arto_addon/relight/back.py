"""Back to the scene: turn the mix set in the compositor into a world and lamps to render with."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ...core.errors import SceneError
from ...core.file_names import safe_name
from ...core.light.layers import part_of
from ..blender.colour import working_space
from ..blender.compositing import compositor
from ..blender.nodes import new_world
from ..plate import marks
from ..plate.marks import PLATE
from ..plate.mixer import EXPOSURE_SOCKET, SOURCE
from ..plate.names import relit_file
from ..plate.plate import layers_file, shown_file, world_file
from ..shot.shot import layer_of
from ..world import kept
from ..world.check import check_world
from . import layers
from .shown import Shown

WORLD = "ARTO Mix"


@dataclass(frozen=True)
class Mix:
    """What a mixer's node does to each layer. exposure: of all layers, in stops."""

    node: bpy.types.Node
    exposure: float

    def of(self, layer: str) -> NDArray[np.float64]:
        """The factor of a layer, (3,): gain, tint and exposure; for others the exposure alone."""
        inputs = self.node.inputs
        if layer not in inputs:
            return np.full(3, 2.0**self.exposure)
        tint = np.array(inputs[f"{layer} Tint"].default_value[:3], dtype=float)
        return float(inputs[layer].default_value) * 2.0**self.exposure * tint


def mix_of(scene: bpy.types.Scene) -> Mix:
    """The mix in the scene's compositor.

    Raises SceneError where there is no mixer, or where a socket other than Footage is linked: a
    lamp cannot follow a link.
    """
    tree = compositor(scene)
    for node in tree.nodes if tree else ():
        group = getattr(node, "node_tree", None)
        if group is None or SOURCE not in group.nodes:
            continue
        linked = [socket.name for socket in node.inputs if socket.is_linked]
        if linked and linked != ["Footage"]:
            raise SceneError(
                f"'{linked[0]}' of the mixer is linked: unlink it, so that it is one number"
            )
        return Mix(node, float(node.inputs[EXPOSURE_SOCKET].default_value))
    raise SceneError(
        "there is no mixer in the compositor: choose Layers, and relight; its node is added there"
    )


def mix_to_scene(scene: bpy.types.Scene, view_layer: str | None = None) -> Path:
    """Give the scene a world and lamps that render as the mix in its compositor looks.

    The world is a new one. The energy and colour of the lamps are multiplied, which the window can
    undo. Returns the path of the new world's environment map. Raises SceneError, and what opening
    the field raises.
    """
    layer = view_layer or layer_of(scene)
    mix, settings = mix_of(scene), scene.arto
    shown = Shown(scene, layer)
    world = check_world(scene, layer)
    path = relit_file(scene)
    lit = exr.header(shown_file(layers_file(path), exr.header(path))).get("arto.world")
    if lit != world.name:
        raise SceneError(
            f"the layers are of the world '{lit}', and the scene has '{world.name}': relight first"
        )
    _check_lamps(scene, mix)
    world_exr = world_file(path)
    marks.check(world_exr, path, settings.overwrite)
    whole = kept.environment(scene, settings.environment_width, layer)
    image = np.zeros_like(whole.image)
    left = np.ones(whole.image.shape[:2], np.float32)
    for name, share in layers.parts_of(scene, whole, shown.field, world).items():
        gain = mix.of(layers.channel_name(scene, name))
        image += part_of(whole, share).image * gain.astype(np.float32)
        left -= share
    # light from where no patch is lights nothing, but the camera sees it
    image += whole.image * np.maximum(left, 0)[..., None] * np.float32(2.0**mix.exposure)
    exr.write(world_exr, {"": image}, {PLATE: path.name}, working_space())
    _gain_lamps(scene, mix)
    world = bpy.data.worlds.get(WORLD) or new_world(WORLD)
    show_map(world, world_exr, whole.turn)
    scene.world = world
    scene.view_layers[layer].world_override = None
    return world_exr


def _layer_of(scene: bpy.types.Scene, thing: bpy.types.Object) -> str:
    """The name of the layer that holds a lamp's light."""
    groups = {g.name for layer in scene.view_layers for g in layer.lightgroups}
    name = layers.OWN + (f"_{safe_name(thing.lightgroup)}" if thing.lightgroup in groups else "")
    return layers.channel_name(scene, name)


def _lamps(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    return [thing for thing in scene.objects if thing.type == "LIGHT"]


def _check_lamps(scene: bpy.types.Scene, mix: Mix) -> None:
    """Raise SceneError where the mix changes a linked lamp: ARTO cannot edit it."""
    for thing in _lamps(scene):
        gain = scene.arto.own_lamps * mix.of(_layer_of(scene, thing))
        if thing.data.library and not np.allclose(gain, 1):
            raise SceneError(f"the lamp '{thing.name}' is linked: make it local to dim it")


def _gain_lamps(scene: bpy.types.Scene, mix: Mix) -> None:
    """Multiply the scene's lamps by their layers' gains."""
    gained: dict[str, dict[bpy.types.Light, NDArray]] = {}
    for thing in _lamps(scene):
        if thing.data.library:
            continue  # a linked lamp stays as it is: `_check_lamps` has found its gain to be 1
        name = _layer_of(scene, thing)
        if any(thing.data in lamps for other, lamps in gained.items() if other != name):
            # lamps of two layers share this data: give this lamp a copy, with its own gain
            thing.data = thing.data.copy()
        gained.setdefault(name, {})[thing.data] = scene.arto.own_lamps * mix.of(name)
    for lamps in gained.values():
        for lamp, gain in lamps.items():
            most = float(gain.max())
            lamp.energy *= most
            if most > 0:
                lamp.color = np.array(lamp.color[:]) * (gain / most)


def show_map(world: bpy.types.World, path: Path, turn: float = 0.0) -> None:
    """Give a world the nodes that show a map from a file. turn: about the vertical, in radians."""
    tree = world.node_tree
    tree.nodes.clear()
    image = bpy.data.images.load(str(path), check_existing=True)
    image.reload()
    image.colorspace_settings.name = working_space()
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    light, out = tree.nodes.new("ShaderNodeBackground"), tree.nodes.new("ShaderNodeOutputWorld")
    mapping, where = tree.nodes.new("ShaderNodeMapping"), tree.nodes.new("ShaderNodeTexCoord")
    mapping.inputs["Rotation"].default_value = (0, 0, turn)
    for i, node in enumerate((where, mapping, texture, light, out)):
        node.location = (300 * i - 900, 0)
    tree.links.new(where.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], light.inputs["Color"])
    tree.links.new(light.outputs[0], out.inputs["Surface"])
