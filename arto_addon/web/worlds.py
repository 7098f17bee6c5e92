"""The worlds of a page: those of the looks, or maps from files; a kit's lights by themselves."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.kit import shine
from ...core.kit.light import Blend
from ...core.kit.model import Base, Kit
from ...core.web import sphere
from ...core.web.shot import World, world_of
from ..blender.nodes import new_world
from ..kit import kit as kits
from ..relight.many import world_showing
from ..shot.shot import layer_of
from ..world import kept
from ..world.background import background
from ..world.check import check_world

# Texels a side of a world's map.
SIDE = 512


def worlds_of(
    scene: bpy.types.Scene, view_layer: str, files: Sequence[Path], lent: ExitStack
) -> dict[str, bpy.types.World]:
    """The worlds of a page by their names: of files, of the looks, or the scene's own.

    lent: removes the worlds of files again. Raises SceneError.
    """
    if files:
        return {_free(f.stem, ()): lent.enter_context(world_showing(f)) for f in files}
    found: dict[str, bpy.types.World] = {}
    for look in scene.arto.looks:
        if look.world:
            found[_free(look.name, found)] = look.world
    if not found:
        world = check_world(scene, view_layer)
        found[world.name] = world
    return found


def _free(name: str, taken: object) -> str:
    number, found = 2, name
    while isinstance(taken, dict) and found in taken:
        found, number = f"{name} {number}", number + 1
    return found


def reduced(scene: bpy.types.Scene, view_layer: str, name: str, world: bpy.types.World) -> World:
    """A world as a page has it. Raises what `kept.environment` raises."""
    width = scene.arto.environment_width
    whole = sphere.of_environment(kept.environment(scene, width, view_layer, world), SIDE)
    lights = []
    for one in _lights(world):
        kit = replace(kits.read(world), lights=(one,), base=Base(), backdrop=None)
        lights.append((one.name, sphere.of_environment(shine.map_of(kit, width // 2), SIDE)))
    rest = whole - sum((light for _, light in lights), np.zeros_like(whole))
    apart = tuple(world_of(of, light) for of, light in lights)
    return world_of(name, np.maximum(rest, 0), apart)


def _lights(world: bpy.types.World) -> list:
    """The lights of a world's kit that a page can scale by themselves: those that add to others."""
    if not kits.is_whole(world):
        return []
    kit: Kit = kits.read(world)
    if any(light.blend != Blend.ADD for light in kit.lit):
        return []  # what stands before others takes their light away
    return [light for light in kit.lit if not light.image]


def rays_of(scene: bpy.types.Scene, view_layer: str | None = None) -> NDArray[np.float32]:
    """Where the camera looks in each pixel -> (H, W, 3), in the world.

    Cycles renders it, as a world whose colour is the direction, so every lens is right.
    """
    world = new_world("ARTO Rays")
    try:
        nodes, links = world.node_tree.nodes, world.node_tree.links
        coded = nodes.new("ShaderNodeVectorMath")
        coded.operation = "MULTIPLY_ADD"
        coded.inputs[1].default_value = coded.inputs[2].default_value = (0.5, 0.5, 0.5)
        links.new(nodes.new("ShaderNodeTexCoord").outputs["Generated"], coded.inputs[0])
        links.new(coded.outputs[0], nodes["Background"].inputs["Color"])
        layer = view_layer or layer_of(scene)
        return 2 * background(scene, None, layer, world=world) - 1
    finally:
        bpy.data.worlds.remove(world)
