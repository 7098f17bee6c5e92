"""Maps of worlds, made by the resident renderer, so that the window never waits for a map.

The window saves the world into a small file and asks the resident renderer. The map comes back a
moment later.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import arrays
from ..blender.colour import working_space
from ..resident.making import MOST_BYTES, Question
from ..resident.resident import Resident, Said
from ..resident.sent import Sent
from ..shot import home
from ..world.check import check_world
from ..world.studio import of_textures

# The number of maps kept in memory, and the file of a map on its way.
MOST = 8
MAP = "map.npy"


class Maps:
    """The maps that the window has, by the key of their world."""

    def __init__(self, resident: Resident) -> None:
        self._resident = resident
        self._found: OrderedDict[tuple[str, bool], NDArray[np.float32]] = OrderedDict()
        # by the key of a world: the share of light of its suns, where they are worth a render
        self._suns: dict[str, float] = {}
        # the map that was made last, after the key of its world
        self.newest: tuple[str, NDArray[np.float32]] | None = None
        self._lock = threading.Lock()
        self.trouble = ""
        self._sent = Sent(resident.folder)
        self._failed: dict[tuple[str, bool], str] = {}

    def get(self, key: str, full: bool) -> NDArray[np.float32] | None:
        """The map (W / 2, W, 3) of a world at strength 1, not turned; None if not yet made."""
        with self._lock:
            found = self._found.get((key, full))
            if found is not None:
                self._found.move_to_end((key, full))
            return found

    def suns(self, key: str) -> float:
        """The share of light of a world's suns; 0 where they are not worth a render."""
        with self._lock:
            return self._suns.get(key, 0.0)

    def keep(self, key: str, image: NDArray[np.float32], suns: float = 0.0) -> None:
        """Keep a rough map that was made without the second Blender. suns: see `suns`."""
        with self._lock:
            self._add((key, False), image, suns)

    def _add(self, of: tuple[str, bool], image: NDArray[np.float32], suns: float | None) -> None:
        self._found[of] = image
        if suns is not None:
            self._suns[of[0]] = suns
        self.newest = of[0], image
        while len(self._found) > MOST:
            self._found.popitem(last=False)

    def trouble_with(self, key: str) -> str:
        """Why a map of this world could not be made; empty where none has failed."""
        with self._lock:
            return self._failed.get((key, False)) or self._failed.get((key, True)) or ""

    @property
    def busy(self) -> bool:
        """Whether a question is on its way, for a map or for something else."""
        return self._resident.busy

    def ask(
        self, scene: bpy.types.Scene, layer: str, world: bpy.types.World, key: str, full: bool
    ) -> bool:
        """Ask for a map -> whether the question was sent.

        No question is sent while another is on its way, for a map that has failed before, or where
        the second Blender has just ended. Raises SceneError where the world cannot light anything
        or cannot be written.
        """
        if self.busy or (key, full) in self._failed:
            return False
        check_world(scene, layer)
        blend, name, apart = self._sent.world(scene, layer, world)
        painted, pixels = self._sent.painted(world)
        question = Question(
            key=key,
            blend=str(blend),
            world=name,
            width=scene.arto.environment_width if full else 0,
            frame=scene.frame_current,
            subframe=scene.frame_subframe,
            space=working_space(),
            device=scene.cycles.device,
            textures=of_textures(scene),
            apart=apart,
            painted=painted,
            folder=str(home.absolute(scene.arto.folder)),
            out=str(self._resident.folder / MAP),
        )
        before = partial(self._write, pixels) if pixels else None
        answered: Callable[[Said], None] = partial(self._answered, (key, full))
        return self._resident.ask("map", asdict(question), answered, before)

    def _write(self, pixels: dict[Path, NDArray[np.float32]]) -> None:
        """Write painted pixels. Raises OSError."""
        try:
            for path, values in pixels.items():
                arrays.write(path, values)
        except OSError:
            self._sent.forget()
            raise

    def _answered(self, asked: tuple[str, bool], said: Said) -> None:
        """Keep a map, or why there is none."""
        error, found = said.error, None
        if said.lost or said.found.get("stopped"):
            return
        if not error:
            try:
                found = _map(self._resident.folder / MAP)
            except (OSError, ValueError) as e:
                error = f"the map of the world cannot be read ({e})"
        with self._lock:
            self.trouble = error
            if found is None:
                self._failed[asked] = error
            else:
                self._add(asked, found, said.found.get("suns"))


def _map(path: Path) -> NDArray[np.float32]:
    """A map (W / 2, W, 3) that the second Blender made. Raises OSError, ValueError."""
    found = arrays.read(path, MOST_BYTES)
    if found.dtype != np.float32 or found.ndim != 3 or found.shape[1:] != (2 * len(found), 3):
        raise ValueError(f"it is no map, but {found.dtype} of {found.shape}")
    if not np.isfinite(found).all():
        raise ValueError("it is infinite or not a number in some texels")
    return found
