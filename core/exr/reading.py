"""Reading EXR files, header by header and layer by layer."""

from __future__ import annotations

import mmap
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ExrError
from .layout import LayoutError, PlainPart, forget
from .layout import check as check_layout
from .layout import plain as plain_parts
from .library import openexr
from .window import Box, box_of, place

_ORDER = "RGBAXYZ"  # of channels in an array; others follow
# How many channels a message names.
_TOLD = 6


def _parts(path: Path, header_only: bool) -> list[Any]:
    """The parts of a file as the library has them. Raises ExrError."""
    parts = check_complete(path)
    try:
        file = openexr().File(str(path), separate_channels=True, header_only=header_only)
    except Exception as e:  # the wheel raises plain RuntimeErrors of many wordings
        raise ExrError(f"{path} cannot be read ({e}): it is truncated or no EXR file") from e
    # the library leaves out a part that it cannot decode, with a warning
    if len(file.parts) != parts:
        raise ExrError(f"{path} has a damaged part: make it again")
    return list(file.parts)


def _decoded(path: Path) -> tuple[list[dict[str, Any]], list[dict[str, NDArray]]]:
    """The header of each part and its channels by name, of the whole picture. Raises ExrError."""
    heads, channels = [], []
    for part in _parts(path, header_only=False):
        heads.append(dict(part.header))
        channels.append({name: channel.pixels for name, channel in part.channels.items()})
        part.channels.clear()  # or it would hold what `take` lets go of
    try:
        place(heads, channels)
    except ExrError as e:
        raise ExrError(f"{path} is damaged, {e}: make it again") from None
    return heads, channels


def check_complete(path: Path) -> int:
    """How many parts the file has; ExrError unless all of it is there (`layout`)."""
    with _opened(path) as data, _telling(path):
        return check_layout(data)


def _mapped(path: Path) -> tuple[mmap.mmap, list[PlainPart] | None]:
    """The bytes of a file, and its parts where they may be read there; ExrError as above."""
    data = _opened(path)
    try:
        with _telling(path):
            return data, plain_parts(data)
    except ExrError:
        data.close()
        raise


def _opened(path: Path) -> mmap.mmap:
    """The bytes of a file. Raises ExrError."""
    if not path.is_file():
        raise ExrError(f"there is no file {path}: it was moved or deleted; make it again")
    try:
        if path.stat().st_size < 8:
            raise ExrError(f"{path} is no EXR file (or an empty one): make it again")
        with path.open("rb") as f:
            return mmap.mmap(f.fileno(), 0, access=mmap.ACCESS_READ)
    except OSError as e:
        raise ExrError(f"{path} cannot be read ({e}): look at its permissions and disk") from e


@contextmanager
def _telling(path: Path) -> Iterator[None]:
    """Says of which file a layout is wrong."""
    try:
        yield
    except LayoutError as e:
        raise ExrError(f"{path} is truncated or damaged, {e}: make it again") from None


def whole_parts(path: Path) -> list[tuple[dict[str, Any], dict[str, NDArray]]]:
    """The header and the channels by name of each part of a file. Raises ExrError."""
    return list(zip(*_decoded(path), strict=True))


def part_names(path: Path) -> list[str]:
    """The names of the layers of a file as `parts` has them, without reading pixels."""
    found = [p.header for p in _parts(path, header_only=True)]
    return list(_layers(path, [(h, [c.name for c in h["channels"]]) for h in found]))


def header(path: Path) -> dict[str, Any]:
    """The header of the first part."""
    return dict(_parts(path, header_only=True)[0].header)


def windows(path: Path) -> tuple[Box, Box]:
    """The data and the display window of the first part. Raises ExrError."""
    head = header(path)
    return box_of(head["dataWindow"]), box_of(head["displayWindow"])


def read(path: Path) -> dict[str, NDArray]:
    """All layers of a file by name; see `parts`."""
    return dict(parts(path))


def parts(path: Path) -> Iterator[tuple[str, NDArray]]:
    """The layers of a file, one by one: name, and (H, W, C), C as R, G, B(, A), or one channel.

    Each may be a part of its own, or many share a part (as Blender interleaves them): then a
    layer's name is that of its channels before the last dot. Raises ExrError for a file that is
    missing, truncated, or has layers of odd channels.
    """
    with Layers(path) as layers:
        for name in layers.names:
            yield name, layers.take(name)


class Layers:
    """The layers of a file, each read when it is asked for; see `parts`.

    Of a file whose pixels lie in it as they are, as those of a capture do, nothing else is in
    memory; another is decoded when it is opened, and `take` lets go of what it gives. To be closed.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._data, plain = _mapped(path)
        self._plain: list[PlainPart] = plain or []
        self._decoded: list[dict[str, NDArray]] = []
        heads: list[tuple[dict[str, Any], Iterable[str]]]
        if self._plain:
            heads = [({"name": p.name}, [c for c, _ in p.channels]) for p in self._plain]
        else:
            found, self._decoded = _decoded(path)
            heads = [(head, list(p)) for head, p in zip(found, self._decoded, strict=True)]
        self._layers = _layers(path, heads)
        self._places = [_places(part) for part in self._plain]

    def __enter__(self) -> Layers:
        return self

    def __exit__(self, *_: object) -> None:
        self._decoded = []
        self._data.close()

    @property
    def names(self) -> list[str]:
        return list(self._layers)

    def read(self, name: str, into: NDArray | None = None) -> NDArray:
        """A layer, (H, W, C); into: an array of its shape to read it to."""
        planes = self.planes(name)
        if into is None:
            return self._filled(name, planes)
        for n, pixels in enumerate(planes):
            into[..., n] = pixels
        return into

    def shape(self, name: str) -> tuple[int, int, int]:
        """(H, W, C) of a layer."""
        planes = self.planes(name)
        height, width = planes[0].shape
        return height, width, len(planes)

    def dtype(self, name: str) -> np.dtype:
        """What a layer's first channel is of."""
        return self.planes(name)[0].dtype

    def take(self, name: str) -> NDArray:
        """A layer, (H, W, C), for the last time: it is never in memory twice."""
        planes = self.planes(name)
        if self._decoded:
            part, channels = self._layers[name]
            for channel in channels:
                del self._decoded[part][channel]
        return self._filled(name, planes)

    def let_go(self, name: str) -> None:
        """A layer is not looked at for a while: what is mapped of it need not stay in memory."""
        if self._plain:
            there = self._plain[self._layers[name][0]]
            forget(self._data, there.offset, there.offset + there.height * there.stride)

    def planes(self, name: str) -> list[NDArray]:
        """The channels of a layer, each (H, W), where they lie: not to be kept or written to."""
        part, channels = self._layers[name]
        if not self._plain:
            return [self._decoded[part][channel] for channel in channels]
        there, found = self._plain[part], []
        for channel in channels:
            dtype, at = self._places[part][channel]
            strides = there.stride, dtype.itemsize
            shape = there.height, there.width
            found.append(np.ndarray(shape, dtype, self._data, at, strides))
        return found

    def _filled(self, name: str, planes: list[NDArray]) -> NDArray:
        if any(pixels is None for pixels in planes):
            raise ExrError(f"{self.path} has no pixels in '{name}': make it again")
        if len({pixels.shape for pixels in planes}) > 1:
            raise ExrError(
                f"{self.path} has channels of different sizes in '{name}': save it without "
                "subsampling"
            )
        half = all(pixels.dtype == np.float16 for pixels in planes)
        out = np.empty((*planes[0].shape, len(planes)), np.float16 if half else np.float32)
        for n in reversed(range(len(planes))):
            out[..., n] = planes.pop()  # which lets go of it
        return out


def _places(part: PlainPart) -> dict[str, tuple[np.dtype, int]]:
    """What each channel of a part is of, and where its first row begins. Once for all: a part may
    be all the thousands of channels of a capture, as Blender 4.5 writes them."""
    found, at = {}, part.offset
    for channel, kind in part.channels:
        dtype = np.dtype("<f2" if kind == 1 else "<f4")
        found[channel] = dtype, at
        at += part.width * dtype.itemsize
    return found


def _layers(
    path: Path, parts: list[tuple[dict[str, Any], Iterable[str]]]
) -> dict[str, tuple[int, list[str]]]:
    """The layers of a file: of each name the part, and the channels in the order of an array's.

    parts: the header of each and the names of its channels.
    """
    out: dict[str, tuple[int, list[str]]] = {}
    for part, (head, channels) in enumerate(parts):
        by_prefix: dict[str, list[str]] = {}
        for channel in channels:
            by_prefix.setdefault(channel.rpartition(".")[0], []).append(channel)
        own = str(head.get("name", ""))
        for prefix, names in by_prefix.items():
            # a part's own name loses nothing where the part is one layer
            name = own if own and len(by_prefix) == 1 else prefix or own
            if own and not name.startswith(own):
                name = f"{own}.{name}"
            if name in out:
                raise ExrError(f"{path} has two layers '{name}': give each a name of its own")
            last = {channel: channel.rpartition(".")[2] for channel in names}
            if len(names) > 1 and not all(len(c) == 1 for c in last.values()):
                more = f" and {len(names) - _TOLD} more" if len(names) > _TOLD else ""
                raise ExrError(
                    f"{path} has channels {sorted(names)[:_TOLD]}{more}: expected R, G, B or one "
                    "a layer; save its layers as parts, or as files of their own"
                )
            out[name] = part, sorted(names, key=lambda c: (_place(last[c]), last[c]))
    return out


def _place(channel: str) -> int:
    """Where a channel stands in an array; small letters are the same colours."""
    found = _ORDER.find(channel.upper())
    return found if found >= 0 else len(_ORDER)
