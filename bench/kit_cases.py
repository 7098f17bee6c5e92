"""Cases of the field whose world is a light kit: every kind of light, blend, base and preset."""

from __future__ import annotations

from functools import partial
from typing import Any

import bpy
from arto.arto_addon.kit import kit as kits
from arto.core.kit.light import Blend, Kind, Light
from arto.core.kit.model import Base, BaseKind, Kit

from .behind_cases import CASES

__all__ = ["CASES"]

_AT: dict[str, Any] = {"azimuth": -60.0, "elevation": 40.0, "roll": 15.0}
_SOFT: dict[str, Any] = {"softness": 0.3, "gradient": 0.3}
_DAY = Base(BaseKind.GRADIENT, strength=0.6)
LIGHTS: dict[str, Light] = {
    "rectangle": Light("a", width=50, height=30, strength=6, **_AT, **_SOFT),
    "round": Light("a", Kind.ROUND, width=40, height=40, strength=6, kelvin=3500, **_AT, **_SOFT),
    "ring": Light("a", Kind.RING, width=50, height=50, strength=9, **_AT),
    "strip": Light("a", Kind.STRIP, width=80, height=8, strength=20, slope=0.6, **_AT),
    "flag": Light("a", Kind.FLAG, Blend.MULTIPLY, width=90, height=90, strength=0, **_AT, **_SOFT),
    # Of a smaller sun, in glass and mirrors, Cycles' own picture is nothing but specks.
    "sun": Light("a", Kind.SUN, width=3, strength=3, **_AT),
}


def _has(scene: bpy.types.Scene, kit: Kit) -> None:
    world = scene.world = bpy.data.worlds.new("Kit")
    kits.write(world, kit)


def _of_light(scene: bpy.types.Scene, light: Light) -> None:
    _has(scene, Kit((light,), _DAY))


for _name, _light in LIGHTS.items():
    CASES[f"kit of a {_name}"] = "four_spheres", partial(_of_light, light=_light)
