"""Pictures that are made in memory, as Blender's images without a file."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from .colour import working_space


def put(name: str, picture: NDArray, display: bool = False) -> bpy.types.Image:
    """Show a picture as Blender's image of a name, which is made where there is none.

    picture: (H, W, 4), scene-linear, premultiplied, rows top-down; display: show the numbers as
    they are, else as a render is shown, with exposure and look.
    """
    height, width = picture.shape[:2]
    image = bpy.data.images.get(name)
    if image is not None and (image.source != "GENERATED" or image.library):
        bpy.data.images.remove(image)
        image = None
    if image is None:
        image = bpy.data.images.new(name, width, height, alpha=True, float_buffer=True)
        image.colorspace_settings.name = working_space()
        image.alpha_mode = "PREMUL"
        image.use_view_as_render = not display
    elif tuple(image.size) != (width, height):
        image.scale(width, height)
    image.pixels.foreach_set(np.ascontiguousarray(picture[::-1], np.float32).ravel())
    image.update()
    return image
