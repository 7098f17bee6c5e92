"""Numbered files: which of a sequence Blender shows at a frame, and whether one is whole."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ...core.errors import ExrError
from ...core.regular import open_regular

# What a JPEG file ends with. Blender shows grey in place of what is cut off, and says nothing.
_END_OF_JPEG = b"\xff\xd9"
# Cameras write so many bytes behind a JPEG at most: in these its end is looked for.
_BEHIND = 1 << 16


class Timing(Protocol):
    """What decides the picture of a sequence or movie at a frame: an image's user, or a node."""

    @property
    def frame_duration(self) -> int: ...
    @property
    def frame_start(self) -> int: ...
    @property
    def frame_offset(self) -> int: ...
    @property
    def use_cyclic(self) -> bool: ...


@dataclass(frozen=True)
class Shown:
    """Which picture of a sequence or movie is shown at a frame.

    number: the picture's; held: whether the frame is outside of what the user's or node's duration
    covers, so that Blender shows the first or last picture instead.
    """

    number: int
    held: bool


def shown_at(timing: Timing, frame: int) -> Shown:
    """The picture that an image's user or node shows at a frame, as Blender counts."""
    length = timing.frame_duration
    if length == 0:
        return Shown(0, False)
    number = frame - timing.frame_start + 1
    if timing.use_cyclic:
        return Shown((number - 1) % length + 1 + timing.frame_offset, False)
    inside = min(max(number, 0), length)
    return Shown(inside + timing.frame_offset, inside != number)


def file_of(path: Path, number: int) -> Path:
    """The file of a sequence with this number. path: any file of the sequence.

    The number is the last one in the name, in as many digits. A path without a number is returned
    as it is.
    """
    digits = _DIGITS.search(path.stem)
    if not digits:
        return path
    text = f"{max(number, 0):0{len(digits[1])}d}"
    stem = path.stem[: digits.start()] + text + path.stem[digits.end() :]
    return path.with_name(stem + path.suffix)


def number_of(path: Path) -> int | None:
    """The number in a file's name that counts the files of a sequence; None without one."""
    digits = _DIGITS.search(path.stem)
    return int(digits[1]) if digits else None


_DIGITS = re.compile(r"(\d+)(?=\D*$)")


def form_of(name: str) -> str:
    """The form, for `re.fullmatch`, of the names of a sequence's files. name: of any of them."""
    stem, dot, suffix = name.rpartition(".")
    digits = _DIGITS.search(stem or suffix)
    if not digits:
        return re.escape(name)
    begin, end = (stem or suffix)[: digits.start()], (stem or suffix)[digits.end() :]
    return rf"{re.escape(begin)}\d+{re.escape(end + (dot + suffix if stem else ''))}"


_TILES = {"<UDIM>": r"\d{4}", "<UVTILE>": r"u\d+_v\d+"}


def form_of_tiles(name: str) -> str:
    """The form, for `re.fullmatch`, of the names of all tiles of an image."""
    form = re.escape(name)
    for token, number in _TILES.items():
        form = form.replace(re.escape(token), number)
    return form


def files_of(image: bpy.types.Image, timings: Iterable[Timing] = (), frame: int = 0) -> list[Path]:
    """The files that an image is read from; none where it is in no file.

    timings: the users or nodes that show a sequence, at a frame of the scene.
    """
    if image.packed_files or image.source not in {"FILE", "TILED", "SEQUENCE", "MOVIE"}:
        return []
    path = Path(bpy.path.abspath(image.filepath, library=image.library))
    if image.source == "SEQUENCE":
        return sorted({file_of(path, shown_at(timing, frame).number) for timing in timings})
    if image.source == "TILED":
        return [path.with_name(_of_tile(path.name, tile.number)) for tile in image.tiles]
    return [path]


def _of_tile(name: str, number: int) -> str:
    u, v = (number - 1001) % 10 + 1, (number - 1001) // 10 + 1
    return name.replace("<UDIM>", str(number)).replace("<UVTILE>", f"u{u}_v{v}")


def whole_size(path: Path, finite: bool = False) -> tuple[int, int] | None:
    """Decode a file of a picture -> its width and height; None where it cannot be decoded.

    Of an EXR this is the display window. finite: whether the colours of its picture must be
    numbers. Raises ExrError for an EXR, with what is wrong with it.
    """
    if path.suffix.lower() == ".exr":
        parts = exr.whole_parts(path)
        if finite:
            _check_finite(path, parts)
        _, (x0, y0, x1, y1) = exr.windows(path)
        return x1 - x0 + 1, y1 - y0 + 1
    if path.suffix.lower() in {".jpg", ".jpeg"} and _is_cut(path):
        return None
    try:
        image = bpy.data.images.load(str(path))
    except RuntimeError:
        return None
    try:
        # Blender reads the file when it is asked for the size
        size = tuple(image.size)
        return (size[0], size[1]) if min(size) else None
    finally:
        bpy.data.images.remove(image)


def _check_finite(path: Path, parts: list[tuple[dict[str, Any], dict[str, NDArray]]]) -> None:
    """Raise ExrError where a colour of the picture itself is infinite or not a number."""
    for _, channels in parts:
        planes = [channels[name] for name in "RGB" if name in channels]
        same = planes and len({plane.shape for plane in planes}) == 1
        bad = int((~np.isfinite(planes)).any(axis=0).sum()) if same else 0
        if bad:
            raise ExrError(
                f"{path} has {bad} pixels that are infinite or not a number: repair them"
            )


def damage(path: Path, finite: bool = False) -> str:
    """Say what is wrong with a file of a picture, in words; "" for a file that is whole.

    finite: whether the colours of an EXR's picture must be numbers.
    """
    if not path.is_file():
        return f"{path} is not there"
    try:
        if whole_size(path, finite) is None:
            return f"{path} cannot be read, it is damaged or cut off"
    except ExrError as e:
        return str(e).partition(": ")[0]
    return ""


def _is_cut(path: Path) -> bool:
    """Whether the end of a JPEG file is missing."""
    try:
        with open_regular(path, follow=True) as file:
            size = file.seek(0, 2)
            file.seek(max(size - _BEHIND, 0))
            return _END_OF_JPEG not in file.read()
    except OSError:
        return True
