"""The snapshot: the artist's file as it is in memory, saved for a job to work on.

The snapshot is a copy of the .blend with its unsaved edits, in the job's own folder. Blender
rewrites relative paths so that they lead to the same files. The job rewrites those that Blender
leaves (`run`). Images that were painted and not saved are in no file: their pixels are written
beside the snapshot.
"""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import arrays, marked
from ...core.errors import SceneError
from ..blender import devices
from ..blender.pictures import is_picture
from ..blender.saving import check_whole
from ..shot import home
from .task import Painted, Task
from .verbs import Verb

# Not empty while a snapshot is saved. Handlers that act before the artist saves look here first.
taking: list[bool] = []


def take(folder: Path, verb: Verb, scene: bpy.types.Scene, view_layer: str) -> tuple[Path, Path]:
    """Save the snapshot and its task into `folder` -> paths of (.blend, task). Raises SceneError.

    The open file keeps its name, and still counts as changed if it was.
    """
    blend = folder / (Path(bpy.data.filepath).name or "untitled.blend")
    packing = bpy.data.use_autopack
    taking[:] = [True]
    try:
        bpy.data.use_autopack = False  # packing would change the artist's images
        bpy.ops.wm.save_as_mainfile(
            filepath=str(blend),
            copy=True,
            relative_remap=True,
            compress=False,
            check_existing=False,
        )
        check_whole(blend)
        painted = tuple(_painted(image, folder) for image in bpy.data.images if in_no_file(image))
        _link_caches(folder)
        ran = not bpy.app.autoexec_fail
        blend_of = bpy.data.filepath
        task = Task(
            verb,
            scene.name,
            view_layer,
            blend_of,
            devices.chosen(),
            painted,
            ran,
            home.library_of(scene),
        )
        return blend, task.write(folder)
    except (OSError, RuntimeError) as e:
        raise SceneError(
            f"a copy of the scene to work on cannot be written to {folder} ({e}): make room on the "
            "disk, or choose another folder in ARTO's settings"
        ) from e
    finally:
        bpy.data.use_autopack = packing
        taking.clear()


def in_no_file(image: bpy.types.Image) -> bool:
    """Whether an image was painted and not saved. Raises SceneError if such an image has tiles."""
    if (
        not image.is_dirty
        or is_picture(image)
        or image.source not in {"FILE", "GENERATED", "TILED"}
    ):
        return False
    if image.source == "TILED":
        raise SceneError(
            f"the image '{image.name}' has tiles that were painted and not saved: save it "
            "(Image Editor, Image, Save), then go on"
        )
    return True


def pixels_of(image: bpy.types.Image) -> NDArray[np.float32]:
    """An image's pixels, one after the other, as Blender has them."""
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    return pixels


def put_pixels(image: bpy.types.Image, path: Path) -> None:
    """Give an image the pixels that `_painted` wrote. Raises SceneError."""
    try:
        pixels = arrays.read(path, 4 * len(image.pixels))
        if pixels.shape != (len(image.pixels),) or pixels.dtype != np.float32:
            raise ValueError(f"it has not the pixels of '{image.name}'")
    except (OSError, ValueError) as e:
        raise SceneError(f"{path} cannot be read ({e}): start the work again") from e
    image.pixels.foreach_set(pixels)
    image.update()


def _painted(image: bpy.types.Image, folder: Path) -> Painted:
    name = f"painted_{image.session_uid}.npy"
    arrays.write(folder / name, pixels_of(image))
    return Painted(image.name, home.library_of(image), name)


def _link_caches(folder: Path) -> None:
    """Link the simulation caches, a folder beside the .blend, to where the snapshot is."""
    if not bpy.data.filepath:
        return
    blend = Path(bpy.data.filepath)
    caches = blend.with_name(f"blendcache_{blend.stem}")
    if not caches.is_dir():
        return
    link_folder(caches, folder / caches.name)


def link_folder(source: Path, link: Path) -> None:
    """Make a link to a folder. Raises SceneError where the system cannot."""
    try:
        if sys.platform == "win32":
            import _winapi

            # no right is needed for a junction, but it leads to disks of this machine alone
            with contextlib.suppress(OSError):
                _winapi.CreateJunction(str(source), str(link))
                return
            with contextlib.suppress(OSError):
                marked.remove_empty(link)  # what a junction that failed has left
        link.symlink_to(source, target_is_directory=True)
    except (OSError, NotImplementedError) as e:
        raise SceneError(
            f"the simulation caches in {source} cannot be linked to ({e}): Windows does so for "
            "folders on its own disks alone; copy the .blend and its caches to one of these"
        ) from e
