"""Pictures that are made in memory, as Blender's images without a file.

Blender shows an image that it generated without the scene's exposure, look and view transform,
whatever *View as Render* says. An image with packed data obeys. So each image is packed once, while
it has a single pixel.
"""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from .colour import working_space

# The custom property that marks an image as one of these.
_MARK = "arto_picture"


def put(name: str, picture: NDArray, display: bool = False) -> bpy.types.Image:
    """Show a picture as Blender's image of a name, which is made where there is none.

    An image of the artist's that has the name keeps everything but that.

    picture: (H, W, 4), scene-linear, premultiplied, rows top-down; display: show the numbers as
    they are, else as a render is shown, with exposure, look and view transform.
    """
    height, width = picture.shape[:2]
    image = of_name(name)
    if image is None:
        step_aside(name)
        image = _new(name)
    if image.use_view_as_render == display:
        image.use_view_as_render = not display
    if tuple(image.size) != (width, height):
        image.scale(width, height)
    image.pixels.foreach_set(np.ascontiguousarray(picture[::-1], np.float32).ravel())
    image.update()
    return image


def of_name(name: str) -> bpy.types.Image | None:
    """The image of a name, where `put` made it."""
    image = bpy.data.images.get((name, None))
    return image if image is not None and is_picture(image) else None


def step_aside(name: str) -> None:
    """Give the file's image of a name, if there is one, the next free name."""
    image = bpy.data.images.get((name, None))
    if image is not None:
        image.name = f"{name}.001"  # Blender counts on where that is taken


def is_picture(image: bpy.types.Image) -> bool:
    """Whether an image was made by `put`: it only shows a picture, and nothing renders with it."""
    return _MARK in image and bool(image.packed_file)


def _new(name: str) -> bpy.types.Image:
    image = bpy.data.images.new(name, 1, 1, alpha=True, float_buffer=True)
    image.colorspace_settings.name = working_space()
    image.alpha_mode = "PREMUL"
    image.pixels.foreach_set(np.zeros(4, np.float32))  # without pixels nothing is packed
    image.pack()
    image[_MARK] = True
    return image
