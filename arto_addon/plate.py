"""The relit plate in Blender: an EXR, an image that shows it, and a compositor node group."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core import exr

IMAGE = "ARTO Relit"
GROUP = "ARTO Relit"


def write(path: Path, picture: NDArray[np.float32], about: dict[str, str]) -> None:
    """Write the plate: (H, W, 4) scene-linear, premultiplied; the header names its colour space."""
    space = bpy.data.colorspace.working_space
    exr.write(path, {"": picture}, {f"arto.{k}": v for k, v in about.items()}, space)


def show(path: Path) -> bpy.types.Image:
    """The image data-block of the plate, loaded anew."""
    image = bpy.data.images.get(IMAGE)
    relative = bpy.path.relpath(str(path)) if bpy.data.filepath else str(path)
    if image is None:
        image = bpy.data.images.load(str(path))
        image.name = IMAGE
    image.source = "FILE"
    image.filepath = relative
    image.reload()
    image.colorspace_settings.name = bpy.data.colorspace.working_space
    image.alpha_mode = "PREMUL"
    # the node group is enough of a user only once it is there
    image.use_fake_user = True
    return image


def node_group(image: bpy.types.Image) -> Any:
    """The compositor node group that shows the plate; made once, then kept up to date."""
    tree = bpy.data.node_groups.get(GROUP)
    if tree is None or tree.bl_idname != "CompositorNodeTree":
        tree = bpy.data.node_groups.new(GROUP, "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        tree.interface.new_socket("Alpha", in_out="OUTPUT", socket_type="NodeSocketFloat")
        source = tree.nodes.new("CompositorNodeImage")
        source.name = IMAGE
        out = tree.nodes.new("NodeGroupOutput")
        out.location = (300, 0)
        tree.links.new(source.outputs["Image"], out.inputs["Image"])
        tree.links.new(source.outputs["Alpha"], out.inputs["Alpha"])
    source = tree.nodes.get(IMAGE)
    if source:
        source.image = image
    return tree


def wire(scene: bpy.types.Scene, group: Any) -> Any:
    """Put the node group into the scene's compositor, and return its node.

    An artist's own tree only gains the node; its links are left alone, except that an output that
    nothing feeds is fed. A scene without a compositor gets one that shows the plate.
    """
    tree = scene.compositing_node_group
    if tree is None:
        tree = bpy.data.node_groups.new("ARTO Compositor", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        scene.compositing_node_group = tree
    node = next(
        (n for n in tree.nodes if n.bl_idname == "CompositorNodeGroup" and n.node_tree == group),
        None,
    )
    if node is None:
        below = min((n.location.y - n.height for n in tree.nodes), default=0.0)
        node = tree.nodes.new("CompositorNodeGroup")
        node.node_tree = group
        node.label = GROUP
        node.location = (0, below - 40 if len(tree.nodes) > 1 else 0)
    if tree.nodes.active is None:
        tree.nodes.active = node
    out = next((n for n in tree.nodes if n.bl_idname == "NodeGroupOutput"), None)
    if out is None:
        out = tree.nodes.new("NodeGroupOutput")
        out.location = (node.location.x + 400, node.location.y)
    if len(out.inputs) and not any(s.is_linked for s in out.inputs):
        tree.links.new(node.outputs["Image"], out.inputs[0])
    if not any(n.bl_idname == "CompositorNodeViewer" for n in tree.nodes):
        viewer = tree.nodes.new("CompositorNodeViewer")
        viewer.location = (node.location.x + 400, node.location.y - 150)
        tree.links.new(node.outputs["Image"], viewer.inputs["Image"])
    return node
