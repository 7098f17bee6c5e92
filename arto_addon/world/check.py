"""Check that a world can light a picture, and say what a map of the world cannot show."""

from __future__ import annotations

import contextlib
from pathlib import Path

import bpy

from ...core import exr, picture_files
from ...core.errors import ArtoError, ExrError, SceneError
from ..blender import sequences
from ..blender.nodes import shader_tree
from ..blender.reached import gives, reached
from ..shot.shot import layer_of
from .detail import detail
from .images import files_at, image_nodes
from .still import check_pixels


def world_of(scene: bpy.types.Scene, view_layer: str | None = None) -> bpy.types.World | None:
    """The world that a view layer is rendered with: the layer's override, or the scene's world.

    view_layer: default: `layer_of`. None where the scene has no world.
    """
    layer = scene.view_layers.get(view_layer or layer_of(scene))
    return (layer.world_override if layer else None) or scene.world


def check_world(scene: bpy.types.Scene, view_layer: str | None = None) -> bpy.types.World:
    """The world of a view layer, checked.

    Raises SceneError where there is no world, where the layer leaves the world out, where the world
    has a volume, or where an image of the world is missing; of a sequence, the picture of the
    scene's frame.
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
    check_given(scene, world)
    return world


def check_given(scene: bpy.types.Scene, world: bpy.types.World) -> None:
    """Check a world that a scene is shown in, whether it is the scene's own or a look's.

    Raises SceneError for a world whose light no map has, or where an image of it is missing.
    """
    check_light_of(scene, world)
    for node in image_nodes(world):
        if node.image is None:
            raise SceneError(f"the world's node '{node.name}' has no image: choose an HDRI")
        for path in files_at(node, scene.frame_current):
            if path.is_file():
                continue
            if node.image.source == "SEQUENCE":
                raise SceneError(
                    f"the world's image '{node.image.name}' is a sequence without a file for frame "
                    f"{scene.frame_current} ({path}): put the file there, or set the node's Frames "
                    "and Offset to the files that are there"
                )
            raise SceneError(
                f"the world's image '{node.image.name}' is missing on disk ({path}): find it "
                "again (File, External Data, Find Missing Files), or choose another"
            )


def check_images(world: bpy.types.World, frame: int) -> None:
    """Raise SceneError where a file of the world's images cannot be read.

    Cycles would show magenta in place of the image. The check loads the images, as a render would.
    """
    for node in image_nodes(world):
        image = node.image
        if image is None:
            continue
        if image.source != "MOVIE":
            for path in files_at(node, frame):
                check_file(path, f"the world's image '{image.name}'")
        if image.packed_files or image.source == "GENERATED":
            _check_in_memory(image)
        elif image.source in {"FILE", "MOVIE", "TILED"} and min(image.size) == 0:
            path = bpy.path.abspath(image.filepath, library=image.library)
            raise _unreadable(image.name, Path(path))


def _check_in_memory(image: bpy.types.Image) -> None:
    """Raise SceneError where an image that is in no file is cut off, or has what is no number."""
    packed = [file.packed_file.data for file in image.packed_files if file.packed_file]
    if any(map(picture_files.is_cut, packed)) or min(image.size) == 0:
        raise _unreadable(image.name, Path(image.filepath))
    try:
        sequences.check_finite(image, f"the world's image '{image.name}'")
    except ExrError as e:
        raise SceneError(f"{e}, or choose another") from e


def _unreadable(name: str, path: Path) -> SceneError:
    with contextlib.suppress(ArtoError):
        if path.suffix.lower() == ".exr" and any(layers := exr.part_names(path)):
            return SceneError(
                f"the world's image '{name}' is an EXR of layers ({', '.join(layers[:3])}), which "
                "Blender does not show as one picture: write the layer alone, as R, G, B"
            )
    return SceneError(
        f"the world's image '{name}' cannot be read, it is damaged or cut off: copy the file "
        "anew, or choose another"
    )


def check_file(path: Path, name: str = "the world's image") -> None:
    """Raise SceneError where a file cannot be read as the image of a world.

    That is where it is missing, cut off or damaged, has pixels that are no numbers, or is of layers
    that Blender does not show as a picture.
    """
    if wrong := sequences.damage_of(path):
        raise SceneError(f"{name} cannot be used ({wrong}): copy it anew, or choose another")
    try:
        alone = bpy.data.images.load(str(path))
    except RuntimeError as e:
        raise _unreadable(path.name, path) from e
    try:
        if min(alone.size) == 0:
            raise _unreadable(path.name, path)
    finally:
        bpy.data.images.remove(alone)


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


def check_light_of(scene: bpy.types.Scene, world: bpy.types.World) -> None:
    """Raise SceneError for a world whose light no map has, however the map is made."""
    check_no_volume(world)
    check_pixels(scene, world)
    bounces = world.cycles.max_bounces
    # Cycles keeps to it where it samples the world as a light: one of an even colour it does not.
    sampled = world.cycles.sampling_method != "NONE" and detail(world) > 1
    if bounces < scene.cycles.max_bounces and sampled:
        raise SceneError(
            f"the world's light ends after {bounces} bounces (World properties, Settings, Max "
            f"Bounces), which only a render can do: raise it to {scene.cycles.max_bounces}, the "
            "scene's own"
        )


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
    for node in reached(world):
        if node.bl_idname != "ShaderNodeLightPath":
            continue
        for name in gives(node):
            if name not in _OF_CAMERA:
                return f"mixed by '{name}': all rays see what a ray through clear glass sees here"
    return ""
