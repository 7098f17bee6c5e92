"""The files of footage: which of them is shown at a frame, and whether it is there and whole."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import bpy

from ...core.errors import ExrError, SceneError
from ..blender.sequences import (
    Shown,
    Timing,
    damage_of,
    file_of,
    number_of,
    shown_at,
    state_of,
    whole_size,
)

# What footage is.
Source = bpy.types.Image | bpy.types.MovieClip


def file_at(source: Source, timing: Timing | None, frame: int) -> Path | None:
    """The file of an image or clip that is shown at a frame of the scene; None without such a file.

    timing: an image's user or node. The file may be missing.
    """
    if source.source not in {"FILE", "SEQUENCE"} or getattr(source, "packed_file", None):
        return None
    path = Path(bpy.path.abspath(source.filepath, library=source.library))
    if source.source == "FILE":
        return path
    return file_of(path, _shown(source, timing, frame, path).number)


def _shown(source: Source, timing: Timing | None, frame: int, path: Path) -> Shown:
    """Which picture of a sequence or movie is shown at a frame."""
    if isinstance(source, bpy.types.MovieClip):
        first = number_of(path) if source.source == "SEQUENCE" else 1
        number = (first or 0) + frame - source.frame_start + source.frame_offset
        return Shown(number, False)
    return shown_at(timing, frame) if timing is not None else Shown(frame, False)


def check(source: Source, timing: Timing | None, frame: int) -> str:
    """Look at what an image or clip shows at a frame; returns a warning in words, or "".

    Raises SceneError where the file of the frame is missing or damaged, where it is of another size
    than the sequence, or where a movie has no such frame.
    """
    if source.source not in {"FILE", "SEQUENCE", "MOVIE"} or getattr(source, "packed_file", None):
        return ""
    path = Path(bpy.path.abspath(source.filepath, library=source.library))
    held = source.source != "FILE" and _shown(source, timing, frame, path).held
    warning = (
        f"the footage '{source.name}' does not last until frame {frame}: another of its pictures "
        "is held"
    )
    if source.source == "MOVIE":
        _check_movie(source, timing, frame, path)
        return warning if held else ""
    file = file_at(source, timing, frame)
    assert file is not None
    if wrong := damage_of(file):
        raise SceneError(
            f"the footage '{source.name}' of frame {frame} cannot be used ({wrong}): put the file "
            "there, or choose other footage"
        )
    number = number_of(path)
    if source.source == "FILE" and number not in (None, frame):
        own = file_of(path, frame)
        if own != path and own.is_file():
            return (
                f"the footage '{source.name}' is a single picture, and {own.name} is beside it: "
                "set its source to Image Sequence, if it is one"
            )
    if source.source == "SEQUENCE" and path != file and path.is_file():
        here, there = _size(file, state_of(file)), _size(path, state_of(path))
        if here and there and here != there:
            raise SceneError(
                f"the footage '{source.name}' has {here[0]}x{here[1]} pixels in {file.name}, and "
                f"{there[0]}x{there[1]} in {path.name}: bring the sequence to one size"
            )
    return warning if held else ""


def _check_movie(source: Source, timing: Timing | None, frame: int, path: Path) -> None:
    """Raise SceneError where a movie does not have the frame that is shown."""
    number, length = _shown(source, timing, frame, path).number, source.frame_duration
    if length > 1 and not 1 <= number <= length:
        raise SceneError(
            f"the footage '{source.name}' has {length} frames, and at frame {frame} its frame "
            f"{number} is asked for: set its start, or choose other footage"
        )


@lru_cache(4096)
def _size(path: Path, _: tuple[int, ...]) -> tuple[int, int] | None:
    # the second argument is the state of the file for which an answer holds
    try:
        return whole_size(path)
    except ExrError:
        return None
