"""A world that stands still: as the artist's scene shows it at its frame, in whatever scene it is.

A world may depend on the scene around it: on its frame, its camera, its properties, and on objects.
The light of such a world is rendered in another scene, and by Live in another Blender. So a copy is
made that has as constants what the artist's scene gave. The copy shows the same in every direction.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

import bpy
from mathutils import Matrix, Vector

from ...core.errors import SceneError
from ..blender.markers import camera_of
from ..blender.nodes import Nodes, shader_tree, trees
from ..blender.reached import reached

# What a node of a world asks of the camera: its kind, and the outputs of it that ask; all if empty.
_OF_CAMERA: dict[str, tuple[str, ...]] = {
    "ShaderNodeTexCoord": ("Camera", "Window"),
    "ShaderNodeCameraData": (),
    "ShaderNodeVectorTransform": (),
}


_Block = TypeVar("_Block", bound=bpy.types.ID)


@dataclass(frozen=True)
class Around:
    """What is around a world at a frame: the scene, its view layer, and what both depend on.

    depsgraph: None where nothing was worked out; the data-blocks are then as they stand.
    """

    scene: bpy.types.Scene
    layer: bpy.types.ViewLayer
    depsgraph: bpy.types.Depsgraph | None

    def evaluated(self, block: _Block) -> _Block:
        return block.evaluated_get(self.depsgraph) if self.depsgraph else block

    def camera(self) -> bpy.types.Object:
        """The scene's camera at the frame. Raises SceneError without one."""
        camera = camera_of(self.scene)
        if camera is None:
            raise SceneError(
                "the world depends on the camera, and the scene has none: add one, or make one "
                "the scene's camera"
            )
        return self.evaluated(camera)

    def seen_from(self) -> Matrix:
        """The matrix from the world to the camera, as Cycles has it: +Z is forward, no scale."""
        place, turn, _ = self.camera().matrix_world.decompose()
        return Matrix.Diagonal((1, 1, -1, 1)) @ Matrix.LocRotScale(place, turn, None).inverted()

    def frame(self) -> tuple[str, list[Vector]]:
        """The camera's type and the corners of its frame: right top, right bottom, left bottom."""
        data = self.camera().data
        return data.type, list(data.view_frame(scene=self.scene))[:3]

    def property(self, name: str) -> tuple[float, float, float, float]:
        """What an Attribute node of the kind View Layer gives: of layer, scene or world.

        Blender looks at custom properties first and at its own properties after them.
        """
        scene = self.evaluated(self.scene)
        layer = scene.view_layers.get(self.layer.name) or self.layer
        for owner in (layer, scene, scene.world):
            for value in _values(owner, name):
                if (four := _four(value)) is not None:
                    return four
        return 0.0, 0.0, 0.0, 0.0


def _values(owner: bpy.types.ID | None, name: str) -> Iterator[object]:
    if owner is None:
        return
    if name in owner.keys():  # noqa: SIM118 - a data-block is no dictionary
        yield owner[name]
    try:
        yield owner.path_resolve(name)
    except (ValueError, TypeError):
        return  # Blender has no property of that name there.


def _four(value: Any) -> tuple[float, float, float, float] | None:
    """A number or up to four numbers as Cycles reads a colour of them; None for all else."""
    if isinstance(value, bool | int | float):
        return float(value), float(value), float(value), 1.0
    try:
        numbers = [float(x) for x in value]
    except (TypeError, ValueError):
        return None
    if not 1 <= len(numbers) <= 4:
        return None
    x, y, z, w = [*numbers, *(0.0, 0.0, 0.0, 1.0)[len(numbers) :]]
    return x, y, z, w


def _asks_the_camera(node: bpy.types.Node) -> bool:
    kind = node.bl_idname
    if kind not in _OF_CAMERA:
        return False
    if kind == "ShaderNodeVectorTransform":
        return node.convert_from != node.convert_to and "CAMERA" in {
            node.convert_from, node.convert_to,
        }  # fmt: skip
    names = _OF_CAMERA[kind]
    return any(s.is_linked and (not names or s.name in names) for s in node.outputs)


def _asks_an_object(node: bpy.types.Node) -> bool:
    return node.bl_idname == "ShaderNodeTexCoord" and node.object is not None


def _asks_the_layer(node: bpy.types.Node) -> bool:
    return node.bl_idname == "ShaderNodeAttribute" and node.attribute_type == "VIEW_LAYER"


def _asks(node: bpy.types.Node) -> bool:
    return _asks_the_camera(node) or _asks_an_object(node) or _asks_the_layer(node)


def check_pixels(scene: bpy.types.Scene, world: bpy.types.World) -> None:
    """Raise SceneError for a world that is drawn by the pixel of a camera that is no plane."""
    camera = camera_of(scene)
    flat = camera and camera.type == "CAMERA" and camera.data.type in {"PERSP", "ORTHO"}
    for node in () if flat else reached(world):
        if node.bl_idname == "ShaderNodeTexCoord" and node.outputs["Window"].is_linked:
            raise SceneError(
                "the world is drawn by the pixel of a panoramic camera (Window coordinates), so it "
                "is no light from a direction: use Generated coordinates"
            )


def _moves(block: bpy.types.ID) -> bool:
    """Whether a data-block has keys, drivers or strips."""
    animation = block.animation_data
    return animation is not None and bool(
        animation.action or animation.nla_tracks or list(animation.drivers)
    )


def is_restless(world: bpy.types.World) -> bool:
    """Whether a world may show something else in another scene, or at another frame."""
    every = list(trees(shader_tree(world), set()))
    return _moves(world) or any(_moves(t) or any(map(_asks, t.nodes)) for t in every)


def context(scene: bpy.types.Scene, view_layer: str, world: bpy.types.World) -> list[object]:
    """What a world is given by the scene around it, as values to compare; empty for most worlds.

    Quick: nothing is worked out anew. Keys and drivers are left out, as Blender writes down what
    they give in the world itself.
    """
    nodes = [node for node in reached(world) if _asks(node)]
    if not nodes:
        return []
    layer = scene.view_layers[view_layer]
    around = Around(scene, layer, layer.depsgraph)
    found: list[object] = []
    if any(_asks_the_camera(node) for node in nodes):
        camera = camera_of(scene)
        found.append(_rounded(around.seen_from()) if camera else None)
        if camera and camera.type == "CAMERA":
            frame = camera.data.view_frame(scene=scene)
            found += [camera.data.type, [_rounded([corner]) for corner in frame]]
    for node in nodes:
        if _asks_an_object(node):
            found.append(_rounded(around.evaluated(node.object).matrix_world))
        elif _asks_the_layer(node):
            found.append([round(x, 6) for x in around.property(node.attribute_name)])
    return found


def _rounded(rows: Iterable[Iterable[float]]) -> list[float]:
    return [round(x, 6) for row in rows for x in row]


@contextmanager
def bare(
    scene: bpy.types.Scene, view_layer: str, world: bpy.types.World | None
) -> Iterator[bpy.types.Scene]:
    """Copy a scene with one view layer and nothing in it but a world, at the scene's frame.

    The copy has the scene's properties, its camera and its clock. It is removed at the end.
    """
    copy = scene.copy()
    try:
        for layer in list(copy.view_layers):
            if layer.name != view_layer:
                copy.view_layers.remove(layer)
        # Where the layer has a world of its own, Attribute nodes and drivers read the properties of
        # the scene's world nevertheless.
        if copy.view_layers[0].world_override:
            copy.view_layers[0].world_override = world
        elif world:
            copy.world = world
        copy.background_set = None
        root = copy.collection
        for child in list(root.children):
            root.children.unlink(child)
        for thing in list(root.objects):
            root.objects.unlink(thing)
        if copy.rigidbody_world:
            copy.rigidbody_world.enabled = False
        copy.frame_set(scene.frame_current, subframe=scene.frame_subframe)
        yield copy
    finally:
        bpy.data.scenes.remove(copy)


@contextmanager
def still(
    scene: bpy.types.Scene, view_layer: str, world: bpy.types.World, camera: bool = True
) -> Iterator[bpy.types.World]:
    """Copy a world so that it stands still; the copy is removed at the end.

    camera: whether what the world asks of the camera is made constant too. It is left alone for a
    render through the scene's own camera. Raises SceneError for a world that depends on the camera
    of a scene without one.
    """
    with ExitStack() as held:
        if not is_restless(world):
            copy = world.copy()
            held.callback(bpy.data.worlds.remove, copy)
            yield copy
            return
        place = held.enter_context(bare(scene, view_layer, world))
        layer = place.view_layers[0]
        around = Around(place, layer, layer.depsgraph)
        copy = around.evaluated(world).copy()
        made: list[bpy.types.ID] = [copy]
        held.callback(bpy.data.batch_remove, made)
        copy.animation_data_clear()
        # A node that shows nothing must not raise, and may stay as it is.
        shown = {(n.id_data.name_full, n.name) for n in reached(world)}
        if tree := shader_tree(copy):
            tree.animation_data_clear()
            own = shader_tree(world)
            _still_tree(tree, own, around, camera, shown, made, {})
        yield copy


def _still_tree(
    tree: bpy.types.NodeTree,
    original: bpy.types.NodeTree,
    around: Around,
    camera: bool,
    shown: set[tuple[str, str]],
    made: list[bpy.types.ID],
    groups: dict[str, bpy.types.NodeTree],
) -> None:
    """Make a tree of ours and the groups in it stand still. groups: those that are done."""
    for node in list(tree.nodes):
        if node.bl_idname == "ShaderNodeGroup" and node.node_tree:
            group = node.node_tree.original if node.node_tree.is_evaluated else node.node_tree
            if group.name_full not in groups:
                if not any(_moves(t) or any(map(_asks, t.nodes)) for t in trees(group, set())):
                    continue
                copy = around.evaluated(group).copy()
                made.append(copy)
                copy.animation_data_clear()
                groups[group.name_full] = copy
                _still_tree(copy, group, around, camera, shown, made, groups)
            node.node_tree = groups[group.name_full]
        elif (original.name_full, node.name) not in shown:
            continue
        elif camera and _asks_the_camera(node):
            _hold_camera(tree, node, around)
        elif _asks_the_layer(node):
            _hold_attribute(tree, node, around)
        if _asks_an_object(node):
            _hold_object(tree, node, around)


def _relink(
    tree: bpy.types.NodeTree,
    of: bpy.types.NodeSocket,
    to: bpy.types.NodeSocket,
    number: bpy.types.NodeSocket | None = None,
) -> None:
    """Let what an output feeds be fed by another; number: where a single number is asked."""
    for link in list(of.links):
        asked = number if number is not None and link.to_socket.type == "VALUE" else to
        tree.links.new(asked, link.to_socket)


def _dot(nodes: Nodes, vector: bpy.types.NodeSocket, row: Iterable[float]) -> bpy.types.NodeSocket:
    """The value of a vector on an affine row of four numbers."""
    x, y, z, at = row
    found = nodes.add("ShaderNodeVectorMath", vector, (x, y, z), operation="DOT_PRODUCT")
    value = found.outputs["Value"]
    return nodes.math("ADD", value, at) if at else value


def _moved(nodes: Nodes, vector: bpy.types.NodeSocket, matrix: Matrix) -> bpy.types.NodeSocket:
    """A vector on which a matrix acts, as a point."""
    return nodes.add("ShaderNodeCombineXYZ", *(_dot(nodes, vector, matrix[i]) for i in range(3))
                     ).outputs[0]  # fmt: skip


def _direction(nodes: Nodes) -> bpy.types.NodeSocket:
    """The direction that is looked in: for a world the position of Cycles' shading point."""
    return nodes.tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"]


def _hold_camera(tree: bpy.types.NodeTree, node: bpy.types.Node, around: Around) -> None:
    nodes, matrix = Nodes(tree), around.seen_from()
    turn = matrix.to_3x3().to_4x4()
    kind = node.bl_idname
    if kind == "ShaderNodeVectorTransform":
        _hold_transform(tree, node, matrix)
        return
    if kind == "ShaderNodeCameraData":
        # Cycles takes the direction for a point: a world's distance depends on where the camera is.
        point = _moved(nodes, _direction(nodes), matrix)
        seen = nodes.add("ShaderNodeVectorMath", point, operation="NORMALIZE").outputs[0]
        _relink(tree, node.outputs["View Vector"], seen)
        _relink(tree, node.outputs["View Z Depth"], _dot(nodes, _direction(nodes), matrix[2]))
        far = nodes.add("ShaderNodeVectorMath", point, operation="LENGTH").outputs["Value"]
        _relink(tree, node.outputs["View Distance"], far)
        return
    if node.outputs["Camera"].is_linked:
        _relink(tree, node.outputs["Camera"], _moved(nodes, _direction(nodes), turn))
    if not node.outputs["Window"].is_linked:
        return
    lens, (top, low, left) = around.frame()
    rows = turn if lens == "PERSP" else matrix
    depth = -top.z if lens == "PERSP" else 1.0
    parts = []
    for i, begin, end in ((0, left[0], top[0]), (1, low[1], top[1])):
        along = _dot(nodes, _direction(nodes), rows[i])
        if lens == "PERSP":
            along = nodes.math("DIVIDE", along, _dot(nodes, _direction(nodes), rows[2]))
        size = (end - begin) / depth
        parts.append(nodes.math("MULTIPLY_ADD", along, 1 / size, -begin / depth / size))
    _relink(tree, node.outputs["Window"], nodes.add("ShaderNodeCombineXYZ", *parts, 0.0).outputs[0])


def _hold_transform(tree: bpy.types.NodeTree, node: bpy.types.Node, matrix: Matrix) -> None:
    nodes, into = Nodes(tree), node.inputs[0]
    given = into.links[0].from_socket if into.is_linked else None
    if given is None:
        vector = nodes.add("ShaderNodeCombineXYZ", *into.default_value).outputs[0]
    else:
        vector = given
    acts = matrix if node.convert_to == "CAMERA" else matrix.inverted()
    if node.vector_type != "POINT":
        acts = acts.to_3x3().to_4x4()
    found = _moved(nodes, vector, acts)
    if node.vector_type == "NORMAL":
        found = nodes.add("ShaderNodeVectorMath", found, operation="NORMALIZE").outputs[0]
    _relink(tree, node.outputs[0], found)


def _hold_object(tree: bpy.types.NodeTree, node: bpy.types.Node, around: Around) -> None:
    """Texture coordinates of an object: the direction as a point, in the object's own space."""
    nodes = Nodes(tree)
    matrix = around.evaluated(node.object).matrix_world
    inverse = matrix.inverted() if abs(matrix.determinant()) > 0 else Matrix.Identity(4)
    if node.outputs["Object"].is_linked:
        _relink(tree, node.outputs["Object"], _moved(nodes, _direction(nodes), inverse))
    node.object = None


def _hold_attribute(tree: bpy.types.NodeTree, node: bpy.types.Node, around: Around) -> None:
    nodes = Nodes(tree)
    x, y, z, alpha = around.property(node.attribute_name)
    number = tree.nodes.new("ShaderNodeValue").outputs[0]
    number.default_value = (x + y + z) / 3
    vector = nodes.add("ShaderNodeCombineXYZ", x, y, z).outputs[0]
    for name in ("Color", "Vector"):
        _relink(tree, node.outputs[name], vector, number)
    _relink(tree, node.outputs["Fac"], number)
    if node.outputs["Alpha"].is_linked:
        held = tree.nodes.new("ShaderNodeValue").outputs[0]
        held.default_value = alpha
        _relink(tree, node.outputs["Alpha"], held)
