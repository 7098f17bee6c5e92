"""Compare the plate with the last render: side by side, or with a wipe between them."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ...core.errors import SceneError
from ..blender.output import borrowed
from ..blender.pictures import of_name, put
from ..blender.scratch import temporary
from .names import relit_file

IMAGE = "ARTO Compare"
# Plate and render by the scene's `session_uid`, kept so that moving the wipe reads no files.
_pictures: dict[int, tuple[NDArray[np.float32], NDArray[np.float32]]] = {}


def begin(scene: bpy.types.Scene) -> bpy.types.Image:
    """Read plate and render, and compare them -> the image that shows both.

    Raises SceneError where there is no plate or no render, or where their sizes differ.
    """
    path = relit_file(scene)
    if not path.is_file():
        raise SceneError("there is no plate to compare: press Relight first")
    plate = next(iter(exr.read(path).values()))
    render = _last_render(scene)
    if render.shape[:2] != plate.shape[:2]:
        raise SceneError(
            f"the last render is {render.shape[1]} x {render.shape[0]}, the plate "
            f"{plate.shape[1]} x {plate.shape[0]}: render the shot at the plate's size"
        )
    _pictures[scene.session_uid] = plate, render
    if scene.arto.compare == "OFF":
        scene.arto.compare = "SIDE"
    return update(scene) or bpy.data.images[IMAGE]


def _last_render(scene: bpy.types.Scene) -> NDArray[np.float32]:
    """Read the last render of a scene -> (H, W, 4). Raises SceneError where there is none."""
    result = next((i for i in bpy.data.images if i.type == "RENDER_RESULT"), None)
    if result is None:
        raise SceneError("nothing was rendered yet: press F12 once, then Compare")
    with temporary() as folder, borrowed(scene.render):
        path = folder / "render.exr"
        try:
            # Blender gives out the render of the scene that is named here, and of no other.
            result.save_render(str(path), scene=scene)
        except RuntimeError as e:
            raise SceneError(
                f"there is no render of '{scene.name}' to compare with: set Use in Compositor to "
                f"In a Viewer, press F12, then Compare ({e})"
            ) from e
        return next(iter(exr.read(path).values()))


def update(scene: bpy.types.Scene) -> bpy.types.Image | None:
    """Show the comparison by the settings as they are now; None where no comparison was begun."""
    found = _pictures.get(scene.session_uid)
    if found is None:
        return None
    plate, render = found
    return put(IMAGE, joined(plate, render, scene.arto.compare, scene.arto.wipe))


def joined(plate: NDArray, render: NDArray, how: str, wipe: float) -> NDArray[np.float32]:
    """Join two pictures (H, W, 4) of the same size in one.

    how: an item of the setting `compare`; wipe: the plate's share of the width, for WIPE.
    """
    width = plate.shape[1]
    if how == "SIDE":
        # The middle half of each picture, not scaled.
        half = width // 2
        left = (width - half) // 2
        return np.concatenate(
            [plate[:, left : left + half], render[:, left : left + width - half]], axis=1
        ).astype(np.float32)
    share = {"OFF": 1.0, "RENDER": 0.0}.get(how, wipe)
    border = round(share * width)
    out = np.concatenate([plate[:, :border], render[:, border:]], axis=1).astype(np.float32)
    if 0 < border < width:
        out[:, border] = (1, 1, 1, 1)
    return out


def forget() -> None:
    """Let go of all compared pictures, and remove the image that shows them."""
    _pictures.clear()
    image = of_name(IMAGE)
    if image is not None:
        bpy.data.images.remove(image)
