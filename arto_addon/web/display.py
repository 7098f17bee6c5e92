"""How Blender shows light: the scene's view transform as a table, and pictures as JPEG files."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.web import view
from ..blender.display import displayed, image_of, saving

# Of a JPEG, in percent.
QUALITY = 88


def table_of(scene: bpy.types.Scene) -> NDArray[np.uint8]:
    """What the scene's view transform makes of the grid of `core.web.view` -> (n, n, n, 3).

    Look, exposure, gamma and curves are in it. Blender itself makes it, by saving a picture.
    """
    n = view.SIDE
    colours = displayed(scene, view.grid_of().reshape(n, n * n, 3)).reshape(n, n, n, 3)
    return np.rint(colours * 255).astype(np.uint8)


def jpeg(scene: bpy.types.Scene, shown: NDArray, path: Path) -> bytes:
    """Save a picture as it is on the screen, (H, W, 3), 0 to 1 -> the bytes of the file."""
    with saving(scene, "JPEG", "8") as on, image_of(shown, float_buffer=False) as image:
        on.view_settings.view_transform = "Standard"
        on.view_settings.look = "None"
        on.view_settings.exposure, on.view_settings.gamma = 0.0, 1.0
        on.view_settings.use_curve_mapping = False
        image.save_render(str(path), scene=on, quality=QUALITY)
    return path.read_bytes()
