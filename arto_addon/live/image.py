"""The live image, the plate in its place, and the directions that their pixels see."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ...core.region import Region
from ..blender.editors import editors, replace, reveal
from ..blender.markers import camera_of
from ..blender.pictures import of_name, put
from ..plate import plate
from ..plate.names import relit_file
from ..world.bake import sees_the_camera

IMAGE = "ARTO Live"


class Seen:
    """Whether the camera sees another world than lights the scene, whose map is then not shown.

    The answer is kept by the key of the world.
    """

    def __init__(self) -> None:
        self._last = "", False

    def apart(self, world: bpy.types.World | None, key: str) -> bool:
        """Whether the camera sees another world. key: of what the world shows."""
        if self._last[0] != key:
            self._last = key, world is not None and sees_the_camera(world)
        return self._last[1]

    def view(
        self,
        scene: bpy.types.Scene,
        clear: bool,
        world: bpy.types.World | None,
        key: str,
        shape: tuple[int, int],
        region: Region,
    ) -> NDArray[np.float32] | None:
        """What `view_of` gives; None where the map of the world is not seen behind the scene.

        clear: whether the film is transparent.
        """
        return None if clear or self.apart(world, key) else view_of(scene, shape, region)


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
    replace(name, image)
    return image


def show_plate(scene: bpy.types.Scene) -> None:
    """Show the plate on disk in place of the live image. Raises SceneError, ExrError."""
    name, path = plate.name_of(scene), relit_file(scene)
    image = bpy.data.images.get(name)
    if image is None:
        image = plate.show(plate.shown_file(path, exr.header(path)), name)
    replace(IMAGE, image)
    if not seen(image):
        reveal(image)


def seen(image: bpy.types.Image) -> bool:
    """Whether an editor shows an image."""
    return any(editor.image == image for editor in editors())


def put_away(name: str, *others: str) -> None:
    """Remove the live image and other images, which are in no file.

    name: the plate's, which editors show in their place; others: names of the other images.
    """
    for image in filter(None, map(of_name, (IMAGE, *others))):
        replace(image.name, bpy.data.images.get(name))
        bpy.data.images.remove(image)
