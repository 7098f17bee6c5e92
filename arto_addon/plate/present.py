"""Showing a plate in the scene's compositor."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import bpy

from ...core import exr
from ..blender.compositing import add_output, compositor, new_compositor, turned_off
from ..shot.shot import layer_of
from .mixer import mixer
from .plate import (
    CATCHER,
    LAYERS,
    SHARE,
    SOURCE,
    layers_file,
    name_of,
    node_group,
    share_file,
    show,
    shown_file,
)

# What the name of a plate's mixer has after the plate's.
MIX = " Mix"
# On a node of ours: the links that it took over, as JSON.
TAKEN = "arto_taken"


def present(scene: bpy.types.Scene, path: Path, look: str | None = None) -> bpy.types.Image:
    """Show a plate that was written: its image, and its node in the scene's compositor.

    look: that it was made for (default: the scene's now). In the window that is one step that can
    be undone.
    """
    name = name_of(scene, look)
    header = exr.header(path)
    image, share = show(shown_file(path, header), name), None
    if CATCHER in header:
        share = show(shown_file(share_file(path), header), f"{name} Catcher")
    if LAYERS in header:
        wire(scene, mixer(shown_file(layers_file(path), header), name + MIX, share))
    node = wire(scene, node_group(image, name, share))
    if node is not None:
        use(scene)
    elif tree := compositor(scene):
        print(
            f"ARTO: the compositor '{tree.name}' is linked and stays as it is: add '{name}' to it"
        )
    if turned_off(scene):
        print(f"ARTO: the scene's compositor is off: turn Use Nodes on in it to see '{name}'")
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
    name, header = f"{name_of(scene, look)} Frames", exr.header(first)
    image = show(shown_file(first, header), name)
    share = None
    if CATCHER in header:
        share = show(share_file(first), f"{name} Catcher")
    group = node_group(image, name, share)
    for image_of, node in ((image, SOURCE), (share, SHARE)):
        if image_of is None or (source := group.nodes.get(node)) is None:
            continue
        image_of.source = "SEQUENCE"
        source.frame_duration = frames[-1] - frames[0] + 1
        source.frame_start = frames[0]
        # a sequence counts its files from 1
        source.frame_offset = frames[0] - 1
        source.use_auto_refresh = True
    wire(scene, group)
    return image


def wire(scene: bpy.types.Scene, group: bpy.types.NodeTree) -> bpy.types.Node | None:
    """Put the node group into the scene's compositor, seen through the viewer; return its node.

    What the compositor puts out stays what it was: an artist's tree gains the node, and a viewer
    if it had none; a scene without a compositor gets one that passes its render on. A tree linked
    from a library is left alone (-> None): the plate's node group can be added where it is made.
    """
    tree = compositor(scene)
    if tree is None:
        tree = new_compositor(scene, "ARTO Compositor")
        render = tree.nodes.new("CompositorNodeRLayers")
        render.scene = scene
        out = add_output(tree)
        out.location = (500, 0)
        tree.links.new(render.outputs["Image"], out.inputs["Image"])
    if not tree.is_editable:
        return None  # a library's: an edit of it would be gone with the next save
    node = next(
        (n for n in tree.nodes if n.bl_idname == "CompositorNodeGroup" and n.node_tree == group),
        None,
    )
    if node is None:
        # Blender knows no node's height before it is drawn
        tall = {n.name: 80 + 24 * (len(n.inputs) + len(n.outputs)) for n in tree.nodes}
        below = min((n.location.y - max(n.height, tall[n.name]) for n in tree.nodes), default=0.0)
        node = tree.nodes.new("CompositorNodeGroup")
        node.node_tree = group
        node.label = group.name
        node.width = 200
        x, y = 0, below - 40
        node.location = (x, y)
        if not any(n.bl_idname == "CompositorNodeViewer" for n in tree.nodes):
            viewer = tree.nodes.new("CompositorNodeViewer")
            viewer.location = (x + 500, y)
            tree.links.new(node.outputs["Image"], viewer.inputs["Image"])
    return node


def use(scene: bpy.types.Scene) -> None:
    """Have the scene's compositor use the plate as its setting says: instead of the render that it
    is of, or in a viewer alone. The mixer comes before the plate where layers are written."""
    tree = compositor(scene)
    if tree is None or not tree.is_editable:
        return
    name = name_of(scene)
    ours = {n.node_tree.name: n for n in tree.nodes if getattr(n, "node_tree", None)}
    mix, plain = ours.get(name + MIX), ours.get(name)
    for node in (mix, plain):
        if node is not None:
            _give_back(tree, node)
    wanted = mix if mix is not None and scene.arto.layers != "OFF" else plain
    if wanted is not None and scene.arto.use_in_compositor == "RENDER":
        _take_over(scene, tree, wanted)


def _take_over(scene: bpy.types.Scene, tree: bpy.types.NodeTree, node: bpy.types.Node) -> None:
    """Link to a node what the render of the scene's view layer is linked to."""
    taken = []
    layer = layer_of(scene)
    for render in tree.nodes:
        if render.bl_idname != "CompositorNodeRLayers" or render.scene not in {scene, None}:
            continue
        if render.layer != layer:
            continue
        for out in ("Image", "Alpha"):
            # all of them first: a link that is replaced is gone
            for to, socket in [(n.to_node, n.to_socket) for n in render.outputs[out].links]:
                taken.append([render.name, out, to.name, socket.identifier])
                tree.links.new(node.outputs[out], socket)
    node[TAKEN] = json.dumps(taken)


def _give_back(tree: bpy.types.NodeTree, node: bpy.types.Node) -> None:
    """Put back what a node took over, where the artist has not linked it otherwise since."""
    for render, out, to, identifier in json.loads(node.get(TAKEN, "[]")):
        if render not in tree.nodes or to not in tree.nodes:
            continue
        sockets = [s for s in tree.nodes[to].inputs if s.identifier == identifier]
        for socket in sockets:
            if any(link.from_node == node for link in socket.links):
                tree.links.new(tree.nodes[render].outputs[out], socket)
    if TAKEN in node:
        del node[TAKEN]
