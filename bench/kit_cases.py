"""Cases of the field whose world is a light kit: every kind of light, blend, base and preset."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import bpy
import numpy as np
from arto.arto_addon.kit import kit as kits
from arto.core.kit.light import Blend, Kind, Light
from arto.core.kit.model import Base, BaseKind, Kit
from arto.core.kit.presets import PRESETS, preset

from .behind_cases import CASES
from .field_cases import case

__all__ = ["CASES"]

_AT: dict[str, Any] = {"azimuth": -60.0, "elevation": 40.0, "roll": 15.0}
_SOFT: dict[str, Any] = {"softness": 0.3, "gradient": 0.3}
_DAY = Base(BaseKind.GRADIENT, strength=0.6)
LIGHTS: dict[str, Light] = {
    "rectangle": Light("a", width=50, height=30, strength=6, **_AT, **_SOFT),
    "round": Light("a", Kind.ROUND, width=40, height=40, strength=6, kelvin=3500, **_AT, **_SOFT),
    "ring": Light("a", Kind.RING, width=50, height=50, strength=9, **_AT),
    "strip": Light("a", Kind.STRIP, width=80, height=8, strength=20, slope=0.6, **_AT),
    # Of a smaller sun, in glass and mirrors, Cycles' own picture is nothing but specks.
    "sun": Light("a", Kind.SUN, width=3, strength=3, **_AT),
    "flag": Light("a", Kind.FLAG, Blend.MULTIPLY, width=90, height=90, strength=0, **_AT, **_SOFT),
}


def _has(scene: bpy.types.Scene, kit: Kit) -> None:
    world = scene.world = bpy.data.worlds.new("Kit")
    kits.write(world, kit)


def _of_light(scene: bpy.types.Scene, light: Light) -> None:
    _has(scene, Kit((light,), _DAY))


def _of_preset(scene: bpy.types.Scene, name: str) -> None:
    _has(scene, preset(name))


def _of_blend(scene: bpy.types.Scene, blend: Blend) -> None:
    front = replace(LIGHTS["round"], name="b", blend=blend, strength=0.5, azimuth=-45.0)
    _has(scene, Kit((LIGHTS["rectangle"], front), _DAY))


for _name, _light in LIGHTS.items():
    CASES[f"kit of a {_name}"] = "four_spheres", partial(_of_light, light=_light)
for _name in PRESETS:
    CASES[f"kit of the preset {_name}"] = "four_spheres", partial(_of_preset, name=_name)
for _blend in Blend:
    _words = f"kit with a light of the blend {_blend.value.lower()}"
    CASES[_words] = "four_spheres", partial(_of_blend, blend=_blend)


@case()
def kit_with_a_picture(scene):
    image = bpy.data.images.new("Window", 32, 32, float_buffer=True, alpha=True)
    pixels = np.ones((32, 32, 4), np.float32)
    pixels[:, 14:18] = pixels[14:18] = (0, 0, 0, 1)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    light = Light("a", Kind.PICTURE, Blend.OVER, width=50, height=50, strength=5, image="Window",
                  **_AT)  # fmt: skip
    _has(scene, Kit((light,), _DAY))


@case()
def kit_over_a_blurred_hdri(scene):
    texture = next(n for n in scene.world.node_tree.nodes if n.bl_idname.endswith("TexEnvironment"))
    base = Base(BaseKind.HDRI, texture.image.filepath, turn=40, blur=6, strength=0.7)
    _has(scene, Kit((LIGHTS["rectangle"],), base, turn=20))


@case()
def kit_with_a_backdrop(scene):
    _has(scene, Kit((LIGHTS["rectangle"],), _DAY, Base(BaseKind.GRADIENT, strength=0.2)))


@case()
def kit_in_a_world_that_was_there(scene):
    kit = kits.put_in(scene.world)
    kits.write(scene.world, kit.with_light(LIGHTS["rectangle"]))


@case()
def kit_with_nodes_around_it(scene):
    _has(scene, Kit((LIGHTS["rectangle"],), _DAY))
    tree = scene.world.node_tree
    hue = tree.nodes.new("ShaderNodeHueSaturation")
    hue.inputs["Value"].default_value = 0.5
    out = tree.nodes[kits.OUT]
    tree.links.new(out.inputs["Color"].links[0].from_socket, hue.inputs["Color"])
    tree.links.new(hue.outputs[0], out.inputs["Color"])
