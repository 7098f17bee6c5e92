"""The live image, which Live shows in the window, and the directions that its pixels see."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.region import Region
from ..blender.markers import camera_of
from ..blender.pictures import put

IMAGE = "ARTO Live"


def view_of(
    scene: bpy.types.Scene, shape: tuple[int, int], region: Region
) -> NDArray[np.float32] | None:
    """The direction that each pixel of the scene's camera sees, (H, W, 3), 0 outside the region.

    None without a camera, and for a panorama, whose pixels do not lie on a plane.
    """
    camera = camera_of(scene)
    if camera is None or camera.type != "CAMERA" or camera.data.type == "PANO":
        return None
    corners = np.array([tuple(c) for c in camera.data.view_frame(scene=scene)], np.float32)
    # right top, right bottom, left bottom, left top
    right, down = corners[0] - corners[3], corners[1] - corners[0]
    height, width = shape
    x = (np.arange(width, dtype=np.float32) + 0.5) / width
    y = (np.arange(height, dtype=np.float32) + 0.5) / height
    turned = np.array(camera.matrix_world.to_3x3().normalized(), np.float32)
    if camera.data.type == "ORTHO":
        look = turned @ np.array([0, 0, -1], np.float32)
        found = np.broadcast_to(look, (height, width, 3))
    else:
        found = (corners[3] + x[None, :, None] * right + y[:, None, None] * down) @ turned.T
    out = np.zeros_like(found)
    out[region.slices] = found[region.slices]
    return out


def push(picture: NDArray[np.float32], name: str) -> bpy.types.Image:
    """Put a picture (H, W, 4), rows top-down, into the live image.

    Editors that show the image called `name`, the plate, show the live image from now on.
    """
    image = put(IMAGE, picture)
    for space in spaces():
        shown = space.image
        if shown is not None and shown != image and shown.name == name:
            space.image = image
    return image


def spaces() -> list[bpy.types.SpaceImageEditor]:
    """The image editors that are open."""
    manager = bpy.context.window_manager
    areas = [a for w in manager.windows for a in w.screen.areas] if manager else []
    return [a.spaces.active for a in areas if a.type == "IMAGE_EDITOR"]


def redraw_pictures() -> None:
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in {"IMAGE_EDITOR", "PROPERTIES", "VIEW_3D"}:
                area.tag_redraw()


def put_away(name: str, *others: str) -> None:
    """Remove the live image and other images, which are in no file.

    name: the plate's, which editors show in their place; others: names of the other images.
    """
    for image in filter(None, map(bpy.data.images.get, (IMAGE, *others))):
        for space in spaces():
            if space.image == image:
                space.image = bpy.data.images.get(name)
        bpy.data.images.remove(image)
