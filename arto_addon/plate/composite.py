"""The scene's composite without a render, for composites of plates, footage and other files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ...core.errors import SceneError
from ...core.files import whole
from ..blender.compositing import OUTPUT, composited, compositor, own_compositor
from ..blender.pictures import put
from ..work import Progress, Steps
from .names import relit_file
from .notes import note, noted

COMPOSITE = "ARTO Composite"
# The attribute of the key in the header of a plate.
KEY = "arto.light key"


def composite_file(scene: bpy.types.Scene) -> Path:
    """The path of the composite: beside the plate, with the ending of the scene's output format.

    Raises SceneError where the plate has no path.
    """
    plate = relit_file(scene)
    return plate.with_name(f"{plate.stem}_composite{scene.render.file_extension}")


def save_composite(scene: bpy.types.Scene, view_layer: str) -> Steps[Path]:
    """Write what the scene's compositor puts out; returns the file's path.

    This is for a job. Compositing replaces the last render, and in a job that is not the artist's.
    Raises SceneError where the scene has no compositor, or where the composite shows a render,
    which a job does not have.
    """
    tree = compositor(scene)
    if tree is None:
        raise SceneError("the scene has no compositor: press Relight first, which makes one")
    if needed := _renders(tree):
        raise SceneError(
            f"the composite shows the render ('{needed}'), and nothing is rendered here: set Use "
            "in Compositor to Instead of the Render, or press F12"
        )
    path = composite_file(scene)
    there = path.exists() and not path.is_symlink() and path.stat().st_size > 0
    if there and not scene.arto.overwrite and not said_of(scene):
        raise SceneError(
            f"{path} is there, and it is not what ARTO wrote: choose another output, or move it "
            "away (Write Over Other Files writes over it)"
        )
    yield Progress(0.1, "compositing")
    picture = _composited(scene)
    if bad := int((~np.isfinite(picture)).any(axis=-1).sum()):
        raise SceneError(
            f"the composite is infinite or not a number in {bad} pixels, so it was not written: "
            "look which node or which picture is so there"
        )
    image = put(COMPOSITE, picture)
    try:
        with whole(path) as partial:
            image.save_render(str(partial), scene=scene)
        _note(scene, path)
    except (OSError, RuntimeError) as e:
        raise SceneError(f"{path} cannot be written ({e})") from e
    finally:
        bpy.data.images.remove(image)
    yield Progress(1.0, f"wrote {path}")
    return path


def said_of(scene: bpy.types.Scene) -> Mapping[str, object]:
    """What was noted of the scene's composite; empty where it is missing, or not as it was written.

    `plate` is the key of the plate that it was made of. Other formats than EXR have no room for
    such notes, so they are in a file in ARTO's folder.
    """
    return noted(scene, composite_file(scene))


def _note(scene: bpy.types.Scene, path: Path) -> None:
    """Note what was written, and of which plate. Raises OSError."""
    plate = relit_file(scene)
    key = exr.header(plate).get(KEY, "") if plate.is_file() else ""
    note(scene, path, str(key))


def _composited(scene: bpy.types.Scene) -> NDArray[np.float32]:
    """Composite a copy of the scene -> (H, W, 4).

    In the copy, no node asks for a render or writes a file.
    """
    copy = scene.copy()
    made: list[bpy.types.ID] = [copy]
    try:
        copy.frame_set(scene.frame_current, subframe=scene.frame_subframe)
        tree = own_compositor(copy, made)
        for node in list(tree.nodes):
            if node.bl_idname in {"CompositorNodeRLayers", "CompositorNodeOutputFile"}:
                tree.nodes.remove(node)
        return composited(copy, "the composite")
    finally:
        bpy.data.batch_remove(made)


def _renders(tree: bpy.types.NodeTree) -> str:
    """The name of a node that shows a render and leads to the output; empty for none."""
    found: list[bpy.types.Node] = [n for n in tree.nodes if n.bl_idname == OUTPUT]
    seen = set()
    while found:
        node = found.pop()
        if node.name in seen or node.mute:
            continue
        seen.add(node.name)
        if node.bl_idname == "CompositorNodeRLayers":
            return node.name
        found += [link.from_node for socket in node.inputs for link in socket.links]
    return ""
