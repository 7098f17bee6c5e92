"""Blender's compositor: a scene's own, and one that is borrowed for a picture.

From Blender 5 on, a scene's compositor is a node group with an output. Before, it is a tree of the
scene with a Composite node. Blender 5 also turned some settings of nodes into sockets.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ..work import Render, blocking_render
from .output import float_exr, write_to
from .scratch import temporary
from .version import FIVE

# The kind of node that puts out a scene's picture.
OUTPUT = "NodeGroupOutput" if FIVE else "CompositorNodeComposite"
# By node and socket: the setting that Blender 4.5 has in the place of the socket.
_SETTINGS = {
    ("CompositorNodeDenoise", "Prefilter"): "prefilter",
    ("CompositorNodeScale", "Type"): "space",
    ("CompositorNodeScale", "Frame Type"): "frame_method",
    ("CompositorNodeSetAlpha", "Type"): "mode",
    ("CompositorNodeBlur", "Type"): "filter_type",
}


def choose(node: bpy.types.Node, menu: str, choice: str) -> None:
    """Choose an entry of a node's menu. Menu and choice are the names that the artist reads."""
    if FIVE:
        node.inputs[menu].default_value = choice
    else:
        setattr(node, _SETTINGS[node.bl_idname, menu], choice.upper().replace(" ", "_"))


def compositor(scene: bpy.types.Scene) -> bpy.types.NodeTree | None:
    """The tree of a scene's compositor; None where the scene has no compositor."""
    return scene.compositing_node_group if FIVE else scene.node_tree


def turned_off(scene: bpy.types.Scene) -> bool:
    """Whether a scene has a compositor and does not use it: Use Nodes is off, before Blender 5."""
    return not FIVE and scene.node_tree is not None and not scene.use_nodes


def new_compositor(scene: bpy.types.Scene, name: str) -> bpy.types.NodeTree:
    """Give the scene an empty compositor, and return the compositor's tree.

    name: the tree's name, used from Blender 5 on.
    """
    if FIVE:
        tree = bpy.data.node_groups.new(name, "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        scene.compositing_node_group = tree
        return tree
    scene.use_nodes = True
    scene.node_tree.nodes.clear()
    return scene.node_tree


def add_output(tree: bpy.types.NodeTree) -> bpy.types.Node:
    """Add the output to a scene's compositor: a node that puts out what its input 'Image' gets."""
    return tree.nodes.new(OUTPUT)


def mixed(
    tree: bpy.types.NodeTree, how: str, one: bpy.types.NodeSocket, other: bpy.types.NodeSocket
) -> bpy.types.NodeSocket:
    """Add a node that mixes two colours in a compositor tree, and return its output socket.

    how: Blender's name of the blend type, ADD or MULTIPLY.
    """
    node = tree.nodes.new("ShaderNodeMix")
    node.data_type, node.blend_type, node.clamp_factor = "RGBA", how, False
    sockets = [s for s in node.inputs if s.enabled]
    sockets[0].default_value = 1.0
    for socket in sockets[1:]:
        # A layer that is gone from the file has no link any more: it then adds black.
        socket.default_value = (0, 0, 0, 1)
    tree.links.new(one, sockets[1])
    tree.links.new(other, sockets[2])
    return next(s for s in node.outputs if s.enabled)


def places_of_groups() -> Iterator[bpy.types.NodeTree]:
    """Yield every tree that may contain a node group of the compositor."""
    yield from bpy.data.node_groups
    if not FIVE:
        yield from (s.node_tree for s in bpy.data.scenes if s.node_tree)


def own_compositor(copy: bpy.types.Scene, made: list[bpy.types.ID]) -> bpy.types.NodeTree:
    """Give a copied scene a compositor tree of its own, and return the tree.

    A tree that must be removed with the scene is added to `made`.
    """
    if not FIVE:
        return copy.node_tree  # Blender has copied the tree with the scene.
    copy.compositing_node_group = copy.compositing_node_group.copy()
    made.append(copy.compositing_node_group)
    return copy.compositing_node_group


class Darkroom:
    """A borrowed compositor.

    scene, tree: the borrowed scene and its compositor's tree; made: the data-blocks that are
    removed at the end; folder: for files, also removed at the end.
    """

    def __init__(
        self,
        scene: bpy.types.Scene,
        tree: bpy.types.NodeTree,
        made: list[bpy.types.ID],
        folder: Path,
    ) -> None:
        self.scene, self.tree, self.made, self.folder = scene, tree, made, folder

    def composite(
        self, socket: bpy.types.NodeSocket | None, size: tuple[int, int], text: str
    ) -> NDArray[np.float32]:
        """Composite what a socket of the tree gives -> (H, W, 4), scene-linear, full precision.

        size: width and height; text: what the progress line says. Raises CancelledError.
        """
        self.tree.links.new(socket, add_output(self.tree).inputs[0])
        render = self.scene.render
        render.engine = "CYCLES"
        render.resolution_x, render.resolution_y = size
        render.resolution_percentage = 100
        return composited(self.scene, text)


def composited(scene: bpy.types.Scene, text: str) -> NDArray[np.float32]:
    """Composite what a scene's compositor puts out -> (H, W, 4), scene-linear, full precision.

    The settings of the scene are changed, so give a scene that is thrown away. Raises
    CancelledError.
    """
    render = scene.render
    render.use_compositing = True
    render.compositor_device, render.compositor_precision = "CPU", "FULL"
    float_exr(render, multilayer=False)
    with temporary() as folder:
        path = folder / "composite.exr"
        write_to(render, path)
        request = Render(scene.name, 0, text)
        blocking_render(request)
        request.check()
        return next(iter(exr.read(path).values()))


@contextmanager
def darkroom(name: str) -> Iterator[Darkroom]:
    """Borrow a compositor in which to build a tree; all that was made is removed at the end."""
    scene = bpy.data.scenes.new(name)
    made: list[bpy.types.ID] = [scene]
    try:
        tree = new_compositor(scene, name)
        if not tree.is_embedded_data:
            made.append(tree)
        with temporary() as folder:
            yield Darkroom(scene, tree, made, folder)
    finally:
        bpy.data.batch_remove(made)
