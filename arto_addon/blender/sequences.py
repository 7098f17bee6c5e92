"""Numbered files: which of a sequence Blender shows at a frame, and whether one is whole."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr, picture_files
from ...core.errors import ExrError


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
    numbers. Raises ExrError for an EXR, and for pixels that are no numbers, with what is wrong.
    """
    try:
        kind = picture_files.kind_of(path)
    except OSError:
        return None
    if kind == "EXR":
        parts = exr.whole_parts(path)
        if finite:
            _check_parts(path, parts)
        _, (x0, y0, x1, y1) = exr.windows(path)
        return x1 - x0 + 1, y1 - y0 + 1
    if picture_files.is_cut_file(path):
        return None
    try:
        image = bpy.data.images.load(str(path))
    except RuntimeError:
        return None
    try:
        # Blender reads the file when it is asked for the size
        size = tuple(image.size)
        if finite and kind == "TIFF" and min(size):
            check_finite(image, str(path))
        return (size[0], size[1]) if min(size) else None
    finally:
        bpy.data.images.remove(image)


def check_finite(image: bpy.types.Image, name: str) -> None:
    """Raise ExrError where a colour of an image in memory is infinite or not a number."""
    if image.is_float:
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        _check_colours(name, [pixels.reshape(-1, image.channels)[:, :3].T])


def _check_parts(path: Path, parts: list[tuple[dict[str, Any], dict[str, NDArray]]]) -> None:
    """Raise ExrError where a colour of the picture itself is infinite or not a number."""
    for head, channels in parts:
        part = str(head.get("name", ""))
        planes = [plane for name, plane in channels.items() if _is_colour(name, part)]
        _check_colours(str(path), planes)


def _is_colour(channel: str, part: str) -> bool:
    """Whether a channel is of the picture: of its root, or of the layer that a render calls so.

    A single channel, Y, is the picture in a part without a name, and a layer in one that has one.
    """
    layer, _, letter = channel.rpartition(".")
    letters = {"R", "G", "B"} if part else {"R", "G", "B", "Y"}
    return letter.upper() in letters and layer.rpartition(".")[2] in {"", "Combined"}


def _check_colours(name: str, planes: list[NDArray]) -> None:
    bad = max((int((~np.isfinite(plane)).sum()) for plane in planes), default=0)
    if bad:
        raise ExrError(f"{name} has {bad} pixels that are infinite or not a number: repair them")


@functools.lru_cache(4096)
def _damage(path: Path, finite: bool, _: tuple[int, ...]) -> str:
    # once for the look ahead, the first picture and the next ones, while the file is the same
    return damage(path, finite)


def damage_of(path: Path) -> str:
    """Say what is wrong with a file whose colours must be numbers; once while it is the same."""
    return _damage(path, True, state_of(path))


def incomplete(path: Path) -> str:
    """Say in words which part of a picture's file is missing, without decoding it; "" for none."""
    if not path.is_file():
        return f"{path} is not there"
    try:
        if picture_files.kind_of(path) == "EXR":
            exr.part_names(path)
        elif picture_files.is_cut_file(path, unpacks=False):
            return f"{path} is damaged or cut off"
    except (OSError, ExrError) as e:
        return str(e).partition(": ")[0]
    return ""


def state_of(path: Path) -> tuple[int, ...]:
    """What changes when a file is replaced; empty where there is none."""
    if not path.is_file():
        return ()
    state = path.stat()
    return state.st_ino, state.st_size, state.st_mtime_ns, state.st_ctime_ns


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
