"""Where a picture and the files beside it go, and what would be written over there."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import bpy

from ...core.errors import SceneError
from ...core.files import is_writable
from ...core.units import size
from ..capture import room
from ..plate import marks, plate
from ..plate.footage import footage
from ..plate.marks import ENDINGS, SCRIPTS
from ..shot.home import check_outside
from . import layers
from .inputs import Input, Inputs, inputs
from .shown import Shown

# How small compressed files of pictures are, as a share of their pixels, where they are small: a
# disk that has room for so much may still become full, and one that has not is told of at once.
_PACKED = 0.5
# The longest name of a file that disks take, in bytes.
_LONGEST = 255


def check_picture(shown: Shown, path: Path, read: Inputs | None = None) -> None:
    """Look at where a picture and the files beside it will be written.

    read: what all pictures of the work are made of (default: what the scene is made of). Raises
    SceneError where they cannot be written there, or would be written over what pictures are made
    of or over files of others.
    """
    scene = shown.scene
    layers.check(scene, path, shown.field)
    longest = max(len(o.name.encode("utf-8", "surrogatepass")) for o in possible(path))
    if longest > _LONGEST:
        raise SceneError(
            f"'{path.name}' and what is added to it for files beside it is {longest} bytes long, "
            f"and disks take {_LONGEST}: shorten the output's name"
        )
    check_outside(path, "pictures")
    if path.is_dir():
        raise SceneError(f"{path} is a folder: choose another output")
    if not is_writable(path.parent):
        raise SceneError(
            f"nothing can be written into {path.parent}: see who may write there, or choose "
            "another output"
        )
    written = files_of(shown, path)
    read = read or inputs(scene)
    for output in dict.fromkeys([*possible(path), *written]):
        if found := read.over(output):
            raise SceneError(
                f"the picture would be written over {found.what}, {output}: choose another output"
            )
    for output in written:
        marks.check(output, path, scene.arto.overwrite)
    check_room({path: bytes_of(shown)})


def check_beside(
    scene: bpy.types.Scene, path: Path, plate_path: Path, read: Iterable[Path] = ()
) -> None:
    """Look at a single file that is to be written beside a plate, or by itself.

    read: what it is made of, besides what the scene is made of. Raises SceneError where the file
    would be written over one of these or over a file of others.
    """
    check_outside(path, "pictures")
    found = Inputs(Input("what it is made of", file) for file in read).over(path)
    if found is None and not marks.is_of(path, plate_path):
        # the world of an earlier match may be written anew: its light is known by now
        found = inputs(scene).over(path)
    if found:
        raise SceneError(f"{path} is {found.what}, and is not written over: choose another file")
    marks.check(path, plate_path, scene.arto.overwrite)


def possible(path: Path) -> list[Path]:
    """A picture's file, and all that may stand beside it under names of its own."""
    found = [path, *(path.with_name(f"{path.stem}_{ending}.exr") for ending in ENDINGS)]
    scripts = [path.with_suffix(ending) for ending in SCRIPTS]
    return found + [plate.full_file(output) for output in found] + scripts


def files_of(shown: Shown, path: Path) -> list[Path]:
    """The files that a relight writes with the settings as they are, the picture's first."""
    scene, settings = shown.scene, shown.scene.arto
    found, alone = [path], []
    if len(shown.takes) > 1:
        found.append(plate.share_file(path))
        alone += [plate.light_file(path)] if settings.shadows == "ADD" else []
        alone += [plate.comp_file(path)] if footage(scene) else []
    if settings.write_data:
        alone.append(plate.data_file(path))
    if settings.layers != "OFF":
        found.append(plate.layers_file(path))
        if settings.layers_files == "EACH":
            alone += layers.own_files(scene, path, shown.field)
    if plate.window_of(scene).crop:
        alone += [plate.full_file(file) for file in found]
    return found + alone


def bytes_of(shown: Shown) -> int:
    """About the bytes of a picture on disk, with the files beside it; rather too few."""
    settings, (height, width) = shown.scene.arto, shown.field.shape
    shown_twice = 1 + plate.window_of(shown.scene).crop
    a_pixel = 16 * shown_twice
    if len(shown.takes) > 1:
        a_pixel += 12 * shown_twice + 12
    if settings.write_data:
        a_pixel += 4 * sum(len(letters) for letters in plate.DATA.values())
        a_pixel += 48 if settings.cryptomatte else 0
    if settings.layers != "OFF":
        parts = len(settings.groups) + 1 if settings.layers == "GROUPS" else 6
        a_pixel += (6 if settings.layers_half else 12) * parts * shown_twice
    return round(a_pixel * height * width * _PACKED)


def check_room(needed: Mapping[Path, int]) -> None:
    """Raise SceneError where a disk has no room for pictures. needed: bytes by the pictures' paths.

    A picture takes the place of an older one, which counts as room.
    """
    by_folder: dict[Path, int] = {}
    for path, more in needed.items():
        there = path.parent
        while not there.exists() and there != there.parent:
            there = there.parent
        old = path.stat().st_size if path.is_file() else 0
        by_folder[there] = by_folder.get(there, 0) + max(more - old, 0)
    for folder, more in by_folder.items():
        free = room.free_disk(folder)
        if free < more:
            raise SceneError(
                f"the pictures need about {size(more)} of disk, and {folder} has {size(free)} "
                "free: make room, or choose another output"
            )
