"""The snapshot: the artist's file as it is in memory, saved for a job to work on.

It is a copy of the .blend with unsaved edits, in a folder of the job's own. Blender turns its
relative paths so that they lead to the same files; what it does not turn, the job does (`run`).
Images that were painted and not saved are in no file: their pixels lie beside it.
"""

from __future__ import annotations

import sys
from pathlib import Path

import bpy
import numpy as np

from ...core.errors import SceneError
from ..blender import devices
from .task import Painted, Task
from .verbs import Verb

# Not empty while a snapshot is saved: for who does something before a file of the artist's is.
taking: list[bool] = []


def take(folder: Path, verb: Verb, scene: bpy.types.Scene, view_layer: str) -> tuple[Path, Path]:
    """Save the snapshot and its task into `folder` -> (.blend, task). Raises SceneError.

    Nothing of the artist's changes: not the file's name, nor whether it has unsaved changes.
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
        painted = tuple(_painted(image, folder) for image in bpy.data.images if in_no_file(image))
        _link_caches(folder)
        ran = not bpy.app.autoexec_fail
        blend_of = bpy.data.filepath
        task = Task(verb, scene.name, view_layer, blend_of, devices.chosen(), painted, ran)
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
    """Whether an image was painted and not saved. Raises SceneError for one with tiles."""
    if not image.is_dirty or image.source not in {"FILE", "GENERATED", "TILED"}:
        return False
    if image.source == "TILED":
        raise SceneError(
            f"the image '{image.name}' has tiles that were painted and not saved: save it "
            "(Image Editor, Image, Save), then go on"
        )
    return True


def painted_pixels(image: bpy.types.Image, folder: Path) -> str:
    """Write an image's pixels into a folder -> the name of the .npy."""
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    name = f"painted_{image.session_uid}.npy"
    np.save(folder / name, pixels)
    return name


def _painted(image: bpy.types.Image, folder: Path) -> Painted:
    library = image.library.filepath if image.library else ""
    return Painted(image.name, library, painted_pixels(image, folder))


def _link_caches(folder: Path) -> None:
    """Caches of simulations lie beside the .blend, in a folder of its name."""
    if not bpy.data.filepath:
        return
    blend = Path(bpy.data.filepath)
    caches = blend.with_name(f"blendcache_{blend.stem}")
    if not caches.is_dir():
        return
    if sys.platform == "win32":
        import _winapi

        _winapi.CreateJunction(str(caches), str(folder / caches.name))
    else:
        (folder / caches.name).symlink_to(caches, target_is_directory=True)
