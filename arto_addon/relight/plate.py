"""The relit plate in Blender: an EXR, an image that shows it, and a compositor node group."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ..shot import paths
from .header import header

IMAGE = "ARTO Relit"
# The image node in a plate's group.
SOURCE = "ARTO Relit"


def write(
    scene: bpy.types.Scene, path: Path, picture: NDArray[np.float32], about: dict[str, str]
) -> None:
    """Write the plate: (H, W, 4) scene-linear, premultiplied. The header names its colour space,
    and has what Blender's own render of the scene would have in it."""
    space = bpy.data.colorspace.working_space
    attributes = header(scene) | {f"arto.{k}": v for k, v in about.items()}
    exr.write(path, {"": picture}, attributes, space)


def name_of(scene: bpy.types.Scene, look: str | None = None) -> str:
    """The name of the plate's image and node group: of this scene and look, and no other's."""
    name = paths.relit_name(scene, look)
    return f"ARTO {name}" if name else IMAGE


def present(scene: bpy.types.Scene, path: Path, look: str | None = None) -> bpy.types.Image:
    """Show a plate that was written: its image, and its node in the scene's compositor.

    look: that it was made for (default: the scene's now). In the window that is one step that can
    be undone.
    """
    name = name_of(scene, look)
    image = show(path, name)
    if wire(scene, node_group(image, name)) is None:
        tree = scene.compositing_node_group.name
        print(f"ARTO: the compositor '{tree}' is linked and stays as it is: add '{name}' to it")
    if not bpy.app.background and bpy.context.window_manager.windows:
        bpy.ops.ed.undo_push(message="Relight")
    return image


def present_frames(
    scene: bpy.types.Scene, first: Path, frames: Sequence[int], look: str | None = None
) -> bpy.types.Image:
    """Show plates of frames, numbered as `many` numbers them, as a sequence: an image and its node,
    which at each frame of the scene show that frame's.

    first: the first frame's file. They stand beside the plate of a single frame.
    """
    name = f"{name_of(scene, look)} Frames"
    image = show(first, name)
    image.source = "SEQUENCE"
    group = node_group(image, name)
    if source := group.nodes.get(SOURCE):
        source.frame_duration = frames[-1] - frames[0] + 1
        source.frame_start = frames[0]
        # a sequence counts its files from 1
        source.frame_offset = frames[0] - 1
        source.use_auto_refresh = True
    wire(scene, group)
    return image


def show(path: Path, name: str = IMAGE) -> bpy.types.Image:
    """The image data-block of a plate, loaded anew."""
    image = bpy.data.images.get(name)
    relative = bpy.path.relpath(str(path)) if bpy.data.filepath else str(path)
    if image is None:
        image = bpy.data.images.load(str(path))
        image.name = name
    image.source = "FILE"
    image.filepath = relative
    image.reload()
    image.colorspace_settings.name = bpy.data.colorspace.working_space
    image.alpha_mode = "PREMUL"
    # the image editor shows it as it shows a render: exposure, AgX
    image.use_view_as_render = True
    # the node group is enough of a user only once it is there
    image.use_fake_user = True
    return image


def node_group(image: bpy.types.Image, name: str = IMAGE) -> Any:
    """The compositor node group that shows a plate; made once, then kept up to date."""
    tree = bpy.data.node_groups.get(name)
    if tree is None or tree.bl_idname != "CompositorNodeTree":
        tree = bpy.data.node_groups.new(name, "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        tree.interface.new_socket("Alpha", in_out="OUTPUT", socket_type="NodeSocketFloat")
        source = tree.nodes.new("CompositorNodeImage")
        source.name = SOURCE
        out = tree.nodes.new("NodeGroupOutput")
        out.location = (300, 0)
        tree.links.new(source.outputs["Image"], out.inputs["Image"])
        tree.links.new(source.outputs["Alpha"], out.inputs["Alpha"])
    source = tree.nodes.get(SOURCE)
    if source:
        source.image = image
    return tree


def wire(scene: bpy.types.Scene, group: Any) -> Any:
    """Put the node group into the scene's compositor, seen through the viewer; return its node.

    What the compositor puts out stays what it was: an artist's tree gains the node, and a viewer
    if it had none; a scene without a compositor gets one that passes its render on. A tree linked
    from a library is left alone (-> None): the plate's node group can be added where it is made.
    """
    tree = scene.compositing_node_group
    if tree is None:
        tree = bpy.data.node_groups.new("ARTO Compositor", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        render = tree.nodes.new("CompositorNodeRLayers")
        render.scene = scene
        out = tree.nodes.new("NodeGroupOutput")
        out.location = (500, 0)
        tree.links.new(render.outputs["Image"], out.inputs["Image"])
        scene.compositing_node_group = tree
    if not tree.is_editable:
        return None  # a library's: an edit of it would be gone with the next save
    node = next(
        (n for n in tree.nodes if n.bl_idname == "CompositorNodeGroup" and n.node_tree == group),
        None,
    )
    if node is None:
        below = min((n.location.y - max(n.height, 200) for n in tree.nodes), default=0.0)
        node = tree.nodes.new("CompositorNodeGroup")
        node.node_tree = group
        node.label = group.name
        node.width = 200
        node.location = (0, below - 40)
        if not any(n.bl_idname == "CompositorNodeViewer" for n in tree.nodes):
            viewer = tree.nodes.new("CompositorNodeViewer")
            viewer.location = (node.location.x + 500, node.location.y)
            tree.links.new(node.outputs["Image"], viewer.inputs["Image"])
    return node
