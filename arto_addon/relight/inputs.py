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
    files, for `re.fullmatch`, or ""; shown: whether Blender may only show it, so that it is no
    input where it is a plate of ARTO's.
    """

    what: str
    path: Path
    form: str = ""
    shown: bool = False


class Inputs:
    """The files that some pictures are made of; `over` tells whether a path is one of them.

    A scene may have hundreds of files on a slow disk. They are looked at only where a name, or a
    file that is there already, could be one of them.
    """

    def __init__(self, inputs: Iterable[Input]) -> None:
        self._every = list(inputs)
        self._named: dict[str, list[Input]] = {}
        self._forms: list[tuple[re.Pattern[str], Input]] = []
        for one in dict.fromkeys(self._every):
            if one.form:
                form = re.compile(_composed(one.form), re.IGNORECASE)
                self._forms.append((form, one))
            else:
                self._named.setdefault(_alike(one.path), []).append(one)
        self._nodes: dict[tuple[int, int], list[Input]] | None = None

    def over(self, path: Path) -> Input | None:
        """The input that a file at a path would be written over, or None."""
        return next(
            (one for one in self._found(path) if not one.shown or _is_others(one.path)), None
        )

    def _found(self, path: Path) -> Iterator[Input]:
        for one in self._named.get(_alike(path), ()):
            if same_file(one.path, path):
                yield one
        if here := _node(path):  # by another name: a link
            yield from self._by_node().get(here, ())
        parent = folded(path.parent)
        for form, one in self._forms:
            if form.fullmatch(_composed(path.name)) and folded(one.path.parent) == parent:
                yield one

    def _by_node(self) -> dict[tuple[int, int], list[Input]]:
        if self._nodes is None:
            self._nodes = {}
            for one in self._every:
                if not one.form and (node := _node(one.path)):
                    self._nodes.setdefault(node, []).append(one)
        return self._nodes


def _alike(path: Path) -> str:
    return _composed(_composed(path.name).casefold())


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
    # what else Blender reads, or shows
    for source in [*bpy.data.images, *bpy.data.movieclips]:
        yield from _of_image("a file of the scene", source, shown=source.source != "TILED")
    for path in bpy.utils.blend_paths(absolute=True):
        yield Input("a file of the scene", Path(path), shown=True)
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


def _of_image(
    what: str, source: bpy.types.Image | bpy.types.MovieClip, shown: bool = False
) -> Iterator[Input]:
    """The files of an image or a clip. shown: see `Input`."""
    if source.source not in _IN_FILES or not source.filepath or getattr(source, "packed_file", 0):
        return
    path = _absolute(source)
    if source.source == "SEQUENCE":
        yield _sequence(what, path, shown)
    elif source.source == "TILED":
        yield Input(what, path, sequences.form_of_tiles(path.name), shown)
    else:
        yield Input(what, path, shown=shown)


def _sequence(what: str, path: Path, shown: bool = False) -> Input:
    return Input(what, path, sequences.form_of(path.name), shown)
