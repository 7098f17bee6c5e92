"""Blender's compositor, borrowed for one picture: in a scene of its own, which goes afterwards."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ..work import Render, blocking_render
from .output import float_exr, write_to

# The kind of node that puts a scene's picture out.
OUTPUT = "NodeGroupOutput"


def compositor(scene: bpy.types.Scene) -> Any:
    """The tree of a scene's compositor, None where it has none."""
    return scene.compositing_node_group


def own_compositor(copy: bpy.types.Scene, made: list[Any]) -> Any:
    """The tree of a copied scene's compositor, made its own; noted in `made` where it must go."""
    copy.compositing_node_group = copy.compositing_node_group.copy()
    made.append(copy.compositing_node_group)
    return copy.compositing_node_group


class Studio:
    """scene: the borrowed one, with its tree; made: what goes with it; folder: of files."""

    def __init__(self, scene: bpy.types.Scene, tree: Any, made: list[Any], folder: Path) -> None:
        self.scene, self.tree, self.made, self.folder = scene, tree, made, folder

    def composite(self, socket: Any, size: tuple[int, int], text: str) -> NDArray[np.float32]:
        """What comes out of a socket of the tree, (H, W, 4), scene-linear, in full precision.

        size: width and height; text: what this is, where it is told. Raises CancelledError.
        """
        out = self.tree.nodes.new("NodeGroupOutput")
        self.tree.links.new(socket, out.inputs[0])
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
def studio(name: str) -> Iterator[Studio]:
    """A compositor to build a tree in."""
    scene = bpy.data.scenes.new(name)
    made: list[Any] = [scene]
    try:
        tree = bpy.data.node_groups.new(name, "CompositorNodeTree")
        made.append(tree)
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        scene.compositing_node_group = tree
        with tempfile.TemporaryDirectory() as folder:
            yield Studio(scene, tree, made, Path(folder))
    finally:
        bpy.data.batch_remove(made)
