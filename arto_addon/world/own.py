"""The scene's own lamps in a relit picture, with a gain for each of their light groups."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.field.field import Field
from ...core.preview import own_light


def gains_of(scene: bpy.types.Scene) -> dict[str, float]:
    """The gain of each light group of the scene's own lamps, by name; 0 for a hidden group."""
    return {group.name: group.gain if group.show else 0.0 for group in scene.arto.own_groups}


def own_of(scene: bpy.types.Scene, field: Field) -> NDArray[np.float32]:
    """The light of the scene's own lamps in a field, with the settings' gains -> (H, W, 3)."""
    return own_light(field, scene.arto.own_lamps, gains_of(scene))


def sync(scene: bpy.types.Scene, field: Field) -> None:
    """Make the settings' list of light groups match the field's: add missing, remove others."""
    there = {name.removeprefix("own_") for name in field.own_layers}
    groups = scene.arto.own_groups
    for i in reversed(range(len(groups))):
        if groups[i].name not in there:
            groups.remove(i)
    for name in sorted(there - {group.name for group in groups}):
        groups.add().name = name
