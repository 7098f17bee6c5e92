"""What is checked and asked before a capture starts."""

from __future__ import annotations

import bpy

from ..blender.words import tr
from ..capture.check import check_scene
from ..capture.planned import check_room, doubts
from ..shot import paths
from ..stage.settings import samples_of
from . import state


def before_capture(scene: bpy.types.Scene) -> str:
    """What to ask before a capture: it replaces a better one, or there may be no room for it."""
    asked = []
    samples = state.better(scene)
    if samples is not None:
        text = "This takes the place of a capture of {more} samples, by {fewer}: it is lost then"
        asked.append(tr(text, more=f"{samples:g}", fewer=samples_of(scene)))
    asked.append(doubts(scene, paths.place(scene).folder))
    return ". ".join(filter(None, asked))


def check_capture(scene: bpy.types.Scene) -> None:
    """Raise an ArtoError where the scene cannot be captured, or there is no room for a capture."""
    check_scene(scene)
    check_room(scene, paths.place(scene).folder)
