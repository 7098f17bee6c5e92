"""What Live asks the resident renderer for: maps of the world, its suns, and the clean picture."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.light.environment import Environment
from ...core.light.lamps import split
from ..resident import resident
from .maps import Maps
from .quick import Quick
from .source import Opened
from .suns import Picture, Suns
from .viewer import MOVING, Drawn
from .wished import Light

# Seconds of rest until a picture of full size is made.
WHOLE = 0.25


@dataclass(frozen=True, eq=False)
class Map:
    """The map that a picture is to show.

    key: of its world; image: at strength 1 and not turned; strength, turn: of the world; full:
    whether it is the full map; ours: whether it is of the world as it is now.
    """

    key: str
    image: NDArray[np.float32]
    strength: float
    turn: float
    full: bool
    ours: bool


class Asking:
    """The questions that Live asks, and the answers."""

    def __init__(self, scene: bpy.types.Scene, layer: str, opened: Opened) -> None:
        """Have the resident renderer begin. Raises SceneError."""
        self._layer, self._preview = layer, opened.preview
        self.resident = resident.current()
        self.maps, self._quick = Maps(self.resident), Quick()
        self.suns = Suns(self.resident, scene, layer, opened)
        self._asked_with = 1.0, 0.0
        self.resident.begin()

    def open(self, scene: bpy.types.Scene, opened: Opened) -> None:
        """Be told that another field is shown. Raises SceneError."""
        self.close()
        self._preview = opened.preview
        self.suns = Suns(self.resident, scene, self._layer, opened)

    def map_of(self, world: bpy.types.World | None, light: Light) -> Map | None:
        """The map to show; None before the first.

        While the artist changes the world faster than maps are made, it is the newest.
        """
        key = light.key
        full = self.maps.get(key, True)
        image = full if full is not None else self.maps.get(key, False)
        if image is None and world:
            image = self._quick.map_of(world)
            if image is not None:
                found = split(Environment(image))
                self.maps.keep(key, image, found.share if found.worth else 0.0)
        if image is not None:
            return Map(key, image, light.strength, light.turn, full is not None, True)
        if self.maps.newest is None:
            return None
        return Map(*self.maps.newest, *self._asked_with, False, False)

    def suns_of(self, scene: bpy.types.Scene, shown: Map) -> tuple[Picture | None, bool]:
        """The suns of a map -> (their picture, whether to wait for one that comes in a moment)."""
        if not scene.arto.lamps:
            return None, False
        found = self.suns.of(shown.key)
        if not self.suns.quick:
            # suns that stay behind the hand for long are worse than those that the field shows
            return (found if found and found.turn == shown.turn else None), False
        return found, found is None and self.maps.suns(shown.key) > 0

    def ask(
        self,
        scene: bpy.types.Scene,
        world: bpy.types.World,
        light: Light,
        rest: float,
        shown: Map | None,
        whole: Drawn | None,
    ) -> None:
        """Ask for what is wanted most, where no question is on its way.

        rest: seconds since the light has changed; shown: the map that is shown; whole: the picture
        of full size that is shown, where it is not denoised. Raises SceneError.
        """
        if self.maps.busy:
            return
        share, last = 0.0, None
        if shown is not None and scene.arto.lamps and self.suns.usable:
            share, last = self.maps.suns(shown.key), self.suns.of(shown.key)
        stale = share > 0 and shown is not None and (last is None or last.turn != shown.turn)
        # the first picture prepares the scene, which takes its time
        if shown and stale and (self.suns.quick or (shown.ours and rest > WHOLE)):
            factor = self._preview.factor_for(MOVING)
            self.suns.ask(scene, shown.key, shown.full, shown.turn, shown.image, factor, share)
        elif shown is None or not shown.ours:
            if self.maps.ask(scene, self._layer, world, light.key, False):
                self._asked_with = light.strength, light.turn
        elif not shown.full and rest > WHOLE:
            self.maps.ask(scene, self._layer, world, shown.key, True)
        elif shown.full and whole is not None and self._is_to_be_cleaned(scene, light):
            self.suns.ask_clean(scene, shown.key, shown.turn, shown.image, whole, share, light)

    def _is_to_be_cleaned(self, scene: bpy.types.Scene, light: Light) -> bool:
        cleaned = self.suns.cleaned
        able = scene.arto.denoise and self.suns.can_clean and not self.suns.trouble
        return able and (cleaned is None or cleaned[0] != light)

    def clean_of(self, light: Light) -> Picture | None:
        """The clean picture of a light, where it was made."""
        cleaned = self.suns.cleaned
        return cleaned[1] if cleaned and cleaned[0] == light else None

    def close(self) -> None:
        """Let go of what was asked for. The resident renderer stays."""
        self.suns.make_way()
        self.suns.close()
