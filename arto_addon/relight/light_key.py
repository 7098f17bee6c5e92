"""What a plate hangs on besides the field: by it the window knows whether one is up to date."""

from __future__ import annotations

import hashlib

import bpy

from ..settings.setting import Decides
from ..settings.table import values
from ..world.kept import shows
from ..world.own import gains_of

# In a plate's header.
HEADER = "arto.light key"


def light_key(scene: bpy.types.Scene, world: bpy.types.World) -> str:
    """Sixteen letters that are the same for the same light of a scene."""
    key, strength, turn = shows(scene, world)
    settings = scene.arto
    of: list[object] = [key, round(strength, 5), round(turn, 5), scene.render.film_transparent]
    of += [str(value) for value in values(settings, Decides.PLATE).values()]
    of += [sorted((n, round(g, 5)) for n, g in gains_of(settings).items())]
    return hashlib.sha256(repr(of).encode()).hexdigest()[:16]
