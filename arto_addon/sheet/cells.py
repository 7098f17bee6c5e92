"""The cells of a contact sheet: which plates it shows, which of them are to be made, and each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ...core.errors import SceneError
from ...core.exr.window import PICTURE
from ..blender.display import displayed
from ..blender.markers import camera_of
from ..capture.sequence import frame_kept
from ..plate import plate
from ..plate.footage import footage
from ..relight import ahead
from ..relight.ahead import Wanted
from ..relight.light_key import HEADER, light_key
from ..relight.many import lit_by
from ..world.check import check_world
from .layout import GREY, smaller


@dataclass(frozen=True)
class Cell:
    """A plate on a sheet.

    light: the name of its look or world; key: its light key; picture: (H, W, 3), as on the screen.
    """

    path: Path
    light: str
    camera: str
    frame: int
    key: str
    picture: NDArray[np.float32]


@contextmanager
def through(scene: bpy.types.Scene, view_layer: str, camera: str) -> Iterator[str]:
    """Look through a camera of the scene -> its name where it is another one than the scene's.

    camera: its name, empty for the scene's own. Raises SceneError where it cannot be looked
    through.
    """
    before = scene.camera
    if not camera or (before is not None and camera == before.name):
        yield ""
        return
    found = scene.objects.get(camera)
    if found is None or found.type != "CAMERA":
        raise SceneError(f"the scene has no camera '{camera}': name one that it has")
    if any(marker.camera for marker in scene.timeline_markers):
        raise SceneError(
            "markers in the timeline say which camera renders which frame: name frames in place "
            "of cameras"
        )
    scene.camera = found
    try:
        scene.view_layers[view_layer].update()
        yield camera
    finally:
        scene.camera = before
        scene.view_layers[view_layer].update()


def wanted(
    scene: bpy.types.Scene, worlds: Sequence[Path], frames: Sequence[int], camera: str
) -> list[Wanted]:
    """List the plates of a camera: of maps from files, of the looks, or of the scene's own world.

    camera: see `ahead.wanted`. Raises SceneError where the plates have no place to go.
    """
    if not worlds and any(look.world for look in scene.arto.looks):
        return ahead.wanted_looks(scene, frames, camera)
    return ahead.wanted(scene, worlds, 1, frames, camera)


def to_make(scene: bpy.types.Scene, view_layer: str, some: Sequence[Wanted]) -> list[Wanted]:
    """Those of the plates that are missing or out of date. Raises what `ahead.shown_at` raises."""
    out, still = [], None
    with frame_kept(scene):
        for frame in dict.fromkeys(one.frame for one in some):
            if frame is not None:
                scene.frame_set(frame)
            scene.view_layers[view_layer].update()
            still = ahead.shown_at(scene, view_layer, still)
            for one in (one for one in some if one.frame == frame):
                if not one.path.is_file():
                    out.append(one)
                    continue
                with ExitStack() as lent:
                    world = lit_by(lent, scene, view_layer, one) or check_world(scene, view_layer)
                    key = light_key(scene, world, view_layer, still.field, still.scene_key())
                if exr.header(one.path).get(HEADER) != key:
                    out.append(one)
    return out


def cell_of(scene: bpy.types.Scene, view_layer: str, one: Wanted, width: int | None = None) -> Cell:
    """Read a plate, and show it as the scene shows renders. width: the most that it may have.

    A plate over footage is shown in it. Raises ExrError where a file is missing or damaged.
    """
    header = exr.header(one.path)
    with frame_kept(scene):
        if one.frame is not None:
            scene.frame_set(one.frame)
        filmed = footage(scene) is not None and plate.comp_file(one.path).is_file()
        camera, frame = camera_of(scene), scene.frame_current
    source = plate.comp_file(one.path) if filmed else one.path
    light = framed(source)
    if width is not None:
        light = smaller(light, width)
    alpha = np.clip(light[..., 3:4], 0, 1) if light.shape[-1] > 3 else np.ones_like(light[..., :1])
    # Blender shows the colour that the pixel's part has, over what is behind
    part = np.where(alpha > 1e-4, alpha, 1)
    picture = displayed(scene, light[..., :3] / part) * alpha + GREY * (1 - alpha)
    name = one.file.stem if one.file else one.look or check_world(scene, view_layer).name
    key = str(header.get(HEADER, ""))
    seen_by = camera.name if camera else ""
    return Cell(one.path, name, seen_by, frame, key, picture.astype(np.float32))


def framed(path: Path) -> NDArray[np.float32]:
    """Read what a plate has of its display window -> (H, W, C), without its overscan."""
    found = np.asarray(next(iter(exr.read(path).values())), np.float32)
    (left, top, *_), (x, y, right, bottom) = exr.windows(path)
    whole = exr.header(path).get(PICTURE, (x, y))[:2]
    # what is read begins with the overscan: see `core.exr.window.place`
    left, top = (min(a) for a in zip((left, top), (x, y), whole, strict=True))
    return found[y - top : bottom - top + 1, x - left : right - left + 1]
