"""Check that a world can light a picture, and say what a map of the world cannot show."""

from __future__ import annotations

from pathlib import Path

import bpy

from ...core.errors import SceneError
from ..blender.nodes import shader_tree, trees
from ..shot.shot import layer_of


def world_of(scene: bpy.types.Scene, view_layer: str | None = None) -> bpy.types.World | None:
    """The world that a view layer is rendered with: the layer's override, or the scene's world.

    view_layer: default: `layer_of`. None where the scene has no world.
    """
    layer = scene.view_layers.get(view_layer or layer_of(scene))
    return (layer.world_override if layer else None) or scene.world


def check_world(scene: bpy.types.Scene, view_layer: str | None = None) -> bpy.types.World:
    """The world of a view layer, checked.

    Raises SceneError where there is no world, where the layer leaves the world out, where the world
    has a volume, or where an image of the world is missing.
    """
    world = world_of(scene, view_layer)
    if world is None:
        raise SceneError(
            "the scene has no world to relight with: add one with an HDRI (World properties)"
        )
    layer = scene.view_layers[view_layer or layer_of(scene)]
    if not layer.use_sky:
        raise SceneError(
            f"the view layer '{layer.name}' has Environment off, so that no world lights it: turn "
            "it on (View Layer properties, Filter)"
        )
    check_no_volume(world)
    for tree in trees(shader_tree(world), set()):
        for node in tree.nodes:
            if node.bl_idname not in {"ShaderNodeTexEnvironment", "ShaderNodeTexImage"}:
                continue
            image = node.image
            if image is None:
                if any(o.is_linked for o in node.outputs):
                    raise SceneError(f"the world's node '{node.name}' has no image: choose an HDRI")
            elif image.source == "FILE" and not image.packed_file:
                path = Path(bpy.path.abspath(image.filepath, library=image.library))
                if not path.is_file():
                    raise SceneError(
                        f"the world's image '{image.name}' is missing on disk ({path}): find it "
                        "again (File, External Data, Find Missing Files), or choose another"
                    )
    return world


def check_images(world: bpy.types.World) -> None:
    """Raise SceneError where a file of the world's images cannot be read.

    Cycles would show magenta in place of the image. The check loads the images, as a render would.
    """
    for tree in trees(shader_tree(world), set()):
        for node in tree.nodes:
            image = getattr(node, "image", None)
            if image is None or not any(o.is_linked for o in node.outputs):
                continue
            if image.source in {"FILE", "SEQUENCE", "MOVIE"} and min(image.size) == 0:
                raise SceneError(
                    f"the world's image '{image.name}' cannot be read, it is damaged or cut off: "
                    "copy the file anew, or choose another"
                )


def _fills(socket: bpy.types.NodeSocket) -> bool:
    """Whether a volume socket gets a volume that is not muted and whose density is not 0."""
    link = next((i for i in socket.links if not i.is_muted), None)
    if link is None:
        return False
    node = link.from_node
    handed_on = [s for s in node.inputs if s.type == "SHADER"]
    if node.bl_idname == "NodeReroute" or handed_on:
        return any(_fills(s) for s in handed_on or node.inputs)
    if node.mute:
        return False
    amounts = ("Density", "Emission Strength", "Blackbody Intensity")
    found = [s for s in node.inputs if s.name in amounts and s.enabled]
    return not found or any(s.is_linked or s.default_value for s in found)


def check_no_volume(world: bpy.types.World) -> None:
    """Raise SceneError for a world with a volume, which swallows all light from afar."""
    tree = shader_tree(world)
    out = tree.get_output_node("CYCLES") if tree else None
    if out and _fills(out.inputs["Volume"]):
        raise SceneError(
            "the world has a volume, which swallows all light from afar: put the fog into an "
            "object around the scene instead"
        )


# Kinds of rays to which a world may show different light. A map has the same light for all.
_KINDS = ("diffuse", "glossy", "transmission", "scatter")
_OF_CAMERA = {"Is Camera Ray", "Is Shadow Ray"}


def differs_by_rays(world: bpy.types.World) -> str:
    """Say how a world's light differs by kind of ray, and what the map uses instead; "" if not.

    A world that only shows the camera something else is fine: the background is rendered apart.
    """
    rays = world.cycles_visibility
    seen = [kind for kind in _KINDS if getattr(rays, kind)]
    if 0 < len(seen) < len(_KINDS):
        hidden = " and ".join(k for k in _KINDS if k not in seen)
        return f"hidden from {hidden} rays: all rays see it alike here"
    for tree in trees(shader_tree(world), set()):
        for node in tree.nodes:
            if node.bl_idname != "ShaderNodeLightPath":
                continue
            for socket in node.outputs:
                if socket.is_linked and socket.name not in _OF_CAMERA:
                    return (
                        f"mixed by '{socket.name}': all rays see what a ray through clear glass "
                        "sees here"
                    )
    return ""
