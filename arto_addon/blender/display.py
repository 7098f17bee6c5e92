"""How Blender shows light: the scene's view transform, made by saving a picture."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np
from numpy.typing import NDArray

from .colour import working_space
from .scratch import temporary


def displayed(scene: bpy.types.Scene, light: NDArray) -> NDArray[np.float32]:
    """What the scene's view transform makes of a picture -> (H, W, 3), 0 to 1, as on the screen.

    Look, exposure, gamma and curves are in it. light: (H, W, 3), scene-linear, rows from the top.
    """
    height, width = light.shape[:2]
    with temporary() as folder, saving(scene, "PNG", "16") as on:
        path = folder / "view.png"
        with image_of(light, float_buffer=True) as image:
            image.save_render(str(path), scene=on)
        shown = bpy.data.images.load(str(path))
        try:
            shown.colorspace_settings.name = "Non-Color"
            pixels = np.empty(height * width * 4, np.float32)
            shown.pixels.foreach_get(pixels)
        finally:
            bpy.data.images.remove(shown)
    return np.clip(pixels.reshape(height, width, 4)[::-1, :, :3], 0, 1)


@contextmanager
def saving(scene: bpy.types.Scene, kind: str, depth: str) -> Iterator[bpy.types.Scene]:
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
def image_of(pixels: NDArray, float_buffer: bool) -> Iterator[bpy.types.Image]:
    """A picture (H, W, 3), rows from the top, as an image of Blender's."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("ARTO Display", width, height, float_buffer=float_buffer)
    try:
        if float_buffer:  # first: an image that gets another space loses its pixels
            image.colorspace_settings.name = working_space()
        opaque = np.dstack([pixels, np.ones((height, width))])
        image.pixels.foreach_set(np.ascontiguousarray(opaque[::-1], np.float32).ravel())
        image.update()
        yield image
    finally:
        bpy.data.images.remove(image)
