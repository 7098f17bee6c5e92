"""The images that a world shows, and the files that they are read from at a frame."""

from __future__ import annotations

from pathlib import Path

import bpy

from ..blender import sequences
from ..blender.reached import reached

# Nodes that show an image, and of them those that a frame moves on.
_SHOW = {"ShaderNodeTexEnvironment", "ShaderNodeTexImage"}
_MOVE = {"SEQUENCE", "MOVIE"}


def image_nodes(world: bpy.types.World) -> list[bpy.types.Node]:
    """The nodes that show an image and lead to a world's output."""
    return [node for node in reached(world) if node.bl_idname in _SHOW]


def moves(world: bpy.types.World) -> bool:
    """Whether a world shows a sequence or a movie."""
    return any(n.image and n.image.source in _MOVE for n in image_nodes(world))


def number_at(user: bpy.types.ImageUser, frame: int) -> int:
    """The number of the image that a node shows at a frame, as Blender counts.

    Before its first image a sequence shows the one before it, and after the last it stays, unless
    it begins anew.
    """
    return sequences.shown_at(user, frame).number


def held_images(world: bpy.types.World, frame: int) -> str:
    """Say which sequence or movie of a world does not last until a frame; "" for none."""
    for node in image_nodes(world):
        image = node.image
        if image and image.source in _MOVE and sequences.shown_at(node.image_user, frame).held:
            return (
                f"the world's image '{image.name}' does not last until frame {frame}: another of "
                "its pictures is held"
            )
    return ""


def files_at(node: bpy.types.Node, frame: int) -> list[Path]:
    """The files that a node's image is read from at a frame; none where it is in no file."""
    if node.image is None:
        return []
    timings = [node.image_user] if node.image.source == "SEQUENCE" else []
    return sequences.files_of(node.image, timings, frame)


def stamps(world: bpy.types.World, frame: int) -> list[object]:
    """What says of the files of a world's sequences whether they are the same as before."""
    found: list[object] = []
    for node in image_nodes(world):
        if node.image and node.image.source in {"TILED", *_MOVE}:
            for path in files_at(node, frame):
                try:
                    s = path.stat()
                    # The name alone: a job's copy of the file leads there by another way.
                    found.append((path.name, s.st_size, s.st_mtime_ns, s.st_ctime_ns, s.st_ino))
                except OSError as e:  # The file cannot be read, and the stamp says so.
                    found.append((path.name, type(e).__name__))
    return found
