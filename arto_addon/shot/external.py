"""Files outside of the .blend that data-blocks are read from, at a frame, and their digests.

A data-block names a file, a numbered sequence of files, or the tiles of an image. A node may name
one too: the profile of a lamp, a shader's script. Caches of simulations are folders.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import bpy

from ..blender import sequences
from ..blender.sequences import Timing
from . import walk

# Data-blocks whose own `filepath` is handled here; and those whose file no render reads.
_OWN = (bpy.types.Image, bpy.types.Volume, bpy.types.CacheFile)
_NOT_READ = (bpy.types.MovieClip, bpy.types.Library, bpy.types.Text)
# Of a folder so many files are looked at.
_MOST = 20_000
_DIGITS = re.compile(r"\d+")


def digest(paths: Iterable[Path], then: str, full: bool) -> str:
    """The digests of some files, one after the other. then, full: see `walk.file`."""
    every = list(paths)
    was = then.split("|")
    was = was if len(was) == len(every) else [""] * len(every)
    return "|".join(
        walk.file(str(path), None, old, full) for path, old in zip(every, was, strict=True)
    )


def of_image(image: bpy.types.Image, frame: int | None) -> list[Path]:
    """The files of an image of the scene; of a sequence those that are shown at a frame.

    Where nobody says which of a sequence are shown, they are all that there are. frame: None where
    it does not count, and a sequence stands for the file that names it.
    """
    if image.source != "SEQUENCE":
        return sequences.files_of(image)
    path = Path(bpy.path.abspath(image.filepath, library=image.library))
    if frame is None:
        return [path]
    shown = sequences.files_of(image, _timings(image), frame)
    if shown:
        return shown
    form = re.compile(sequences.form_of(path.name))
    there = path.parent.iterdir() if path.parent.is_dir() else ()
    return sorted(other for other in there if form.fullmatch(other.name)) or [path]


def _timings(image: bpy.types.Image) -> Iterator[Timing]:
    """What decides which file of a sequence materials, lamps and modifiers show."""
    owners = [*bpy.data.materials, *bpy.data.lights, *bpy.data.worlds]
    for tree in [*(owner.node_tree for owner in owners), *bpy.data.node_groups]:
        for node in tree.nodes if tree else ():
            if getattr(node, "image", None) == image and hasattr(node, "image_user"):
                yield node.image_user
    for texture in bpy.data.textures:
        if getattr(texture, "image", None) == image:
            yield texture.image_user


def of_block(block: bpy.types.ID, frame: int | None) -> list[Path]:
    """The file of a volume or a cache; of a sequence the one that is read at a frame."""
    path = Path(bpy.path.abspath(block.filepath, library=block.library))
    if frame is None or not block.is_sequence:
        return [path]
    if isinstance(block, bpy.types.CacheFile):
        number = math.floor(block.frame if block.override_frame else frame)
        return [sequences.file_of(path, number)]
    number = _of_volume(block, frame)
    return [] if number is None else [sequences.file_of(path, number)]


def _of_volume(volume: bpy.types.Volume, frame: int) -> int | None:
    """The number of a volume's file at a frame, as Blender counts; None where it shows none."""
    length, number = volume.frame_duration, frame - volume.frame_start + 1
    if length == 0:
        return None
    if volume.sequence_mode == "CLIP" and not 1 <= number <= length:
        return None
    if volume.sequence_mode == "REPEAT":
        number = number % length or length
    elif volume.sequence_mode == "PING_PONG":
        there_and_back = max(2 * length - 2, 1)
        number = number % there_and_back or there_and_back
        number = 2 * length - number if number > length else number
    return min(max(number, 1), length) + volume.frame_offset


def named(
    block: bpy.types.ID, found: Iterable[tuple[bpy.types.bpy_struct, str]], frame: int | None
) -> Iterator[Path]:
    """The files and folders that properties within a data-block name.

    found: of each property what it belongs to, and its value.
    """
    if isinstance(block, bpy.types.VectorFont):  # whose path is no setting in some versions
        found = [*found, (block, block.filepath)]
    for owner, text in dict.fromkeys(found):
        if isinstance(owner, (*_OWN, *_NOT_READ)) or not text or text.startswith("<"):
            continue
        if getattr(owner, "mode", "") == "INTERNAL":  # a node's text is in the .blend
            continue
        if getattr(owner, "packed_file", None):
            continue
        yield Path(bpy.path.abspath(text, library=block.library))


def digest_named(paths: Iterable[Path], then: str, full: bool, frame: int | None) -> str:
    """The digests of files that properties name, and of folders, by what is in them at a frame."""
    out = hashlib.blake2b(digest_size=12)
    folders = [path for path in paths if path.is_dir()]
    for folder in folders:
        out.update(repr(_listed(folder, frame)).encode("utf-8", "surrogatepass"))
    files = digest([path for path in paths if path not in folders], then.partition(" ")[0], full)
    return f"{files} {out.hexdigest()}" if folders else files


def _listed(folder: Path, frame: int | None) -> list[tuple[str, int]]:
    """Names and sizes of the files in a folder of a cache: those of a frame, and of none."""
    found: list[tuple[str, int]] = []
    for inside, _, names in os.walk(folder):
        for name in names:
            numbers = [int(digits) for digits in _DIGITS.findall(name)]
            if frame is None or not numbers or frame in numbers:
                path = Path(inside, name)
                if path.is_file():
                    found.append((str(path.relative_to(folder)), path.stat().st_size))
        if len(found) > _MOST:
            break
    return sorted(found)


def attribute(scene: bpy.types.Scene, layer: bpy.types.ViewLayer, name: str) -> str:
    """What an Attribute node of the kind View Layer finds: of the layer, the scene or the world.

    Blender looks at custom properties first and at its own properties after them.
    """
    found = [_values(owner, name) for owner in (layer, scene, scene.world)]
    return hashlib.blake2b(repr(found).encode(), digest_size=12).hexdigest()


def _values(owner: Any, name: str) -> list[object]:
    if owner is None:
        return []
    found = [_plain(owner[name])] if name in owner.keys() else []  # noqa: SIM118 - no dictionary
    with contextlib.suppress(ValueError, TypeError):  # where Blender has no such property
        found.append(_plain(owner.path_resolve(name)))
    return found


def _plain(value: Any) -> object:
    if isinstance(value, bool | int | str):
        return value
    try:
        return [round(float(x), 6) for x in (value if hasattr(value, "__len__") else [value])]
    except (TypeError, ValueError):
        return type(value).__name__
