"""Footage: what was filmed, that a shot's things are put into.

Blender reads it, as its compositor would: image, sequence or movie, in its colour space, at the
scene's frame, brought to the picture's size.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.errors import SceneError
from ..blender.compositing import choose, compositor, studio, turned_off
from ..stage.stage import picture_size

# How a picture of another shape fills the frame, by the camera's word for it.
_FILLS = {"STRETCH": "Stretch", "FIT": "Fit", "CROP": "Crop"}
# Of an image's user, what an image node of the compositor has too.
_TIMING = ("frame_duration", "frame_start", "frame_offset", "use_cyclic", "use_auto_refresh")


@dataclass(frozen=True)
class Footage:
    """source: an image or a movie clip; timing: what says which of its frames is seen when, an
    image's user or node, or None; fills: how, of `_FILLS`."""

    source: Any
    timing: Any = None
    fills: str = "STRETCH"

    @property
    def name(self) -> str:
        return self.source.name

    def read(self, scene: bpy.types.Scene) -> NDArray[np.float32]:
        """The footage at the scene's frame -> (H, W, 3), scene-linear, of the picture's size.

        Raises SceneError where Blender cannot read it, or it is no picture.
        """
        with studio("ARTO Footage") as on:
            scale = on.tree.nodes.new("CompositorNodeScale")
            choose(scale, "Type", "Render Size")
            choose(scale, "Frame Type", _FILLS[self.fills])
            on.tree.links.new(self._node(on.tree).outputs["Image"], scale.inputs["Image"])
            on.scene.render.fps, on.scene.render.fps_base = scene.render.fps, scene.render.fps_base
            on.scene.frame_set(scene.frame_current, subframe=scene.frame_subframe)
            size = picture_size(scene)
            found = on.composite(scale.outputs["Image"], size, "reading the footage")
        # what Blender cannot read is nothing to it, and it says no word
        if found.shape[1::-1] != size or not found[..., 3].any():
            raise SceneError(
                f"Blender shows nothing of the footage '{self.name}' at frame "
                f"{scene.frame_current}: look whether its file is there and whole"
            )
        if bad := int((~np.isfinite(found)).any(axis=-1).sum()):
            raise SceneError(
                f"the footage '{self.name}' has {bad} pixels that are infinite or not a number: "
                "repair them, or choose another"
            )
        return np.ascontiguousarray(found[..., :3])

    def _node(self, tree: Any) -> Any:
        if isinstance(self.source, bpy.types.MovieClip):
            node = tree.nodes.new("CompositorNodeMovieClip")
            node.clip = self.source
            return node
        node = tree.nodes.new("CompositorNodeImage")
        node.image = self.source
        if self.timing is not None and self.source.source in {"SEQUENCE", "MOVIE"}:
            for name in _TIMING:
                setattr(node, name, getattr(self.timing, name))
        return node

    def missing(self) -> str:
        """The file that it has not got, empty where all is there."""
        image = self.source
        if isinstance(image, bpy.types.Image) and (
            image.source not in {"FILE", "MOVIE"} or image.packed_file
        ):
            return ""
        path = Path(bpy.path.abspath(image.filepath, library=image.library))
        return "" if path.exists() else str(path)


def footage(scene: bpy.types.Scene) -> Footage | None:
    """The artist's: ARTO's setting, else what the camera has as its background, else the first
    image or clip of the scene's compositor; None where there is none."""
    found = _chosen(scene) or _behind_camera(scene) or _in_compositor(scene)
    if found and (path := found.missing()):
        raise SceneError(f"the footage '{found.name}' is not at {path}: find it, or choose another")
    return found


def _chosen(scene: bpy.types.Scene) -> Footage | None:
    image = scene.arto.footage
    if image is None:
        return None
    timing = _Timing() if image.source in {"SEQUENCE", "MOVIE"} else None
    return Footage(image, timing, "CROP")


@dataclass(frozen=True)
class _Timing:
    """Of a sequence or movie that is chosen by itself: each frame shows the picture of its number.

    An image does not know how many pictures it has; of one that is not there nothing is shown,
    which is said.
    """

    frame_duration: int = 1_000_000
    frame_start: int = 1
    frame_offset: int = 0
    use_cyclic: bool = False
    use_auto_refresh: bool = True


def _behind_camera(scene: bpy.types.Scene) -> Footage | None:
    camera = scene.camera
    if camera is None or camera.type != "CAMERA" or not camera.data.show_background_images:
        return None
    for behind in camera.data.background_images:
        if not behind.show_background_image:
            continue
        source = behind.image
        if behind.source == "MOVIE_CLIP":
            source = scene.active_clip if behind.use_camera_clip else behind.clip
        if source is None:
            continue
        placed = [*behind.offset, behind.scale - 1, math.sin(behind.rotation)]
        if any(abs(x) > 1e-6 for x in placed) or behind.use_flip_x or behind.use_flip_y:
            raise SceneError(
                f"the camera's background '{source.name}' is moved, turned, scaled or flipped: put "
                "it back, or choose the footage in ARTO's settings"
            )
        return Footage(source, behind.image_user, behind.frame_method)
    return None


def _in_compositor(scene: bpy.types.Scene) -> Footage | None:
    tree = None if turned_off(scene) else compositor(scene)
    for node in tree.nodes if tree else ():
        if node.bl_idname == "CompositorNodeMovieClip" and node.clip and not node.mute:
            return Footage(node.clip, None, "CROP")
        if node.bl_idname == "CompositorNodeImage" and node.image and not node.mute:
            return Footage(node.image, node, "CROP")
    return None
