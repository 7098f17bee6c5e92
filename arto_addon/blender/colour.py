"""The colour space that Blender works in: what its numbers mean where they are light."""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy
import numpy as np

from ...core import exr
from ...core.errors import SceneError
from .version import FIVE

_found: list[str] = []


def working_space() -> str:
    """Its name, as Blender lists it for images."""
    if FIVE:
        return bpy.data.colorspace.working_space
    if not _found:
        _found.append(_looked_for())
    return _found[0]


def _looked_for() -> str:
    """Blender 4.5 names it nowhere, and a studio's OpenColorIO may have any: it is the space of
    which Blender takes an image's numbers as they are. Raises SceneError."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "primaries.exr"
        exr.write(path, {"": np.eye(3, dtype=np.float32)[None] * 0.5 + 0.25})
        image = bpy.data.images.load(str(path))
        usual = bpy.data.images.new("ARTO Space", 1, 1, float_buffer=True)
        try:
            pixels = np.empty(12, np.float32)
            there = image.colorspace_settings
            names = [item.identifier for item in there.bl_rna.properties["name"].enum_items]
            # what Blender itself gives to images of light is asked first
            for name in dict.fromkeys([usual.colorspace_settings.name, *names]):
                there.name = name
                if there.is_data:
                    continue
                image.pixels.foreach_get(pixels)
                if np.abs(pixels.reshape(3, 4)[:, :3] - np.eye(3) * 0.5 - 0.25).max() < 1e-6:
                    return name
        finally:
            bpy.data.batch_remove([image, usual])
    raise SceneError(
        "Blender's colour management names no colour space for the light it works with: look at "
        "its OpenColorIO configuration"
    )
