"""How the last job that the artist asked for ended."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from .verbs import Verb


@dataclass
class Outcome:
    """How the last job that the artist asked for ended.

    level: `INFO`, `WARNING` or `ERROR`; blend, scene_id: the file and the scene that it was for.
    """

    level: str
    text: str
    verb: Verb | None = None
    blend: str = ""
    scene_id: str = ""

    def is_of(self, scene: bpy.types.Scene) -> bool:
        """Whether the job was for this scene of this file."""
        return (self.blend, self.scene_id) == (bpy.data.filepath, scene.arto.scene_id)
