"""Footage: the filmed picture behind a shot's things.

Blender's compositor reads the footage: an image, a sequence or a movie, in its own colour space, at
the scene's frame, brought to the picture's size.
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ...core.errors import SceneError
from ...core.exr.window import Box
from ..blender.compositing import choose, compositor, darkroom, turned_off
from ..blender.markers import camera_of
from ..blender.pictures import put
from ..blender.sequences import Timing
from ..stage.stage import picture_size
from . import footage_file
from .footage_file import Source

# How footage of another shape fills the frame: the compositor's name by the camera's name.
_FILLS = {"STRETCH": "Stretch", "FIT": "Fit", "CROP": "Crop"}
# Footage is read at most so many times finer than the picture: enough for 8K in a preview.
_FINEST = 8
# The properties that an image's user and an image node of the compositor share.
TIMING = ("frame_duration", "frame_start", "frame_offset", "use_cyclic", "use_auto_refresh")


@dataclass(frozen=True)
class Footage:
    """A filmed picture, as the artist has set it up.

    source: an image or a movie clip; timing: an image's user or node, which decides the frame that
    is seen when, or None; fills: how the footage fills the frame, a key of `_FILLS`.
    """

    source: Source
    timing: Timing | None = None
    fills: str = "STRETCH"

    @property
    def name(self) -> str:
        return self.source.name

    def read(self, scene: bpy.types.Scene) -> NDArray[np.float32]:
        """Read the footage at the scene's frame -> (H, W, 3), scene-linear, the picture's size.

        The footage counts as opaque, whatever alpha the file has. Raises SceneError where the file
        of the frame is missing, damaged or of another size than the sequence, where Blender cannot
        read the footage, or where pixels are not finite.
        """
        self.check(scene)
        data, display = self._windows(scene)
        frame = _with_overscan(scene, display)
        if not data == display == frame:
            return self._placed(scene, data, frame)
        width, height = picture_size(scene)
        fine = _finer(_size(data), (width, height))
        found = self._composited(scene, (fine * width, fine * height), opaque=True)
        # Footage of another size fades out at its rim. Alpha was 1 before and fades out as well, so
        # dividing by alpha takes the fading back.
        covered = found[..., 3:]
        rgb = np.divide(
            found[..., :3], covered, out=np.zeros_like(found[..., :3]), where=covered > 0
        )
        if (
            not rgb.any()
            and not self._composited(scene, (width, height), opaque=False)[..., 3].any()
        ):
            # Blender gives no error for footage that it cannot read: it shows black without alpha.
            raise SceneError(
                f"Blender shows nothing of the footage '{self.name}' at frame "
                f"{scene.frame_current}: look whether its file is there and whole"
            )
        if bad := int((~np.isfinite(rgb)).any(axis=-1).sum()):
            raise SceneError(
                f"the footage '{self.name}' has {bad} pixels that are infinite or not a number: "
                "repair them, or choose another"
            )
        rgb = rgb.reshape(height, fine, width, fine, 3).mean(axis=(1, 3))
        return np.ascontiguousarray(rgb, np.float32)

    def _composited(
        self, scene: bpy.types.Scene, size: tuple[int, int], opaque: bool
    ) -> NDArray[np.float32]:
        """Have Blender's compositor bring the footage to a size -> (H, W, 4).

        size: width and height; opaque: set alpha to 1 before scaling.
        """
        with darkroom("ARTO Footage") as on:
            scale = on.tree.nodes.new("CompositorNodeScale")
            choose(scale, "Type", "Render Size")
            choose(scale, "Frame Type", _FILLS[self.fills])
            shown = self._picture(self._node(on.tree))
            if opaque:
                alpha = on.tree.nodes.new("CompositorNodeSetAlpha")
                choose(alpha, "Type", "Replace Alpha")
                alpha.inputs["Alpha"].default_value = 1.0
                on.tree.links.new(shown, alpha.inputs["Image"])
                shown = alpha.outputs[0]
            on.tree.links.new(shown, scale.inputs["Image"])
            on.scene.render.fps, on.scene.render.fps_base = scene.render.fps, scene.render.fps_base
            on.scene.frame_set(scene.frame_current, subframe=scene.frame_subframe)
            return on.composite(scale.outputs["Image"], size, "reading the footage")

    def _picture(self, node: bpy.types.Node) -> bpy.types.NodeSocket:
        """The socket of a node that gives the picture; for a file of layers, the whole picture.

        Raises SceneError where a file of layers has no such layer.
        """
        for name in ("Image", "Combined"):
            if name in node.outputs:
                return node.outputs[name]
        raise SceneError(
            f"the footage '{self.name}' is a file of layers, and none is a plain picture: write it "
            "with R, G, B at its root"
        )

    def _windows(self, scene: bpy.types.Scene) -> tuple[Box, Box]:
        """The data window and the display window of the footage.

        Blender shows only the data window of an EXR, wherever it stands in the display window.
        """
        file = self.file(scene)
        if file is not None and file.suffix.lower() == ".exr" and file.is_file():
            return exr.windows(file)
        width, height = _pixels(self.source, file)
        data = 0, 0, width - 1, height - 1
        return data, data

    def file(self, scene: bpy.types.Scene) -> Path | None:
        """The file that is shown at the scene's frame; None where the source is not such a file."""
        return footage_file.file_at(self.source, self.timing, scene.frame_current)

    def shown(self, scene: bpy.types.Scene) -> str:
        """The name of what is shown at the scene's frame: its file's, or the image's or clip's."""
        file = self.file(scene)
        return file.name if file else self.name

    def check(self, scene: bpy.types.Scene) -> str:
        """Look at the footage of the scene's frame without reading it into a picture.

        Returns a warning in words, or "". Raises SceneError where the file of the frame is missing
        or damaged, or is of another size than the sequence.
        """
        return footage_file.check(self.source, self.timing, scene.frame_current)

    def _placed(self, scene: bpy.types.Scene, data: Box, display: Box) -> NDArray[np.float32]:
        """Read footage whose data window is not its frame; black where the frame has no pixels."""
        found = self._alone(scene, _size(data))
        frame = np.zeros((*_size(display)[::-1], 4), np.float32)
        frame[..., 3] = 1
        mine, its = (
            tuple(
                slice(low - box[i], max(high + 1, low) - box[i])
                for i, low, high in (
                    (i, max(data[i], display[i]), min(data[i + 2], display[i + 2])) for i in (1, 0)
                )
            )
            for box in (display, data)
        )
        frame[mine] = found[its]
        image = put(f"ARTO {self.name}", frame)
        try:
            return Footage(image, None, self.fills).read(scene)
        finally:
            bpy.data.images.remove(image)

    def _alone(self, scene: bpy.types.Scene, size: tuple[int, int]) -> NDArray[np.float32]:
        """Read the pixels of the data window alone -> (H, W, 4), opaque.

        An EXR is read as an image, because Blender's compositor (5.2) shifts a data window that is
        not in the middle of its display window.
        """
        file = self.file(scene)
        if file is None or file.suffix.lower() != ".exr":
            return self._composited(scene, size, opaque=True)
        image = bpy.data.images.load(str(file))
        try:
            image.colorspace_settings.name = self.source.colorspace_settings.name
            if tuple(image.size) != size:
                raise SceneError(
                    f"the footage '{self.name}' is a file of layers whose pixels are others than "
                    "those of its frame: write it with R, G, B alone, or with all of its frame"
                )
            pixels = np.empty(4 * size[0] * size[1], np.float32)
            image.pixels.foreach_get(pixels)
        finally:
            bpy.data.images.remove(image)
        found = pixels.reshape(size[1], size[0], 4)[::-1].copy()
        found[..., 3] = 1
        return found

    def _node(self, tree: bpy.types.NodeTree) -> bpy.types.Node:
        if isinstance(self.source, bpy.types.MovieClip):
            node = tree.nodes.new("CompositorNodeMovieClip")
            node.clip = self.source
            return node
        node = tree.nodes.new("CompositorNodeImage")
        node.image = self.source
        if self.timing is not None and self.source.source in {"SEQUENCE", "MOVIE"}:
            for name in TIMING:
                setattr(node, name, getattr(self.timing, name))
        return node

    def missing(self) -> str:
        """The path of the footage's file where the file is missing; else empty."""
        image = self.source
        if image.source not in {"FILE", "MOVIE"} or getattr(image, "packed_file", None):
            return ""  # `check` looks at the files of a sequence, frame by frame.
        path = Path(bpy.path.abspath(image.filepath, library=image.library))
        return "" if path.is_file() else str(path)  # a pipe would be waited for


def _finer(there: tuple[int, int], wanted: tuple[int, int]) -> int:
    """How many times finer than the picture the footage is read, to be averaged afterwards.

    Blender itself would only pick some pixels of larger footage. there, wanted: width and height of
    the footage and of the picture.
    """
    times = min(has / needs for has, needs in zip(there, wanted, strict=True))
    return min(max(round(times), 1), _FINEST)


def _with_overscan(scene: bpy.types.Scene, frame: Box) -> Box:
    """Add the scene's overscan to the footage's frame, where it has the size without overscan."""
    more = scene.arto.overscan
    if _size(frame) != tuple(side - 2 * more for side in picture_size(scene)):
        return frame
    x0, y0, x1, y1 = frame
    return x0 - more, y0 - more, x1 + more, y1 + more


def _size(box: Box) -> tuple[int, int]:
    """The width and height of a box."""
    return box[2] - box[0] + 1, box[3] - box[1] + 1


def _pixels(source: Source, file: Path | None) -> tuple[int, int]:
    """The width and height of an image or clip; where Blender does not know them, of the file."""
    if min(source.size) or file is None or not file.is_file():
        return tuple(source.size)
    with contextlib.suppress(RuntimeError):  # `read` gives the error for a damaged file.
        image = bpy.data.images.load(str(file))
        try:
            return tuple(image.size)
        finally:
            bpy.data.images.remove(image)
    return 0, 0


def footage(scene: bpy.types.Scene) -> Footage | None:
    """Find the artist's footage; None where there is none.

    ARTO's setting comes first, then the camera's background, then the first image or clip in the
    scene's compositor. Raises SceneError where the file is missing, or where the camera's
    background is moved, turned, scaled or flipped.
    """
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
    """The timing of a sequence or movie in ARTO's setting: frame N shows picture N.

    An image does not know how many pictures its sequence has, so the duration is very long.
    `Footage.read` gives an error where a picture is missing.
    """

    frame_duration: int = 1_000_000
    frame_start: int = 1
    frame_offset: int = 0
    use_cyclic: bool = False
    use_auto_refresh: bool = True


def _behind_camera(scene: bpy.types.Scene) -> Footage | None:
    camera = camera_of(scene)
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
