"""The key of a light: what a plate depends on besides the field.

The window compares keys to know whether a plate is up to date.
"""

from __future__ import annotations

import hashlib

import bpy

from ..settings.setting import Decides
from ..settings.table import values
from ..world.kept import shows
from ..world.own import gains_of

# Where a plate's header holds the key.
HEADER = "arto.light key"


def light_key(scene: bpy.types.Scene, world: bpy.types.World) -> str:
    """A key of sixteen letters, the same whenever a scene's light and its settings are the same."""
    key, strength, turn = shows(scene, world)
    settings = scene.arto
    of: list[object] = [key, round(strength, 5), round(turn, 5), scene.render.film_transparent]
    of += [str(value) for value in values(settings, Decides.PLATE).values()]
    of += [sorted((n, round(g, 5)) for n, g in gains_of(settings).items())]
    return hashlib.sha256(repr(of).encode()).hexdigest()[:16]
