"""The layers of an EXR file, each read when it is asked for.

Examples
--------
>>> layers_of(Path("a.exr"), [({}, ["B", "G", "R", "sky.B", "sky.G", "sky.R"])])
{'': (0, ['R', 'G', 'B']), 'sky': (0, ['sky.R', 'sky.G', 'sky.B'])}
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ExrError
from .layout import PlainPart, forget
from .opening import decoded, mapped

_ORDER = "RGBAXYZ"  # of channels in an array; others follow
# How many channels a message names.
_TOLD = 6


class Layers:
    """The layers of an opened file, each read when it is asked for; a context manager.

    Uncompressed files, such as those of a capture, are read in place and take no memory. Other
    files are decoded when they are opened, and `take` frees each layer that it gives.

    Parameters
    ----------
    path : Path

    Raises
    ------
    ExrError
        As `parts`.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._data, plain = mapped(path)
        self._plain: list[PlainPart] = plain or []
        self._decoded: list[dict[str, NDArray]] = []
        heads: list[tuple[dict[str, Any], Iterable[str]]]
        if self._plain:
            heads = [({"name": p.name}, [c for c, _ in p.channels]) for p in self._plain]
        else:
            found, self._decoded = decoded(path)
            heads = [(head, list(p)) for head, p in zip(found, self._decoded, strict=True)]
        self._layers = layers_of(path, heads)
        self._places = [_places(part) for part in self._plain]

    def __enter__(self) -> Layers:
        return self

    def __exit__(self, *_: object) -> None:
        self._decoded = []
        self._data.close()

    @property
    def names(self) -> list[str]:
        """The names of the layers."""
        return list(self._layers)

    def read(self, name: str, into: NDArray | None = None) -> NDArray:
        """Read a layer.

        Parameters
        ----------
        name : str
        into : (H, W, C) array, optional
            Where to read to.

        Returns
        -------
        (H, W, C) array

        """
        planes = self.planes(name)
        if into is None:
            return _filled(planes)
        for n, pixels in enumerate(planes):
            into[..., n] = pixels
        return into

    def shape(self, name: str) -> tuple[int, int, int]:
        """Give the shape of a layer.

        Parameters
        ----------
        name : str

        Returns
        -------
        tuple of int
            (H, W, C).
        """
        planes = self.planes(name)
        height, width = planes[0].shape
        return height, width, len(planes)

    def dtype(self, name: str) -> np.dtype:
        """Give the type of a layer's first channel.

        Parameters
        ----------
        name : str

        Returns
        -------
        dtype
        """
        return self.planes(name)[0].dtype

    def take(self, name: str) -> NDArray:
        """Read a layer for the last time, so that it is never in memory twice.

        Parameters
        ----------
        name : str

        Returns
        -------
        (H, W, C) array
        """
        planes = self.planes(name)
        if self._decoded:
            part, channels = self._layers[name]
            for channel in channels:
                del self._decoded[part][channel]
        return _filled(planes)

    def let_go(self, name: str) -> None:
        """Free the memory of a layer that is not needed for a while; it can be read again.

        Parameters
        ----------
        name : str
        """
        if self._plain:
            there = self._plain[self._layers[name][0]]
            forget(self._data, there.offset, there.offset + there.height * there.stride)

    def planes(self, name: str) -> list[NDArray]:
        """Give the channels of a layer where they lie. They must not be kept or written to.

        Parameters
        ----------
        name : str

        Returns
        -------
        list of (H, W) array
        """
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


def _filled(planes: list[NDArray]) -> NDArray:
    """The planes as one (H, W, C) array; the list is emptied, so that each plane is freed."""
    half = all(pixels.dtype == np.float16 for pixels in planes)
    out = np.empty((*planes[0].shape, len(planes)), np.float16 if half else np.float32)
    for n in reversed(range(len(planes))):
        out[..., n] = planes.pop()
    return out


def _places(part: PlainPart) -> dict[str, tuple[np.dtype, int]]:
    """The type of each channel of a part, and the byte at which its first row begins.

    Computed once, because Blender 4.5 writes the thousands of channels of a capture into one part.
    """
    found, at = {}, part.offset
    for channel, kind in part.channels:
        dtype = np.dtype("<f2" if kind == 1 else "<f4")
        found[channel] = dtype, at
        at += part.width * dtype.itemsize
    return found


def layers_of(
    path: Path, parts: list[tuple[dict[str, Any], Iterable[str]]]
) -> dict[str, tuple[int, list[str]]]:
    """Find the layers of a file.

    Parameters
    ----------
    path : Path
        The file, for messages.
    parts : list of (dict, iterable of str)
        The header of each part and the names of its channels.

    Returns
    -------
    dict of str to (int, list of str)
        For each layer the number of its part, and its channels in the order of an array.

    Raises
    ------
    ExrError
        Two layers have one name, or a layer has channels of other names than colours.
    """
    out: dict[str, tuple[int, list[str]]] = {}
    for part, (head, channels) in enumerate(parts):
        by_prefix: dict[str, list[str]] = {}
        for channel in channels:
            by_prefix.setdefault(channel.rpartition(".")[0], []).append(channel)
        own = str(head.get("name", ""))
        for prefix, names in by_prefix.items():
            # a part that is one layer keeps its own name
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
    """The place of a channel in an array. Small letters are the same colours."""
    found = _ORDER.find(channel.upper())
    return found if found >= 0 else len(_ORDER)
