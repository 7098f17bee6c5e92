"""How Blender shows light: the scene's view transform as a table, and pictures as JPEG files."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.web import view
from ..blender.colour import working_space
from ..blender.scratch import temporary

# Of a JPEG, in percent.
QUALITY = 88


def table_of(scene: bpy.types.Scene) -> NDArray[np.uint8]:
    """What the scene's view transform makes of the grid of `core.web.view` -> (n, n, n, 3).

    Look, exposure, gamma and curves are in it. Blender itself makes it, by saving a picture.
    """
    n = view.SIDE
    with temporary() as folder, _saving(scene, "PNG", "16") as on:
        path = folder / "view.png"
        with _image(view.grid_of().reshape(n, n * n, 3), float_buffer=True) as grid:
            grid.save_render(str(path), scene=on)
        shown = bpy.data.images.load(str(path))
        try:
            shown.colorspace_settings.name = "Non-Color"
            pixels = np.empty(n * n * n * 4, np.float32)
            shown.pixels.foreach_get(pixels)
        finally:
            bpy.data.images.remove(shown)
    colours = pixels.reshape(n, n * n, 4)[::-1, :, :3].reshape(n, n, n, 3)
    return np.rint(np.clip(colours, 0, 1) * 255).astype(np.uint8)


def jpeg(scene: bpy.types.Scene, shown: NDArray, path: Path) -> bytes:
    """Save a picture as it is on the screen, (H, W, 3), 0 to 1 -> the bytes of the file."""
    with _saving(scene, "JPEG", "8") as on, _image(shown, float_buffer=False) as image:
        on.view_settings.view_transform = "Standard"
        on.view_settings.look = "None"
        on.view_settings.exposure, on.view_settings.gamma = 0.0, 1.0
        on.view_settings.use_curve_mapping = False
        image.save_render(str(path), scene=on, quality=QUALITY)
    return path.read_bytes()


@contextmanager
def _saving(scene: bpy.types.Scene, kind: str, depth: str) -> Iterator[bpy.types.Scene]:
    """A copy of the scene whose settings of files may be changed."""
    on = scene.copy()
    try:
        settings = on.render.image_settings
        if hasattr(settings, "media_type"):
            settings.media_type = "IMAGE"
        settings.file_format, settings.color_mode = kind, "RGB"
        if kind == "PNG":
            settings.color_depth = depth
        settings.color_management = "FOLLOW_SCENE"
        on.render.dither_intensity = 0.0
        yield on
    finally:
        bpy.data.scenes.remove(on)


@contextmanager
def _image(pixels: NDArray, float_buffer: bool) -> Iterator[bpy.types.Image]:
    """A picture (H, W, 3), rows from the top, as an image of Blender's."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("ARTO Page", width, height, float_buffer=float_buffer)
    try:
        if float_buffer:  # first: an image that gets another space loses its pixels
            image.colorspace_settings.name = working_space()
        opaque = np.dstack([pixels, np.ones((height, width))])
        image.pixels.foreach_set(np.ascontiguousarray(opaque[::-1], np.float32).ravel())
        image.update()
        yield image
    finally:
        bpy.data.images.remove(image)
