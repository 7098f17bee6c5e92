"""A world in a file, on its way to the resident renderer.

Large images that are packed into the artist's file are sent apart, each once for each change of it:
a world is sent at every move of a slider.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import marked
from ...core.errors import SceneError
from ..blender.nodes import shader_tree, trees
from ..blender.saving import check_whole
from ..job.snapshot import in_no_file, pixels_of
from ..shot import pixels
from ..world.still import is_restless, still

# What stands in a world's file for an image that was sent apart: [its name, the file of the image,
# the image's name].
Apart = list[str]
# A new name for each file: Blender does not read a library of a known name again.
_numbers = itertools.count(1)


class Sent:
    """The images that were sent, and where."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        # by `session_uid`: what the image was then, and its file
        self._packed: dict[int, tuple[str, Path]] = {}
        self._painted: dict[int, str] = {}

    def forget(self) -> None:
        """Send painted pixels again."""
        self._painted.clear()

    def world(
        self, scene: bpy.types.Scene, layer: str, world: bpy.types.World
    ) -> tuple[Path, str, list[Apart]]:
        """Write a world into a small file -> the file, the world's name there, its images apart.

        Raises SceneError.
        """
        blend = self._folder / f"world{next(_numbers)}.blend"
        with ExitStack() as held:
            if world.library or is_restless(world):
                # a linked world is not written, and the other Blender does not have this scene
                world = held.enter_context(still(scene, layer, world))
            large = {i.session_uid: i for i in images(world) if pixels.packed_size(i) > pixels.FEW}
            apart = []
            if large:
                world, instead = held.enter_context(_without(world, large))
                apart = [
                    [name, str(self._image(large[uid])), large[uid].name]
                    for uid, name in instead.items()
                ]
            _write(blend, world)
            return blend, world.name, apart

    def _image(self, image: bpy.types.Image) -> Path:
        """The file of a packed image, written anew after a change. Raises SceneError."""
        uid, now = image.session_uid, pixels.version(image)
        then, path = self._packed.get(uid, ("", None))
        if path is None or then != now:
            if path is not None:
                marked.remove_file(path, "temporary")
            path = self._folder / f"image{uid}_{next(_numbers)}.blend"
            _write(path, image)
            self._packed[uid] = now, path
        return path

    def painted(
        self, world: bpy.types.World
    ) -> tuple[dict[str, str], dict[Path, NDArray[np.float32]]]:
        """The painted images of a world that are in no file.

        -> (for each its name and the file of its pixels; the pixels that are to be written there)
        """
        files, new = {}, {}
        for image in images(world):
            if not in_no_file(image):
                continue
            path = self._folder / f"painted_{image.session_uid}.npy"
            now = pixels.version(image)
            if self._painted.get(image.session_uid) != now:
                self._painted[image.session_uid] = now
                new[path] = pixels_of(image)
            files[image.name] = str(path)
        return files, new


def _write(blend: Path, block: bpy.types.ID) -> None:
    """Write a data-block into a file. Raises SceneError."""
    try:
        # absolute paths: the small file lies in another folder than the artist's
        bpy.data.libraries.write(str(blend), {block}, path_remap="ABSOLUTE", fake_user=True)
        check_whole(blend)
    except (OSError, RuntimeError) as e:
        raise SceneError(f"the world cannot be written to {blend} ({e})") from e


@contextmanager
def _without(
    world: bpy.types.World, large: dict[int, bpy.types.Image]
) -> Iterator[tuple[bpy.types.World, dict[int, str]]]:
    """Copy a world with other images in place of some, by `session_uid` -> (copy, their names)."""
    copy = world.copy()
    made: list[bpy.types.ID] = [copy]
    try:
        instead = {}
        for uid in large:
            instead[uid] = bpy.data.images.new("ARTO Apart", 1, 1)
            made.append(instead[uid])
        if tree := shader_tree(copy):
            _put(tree, instead, made, {})
        yield copy, {uid: image.name for uid, image in instead.items()}
    finally:
        bpy.data.batch_remove(made)


def _put(
    tree: bpy.types.NodeTree,
    instead: dict[int, bpy.types.Image],
    made: list[bpy.types.ID],
    groups: dict[int, bpy.types.NodeTree],
) -> None:
    """Put other images into a tree of ours, and into copies of the groups in it."""
    for node in tree.nodes:
        image, group = getattr(node, "image", None), getattr(node, "node_tree", None)
        if image is not None and image.session_uid in instead:
            node.image = instead[image.session_uid]
        elif group is not None and any(i.session_uid in instead for i in _images(group)):
            if group.session_uid not in groups:
                groups[group.session_uid] = copy = group.copy()
                made.append(copy)
                _put(copy, instead, made, groups)
            node.node_tree = groups[group.session_uid]


def images(world: bpy.types.World) -> list[bpy.types.Image]:
    """The images that a world's nodes use, groups included."""
    return _images(shader_tree(world))


def _images(tree: bpy.types.NodeTree | None) -> list[bpy.types.Image]:
    found = [n for t in trees(tree, set()) for n in t.nodes]
    return [n.image for n in found if getattr(n, "image", None)]


# In the resident renderer: the images that were sent apart, by their files.
_given: dict[str, str] = {}


def forget() -> None:
    """Let go of the names of images: another file was opened, which has none of them."""
    _given.clear()


def put_back(apart: list[Apart]) -> None:
    """Put the images that were sent apart into the world that was read, in the other Blender."""
    for name, file, image in apart:
        if _given.get(file, "") not in bpy.data.images:
            for old in [f for f in _given if not Path(f).exists()]:
                if _given[old] in bpy.data.images:
                    bpy.data.images.remove(bpy.data.images[_given[old]])
                del _given[old]
            with bpy.data.libraries.load(file) as (_, into):
                into.images.append(image)
            into.images[0].use_fake_user = True
            _given[file] = into.images[0].name
        bpy.data.images[name].user_remap(bpy.data.images[_given[file]])
