"""What pictures are made of: the files that no picture and no file beside it may be written over.

These are the environment maps, all files of the worlds and their sequences, the footage of all
frames, the Cryptomattes, the textures and other files of the scene, and the .blend.
"""

from __future__ import annotations

import contextlib
import re
import unicodedata
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import bpy

from ...core.errors import SceneError
from ...core.file_names import folded, same_file
from ..blender import sequences
from ..plate.footage import footage
from ..plate.marks import is_marked
from ..plate.names import has_number
from ..shot import home

# Image datablocks of these sources are read from files.
_IN_FILES = {"FILE", "SEQUENCE", "MOVIE", "TILED"}


@dataclass(frozen=True)
class Input:
    """A file that is read, or all files of a sequence.

    what: in words; path: the file, or any file of the sequence; form: of the names of a sequence's
    files, for `re.fullmatch`, or "".
    """

    what: str
    path: Path
    form: str = ""


class Inputs:
    """The files that some pictures are made of; `over` tells whether a path is one of them."""

    def __init__(self, inputs: Iterable[Input]) -> None:
        self._named: dict[str, Input] = {}
        self._same: dict[tuple[int, int], Input] = {}
        self._forms: dict[tuple[str, str], tuple[re.Pattern[str], Input]] = {}
        for one in inputs:
            if one.form:
                key = folded(one.path.parent), one.form
                self._forms.setdefault(key, (re.compile(_composed(one.form), re.IGNORECASE), one))
                continue
            self._named.setdefault(folded(one.path), one)
            if found := _node(one.path):
                self._same.setdefault(found, one)

    def over(self, path: Path) -> Input | None:
        """The input that a file at a path would be written over, or None."""
        here = _node(path)
        if here in self._same:
            return self._same[here]
        if (one := self._named.get(folded(path))) and same_file(one.path, path):
            return one
        parent = folded(path.parent)
        for (folder, _), (form, one) in self._forms.items():
            if folder == parent and form.fullmatch(_composed(path.name)):
                return one
        return None


def _composed(name: str) -> str:
    """A name as every disk that tells no accents apart would have it."""
    return unicodedata.normalize("NFC", name)


def _node(path: Path) -> tuple[int, int] | None:
    """What a file is to the disk; None where there is none."""
    try:
        state = path.stat()
    except (OSError, ValueError):
        return None
    return state.st_dev, state.st_ino


def inputs(scene: bpy.types.Scene, maps: Iterable[Path] = ()) -> Inputs:
    """List what pictures of a scene are made of. maps: environment maps in the world's place."""
    return Inputs([*(Input("its environment map", file) for file in maps), *_all(scene)])


def _all(scene: bpy.types.Scene) -> Iterator[Input]:
    worlds = {world.node_tree for world in bpy.data.worlds if world.node_tree}
    for tree in _trees():
        what = "the world's image" if tree in worlds else "a texture of the scene"
        for node in tree.nodes:
            if (image := getattr(node, "image", None)) is not None:
                yield from _of_image(what, image)
    for texture in bpy.data.textures:
        if (image := getattr(texture, "image", None)) is not None:
            yield from _of_image("a texture of the scene", image)
    # footage that cannot be used is told of by what reads it
    with contextlib.suppress(SceneError):
        if found := footage(scene):
            yield from _of_image("the footage", found.source)
    if scene.arto.cryptomatte:
        path = home.absolute(scene.arto.cryptomatte)
        form = re.sub("#+", r"\\d+", re.escape(path.name.replace("#", "\0")).replace("\0", "#"))
        yield Input("the Cryptomattes", path, form if has_number(path) else "")
    if home.file():
        yield Input("the .blend", Path(home.file()))
    # what else Blender reads, but for the plates that it shows, which may be gone
    for source in [*bpy.data.images, *bpy.data.movieclips]:
        path = _absolute(source)  # of tiles it is the name of none
        if source.filepath and (source.source == "TILED" or _is_others(path)):
            yield from _of_image("a file of the scene", source)
    for path in map(Path, bpy.utils.blend_paths(absolute=True)):
        if _is_others(path):
            yield Input("a file of the scene", path)
    for volume in bpy.data.volumes:
        if volume.is_sequence:
            yield _sequence("a volume of the scene", _absolute(volume))
    for cache in bpy.data.cache_files:
        if cache.is_sequence:
            yield _sequence("a cache of the scene", _absolute(cache))


def _is_others(path: Path) -> bool:
    """Whether a file is there, or may be, that ARTO has not written.

    A companion of an older plate may be gone while Blender still has its image.
    """
    return not is_marked(path) and (path.exists() or has_number(path))


def _trees() -> Iterator[bpy.types.NodeTree]:
    """The trees of nodes that light and things are made with."""
    for blocks in (bpy.data.worlds, bpy.data.materials, bpy.data.lights):
        yield from (block.node_tree for block in blocks if block.node_tree)
    kinds = {"ShaderNodeTree", "GeometryNodeTree", "TextureNodeTree"}
    yield from (tree for tree in bpy.data.node_groups if tree.bl_idname in kinds)


def _absolute(block: bpy.types.ID) -> Path:
    return Path(bpy.path.abspath(block.filepath, library=block.library))


def _of_image(what: str, source: bpy.types.Image | bpy.types.MovieClip) -> Iterator[Input]:
    """The files of an image or a clip."""
    if source.source not in _IN_FILES or not source.filepath or getattr(source, "packed_file", 0):
        return
    path = _absolute(source)
    if source.source == "SEQUENCE":
        yield _sequence(what, path)
    elif source.source == "TILED":
        yield Input(what, path, sequences.form_of_tiles(path.name))
    else:
        yield Input(what, path)


def _sequence(what: str, path: Path) -> Input:
    return Input(what, path, sequences.form_of(path.name))
