"""Show a plate in the scene's compositor."""

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

# A plate's mixer has the plate's name with this ending.
MIX = " Mix"
# The custom property of ARTO's node that lists the links that the node took over, as JSON.
TAKEN = "arto_taken"


def present(scene: bpy.types.Scene, path: Path, look: str | None = None) -> bpy.types.Image:
    """Show a written plate: load its image, and put its node into the scene's compositor.

    look: the plate's look (default: the scene's look now). In the window this is one undo step.
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
    """Show the plates of several frames as a sequence: an image, and a node in the compositor.

    At each frame of the scene, image and node show the plate of that frame. They have other names
    than those of a single frame's plate. first: the file of the first frame; frames: the frames'
    numbers, as `relight.many` numbers the files.
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
        # Blender counts the files of a sequence from 1.
        source.frame_offset = frames[0] - 1
        source.use_auto_refresh = True
    wire(scene, group)
    return image


def wire(scene: bpy.types.Scene, group: bpy.types.NodeTree) -> bpy.types.Node | None:
    """Put a node group into the scene's compositor, and return its node.

    The output of the compositor does not change. An artist's tree gains the node, and a viewer of
    the node if the tree had no viewer. A scene without a compositor gets one that passes the render
    on. A tree that is linked from a library is left alone, and None is returned: the artist can add
    the node group in the library's file.
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
        return None  # The tree is a library's: an edit would not be saved.
    node = next(
        (n for n in tree.nodes if n.bl_idname == "CompositorNodeGroup" and n.node_tree == group),
        None,
    )
    if node is None:
        # Blender does not know a node's height before the node is drawn, so it is estimated.
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
    """Have the scene's compositor use the plate as the setting `use_in_compositor` says.

    The plate takes the place of the render, or is seen in a viewer alone. Where layers are written,
    the mixer is used instead of the plate's own node.
    """
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
    """Have a node take over the links of the render of the scene's view layer, and note them."""
    taken = []
    layer = layer_of(scene)
    for render in tree.nodes:
        if render.bl_idname != "CompositorNodeRLayers" or render.scene not in {scene, None}:
            continue
        if render.layer != layer:
            continue
        for out in ("Image", "Alpha"):
            # The links are listed first, as linking a socket anew removes its old link.
            for to, socket in [(n.to_node, n.to_socket) for n in render.outputs[out].links]:
                taken.append([render.name, out, to.name, socket.identifier])
                tree.links.new(node.outputs[out], socket)
    node[TAKEN] = json.dumps(taken)


def _give_back(tree: bpy.types.NodeTree, node: bpy.types.Node) -> None:
    """Give the links that a node took over back to the render.

    A socket that the artist has linked to another node since is left alone.
    """
    for render, out, to, identifier in json.loads(node.get(TAKEN, "[]")):
        if render not in tree.nodes or to not in tree.nodes:
            continue
        sockets = [s for s in tree.nodes[to].inputs if s.identifier == identifier]
        for socket in sockets:
            if any(link.from_node == node for link in socket.links):
                tree.links.new(tree.nodes[render].outputs[out], socket)
    if TAKEN in node:
        del node[TAKEN]
