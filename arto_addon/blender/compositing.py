"""Blender's compositor: a scene's own, and one that is borrowed for a picture.

From Blender 5 on a scene's compositor is a node group with an output, before it is a tree of the
scene's with a Composite node; and what were settings of nodes became sockets.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ..work import Render, blocking_render
from .output import float_exr, write_to
from .version import FIVE

# The kind of node that puts a scene's picture out.
OUTPUT = "NodeGroupOutput" if FIVE else "CompositorNodeComposite"
# By node and socket: the setting that Blender 4.5 has in the place of a menu.
_SETTINGS = {
    ("CompositorNodeDenoise", "Prefilter"): "prefilter",
    ("CompositorNodeScale", "Type"): "space",
    ("CompositorNodeScale", "Frame Type"): "frame_method",
    ("CompositorNodeSetAlpha", "Type"): "mode",
    ("CompositorNodeBlur", "Type"): "filter_type",
}


def choose(node: bpy.types.Node, menu: str, choice: str) -> None:
    """Choose of a node's menu, both by the names that the artist reads."""
    if FIVE:
        node.inputs[menu].default_value = choice
    else:
        setattr(node, _SETTINGS[node.bl_idname, menu], choice.upper().replace(" ", "_"))


def compositor(scene: bpy.types.Scene) -> bpy.types.NodeTree | None:
    """The tree of a scene's compositor, None where it has none."""
    return scene.compositing_node_group if FIVE else scene.node_tree


def turned_off(scene: bpy.types.Scene) -> bool:
    """Whether a scene has a compositor that it does not use: Use Nodes, before Blender 5."""
    return not FIVE and scene.node_tree is not None and not scene.use_nodes


def new_compositor(scene: bpy.types.Scene, name: str) -> bpy.types.NodeTree:
    """An empty tree as the scene's compositor; its name is seen from Blender 5 on."""
    if FIVE:
        tree = bpy.data.node_groups.new(name, "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        scene.compositing_node_group = tree
        return tree
    scene.use_nodes = True
    scene.node_tree.nodes.clear()
    return scene.node_tree


def add_output(tree: bpy.types.NodeTree) -> bpy.types.Node:
    """The node of a scene's compositor that puts out what is linked to its input 'Image'."""
    return tree.nodes.new(OUTPUT)


def mixed(
    tree: bpy.types.NodeTree, how: str, one: bpy.types.NodeSocket, other: bpy.types.NodeSocket
) -> bpy.types.NodeSocket:
    """The sum or product of two colours in a compositor tree, a socket."""
    node = tree.nodes.new("ShaderNodeMix")
    node.data_type, node.blend_type, node.clamp_factor = "RGBA", how, False
    sockets = [s for s in node.inputs if s.enabled]
    sockets[0].default_value = 1.0
    for socket in sockets[1:]:
        # what is shown of a layer that is gone
        socket.default_value = (0, 0, 0, 1)
    tree.links.new(one, sockets[1])
    tree.links.new(other, sockets[2])
    return next(s for s in node.outputs if s.enabled)


def places_of_groups() -> Iterator[bpy.types.NodeTree]:
    """Every tree that may have a compositor's node group in it."""
    yield from bpy.data.node_groups
    if not FIVE:
        yield from (s.node_tree for s in bpy.data.scenes if s.node_tree)


def own_compositor(copy: bpy.types.Scene, made: list[bpy.types.ID]) -> bpy.types.NodeTree:
    """The tree of a copied scene's compositor, made its own; noted in `made` where it must go."""
    if not FIVE:
        return copy.node_tree  # which was copied with it
    copy.compositing_node_group = copy.compositing_node_group.copy()
    made.append(copy.compositing_node_group)
    return copy.compositing_node_group


class Darkroom:
    """scene: the borrowed one, with its tree; made: what goes with it; folder: of files."""

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
        """What comes out of a socket of the tree, (H, W, 4), scene-linear, in full precision.

        size: width and height; text: what this is, where it is told. Raises CancelledError.
        """
        self.tree.links.new(socket, add_output(self.tree).inputs[0])
        render = self.scene.render
        render.engine = "CYCLES"
        render.resolution_x, render.resolution_y = size
        render.resolution_percentage = 100
        return composited(self.scene, text)


def composited(scene: bpy.types.Scene, text: str) -> NDArray[np.float32]:
    """What a scene's compositor puts out, (H, W, 4), scene-linear, in full precision.

    The scene is one to throw away: its settings are changed. Raises CancelledError.
    """
    render = scene.render
    render.use_compositing = True
    render.compositor_device, render.compositor_precision = "CPU", "FULL"
    float_exr(render, multilayer=False)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "composite.exr"
        write_to(render, path)
        request = Render(scene.name, 0, text)
        blocking_render(request)
        request.check()
        return next(iter(exr.read(path).values()))


@contextmanager
def darkroom(name: str) -> Iterator[Darkroom]:
    """A compositor to build a tree in."""
    scene = bpy.data.scenes.new(name)
    made: list[bpy.types.ID] = [scene]
    try:
        tree = new_compositor(scene, name)
        if not tree.is_embedded_data:
            made.append(tree)
        with tempfile.TemporaryDirectory() as folder:
            yield Darkroom(scene, tree, made, Path(folder))
    finally:
        bpy.data.batch_remove(made)
