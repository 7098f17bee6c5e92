"""Blender's own OpenImageIO; no other module imports it.

The format of the files is EXR alone: whatever else OpenImageIO reads is refused before.

Examples
--------
>>> imported([Path("no folder")]).__name__
'OpenImageIO'
"""

from __future__ import annotations

import importlib.machinery
import importlib.util
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ExrError
from .head import LINES, PartLayout
from .window import Box

_MODULE = "OpenImageIO"
# Pixels of several channels pass through memory of this size, one band of lines after the other.
_BAND_BYTES = 1 << 22
# Kinds of channels as OpenImageIO calls them, by their numbers in a file.
_KINDS = ("uint", "half", "float")
_TYPES = {"uint": np.uint32, "half": np.float16, "float": np.float32}
# The most channels of a part that it reads, and those that it opens without being told to. The
# limit is that of the process: one thread changes it at a time, and puts it back.
_MOST_CHANNELS, _ASKS_FROM = 1 << 12, 1 << 8
_LIMIT, _ASKING = "limits:channels", threading.Lock()


def imported(folders: Sequence[Path]) -> ModuleType:
    """Import OpenImageIO.

    Parameters
    ----------
    folders : sequence of Path
        Where Blender has the modules that it brings for Python. Where OpenImageIO is in none, as in
        a Blender of a system's packages, it is looked for as any other module.

    Returns
    -------
    module

    Raises
    ------
    ExrError
        There is none; the message names the packages that bring it.
    """
    if there := sys.modules.get(_MODULE):  # a process cannot load a second copy of it
        return there
    spec = importlib.machinery.PathFinder.find_spec(_MODULE, [str(f) for f in folders])
    spec = spec or importlib.util.find_spec(_MODULE)
    if spec is None or spec.loader is None:
        version = f"{sys.version_info.major}.{sys.version_info.minor}"
        raise ExrError(
            f"this Blender has no OpenImageIO for its Python {version}, which reads and writes EXR "
            "files: install the package of your system that brings it (Debian, Ubuntu and Fedora: "
            "python3-openimageio; Arch: openimageio), or use the Blender of blender.org"
        )
    module = importlib.util.module_from_spec(spec)
    sys.modules[_MODULE] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[_MODULE]
        raise
    return module


class OpenImageIo:
    """OpenImageIO as a `library.Library`.

    Parameters
    ----------
    module : module
        OpenImageIO, see `imported`.
    """

    name = _MODULE

    def __init__(self, module: ModuleType) -> None:
        self._module: Any = module

    def decode(self, path: Path, parts: Sequence[PartLayout]) -> list[dict[str, NDArray]]:
        """Read all pixels of a file.

        Parameters
        ----------
        path : Path
        parts : sequence of PartLayout

        Returns
        -------
        list of dict of str to (H, W) array

        Raises
        ------
        ExrError
            Pixels cannot be decoded.
        """
        most = max(len(part.channels) for part in parts)
        if most > _MOST_CHANNELS:
            raise ExrError(
                f"{path} has {most} channels in a part, and OpenImageIO reads {_MOST_CHANNELS}: "
                "save its layers as parts, or without compression"
            )
        with self._leave_for(most):
            file = self._module.ImageInput.open(str(path))
            if file is None:
                raise _unread(path, self._module.geterror)
            try:
                return [self._part(path, file, n, part) for n, part in enumerate(parts)]
            finally:
                file.close()

    def encode(
        self, path: Path, parts: Sequence[dict[str, NDArray]], box: Box, compression: str
    ) -> None:
        """Write a file that has the pixels.

        Parameters
        ----------
        path : Path
        parts : sequence of dict of str to (H, W) array
        box : Box
        compression : str

        Raises
        ------
        OSError
            The file cannot be written.
        """
        specs = [self._spec(part, n, box, compression) for n, part in enumerate(parts)]
        file = self._module.ImageOutput.create("openexr")
        try:
            # all parts are told before the pixels of the first
            if not file.open(str(path), specs[0] if len(specs) == 1 else tuple(specs)):
                raise OSError(file.geterror())
            for n, (part, spec) in enumerate(zip(parts, specs, strict=True)):
                if n and not file.open(str(path), spec, "AppendSubimage"):
                    raise OSError(file.geterror())
                planes = list(part.values())
                kind = np.result_type(*planes)
                step = _band(spec.width * len(planes) * kind.itemsize, LINES[compression])
                for y in range(0, spec.height, step):
                    end = min(y + step, spec.height)
                    band = np.empty((end - y, spec.width, len(planes)), kind)
                    for c, plane in enumerate(planes):
                        band[..., c] = plane[y:end]
                    if not file.write_scanlines(box[1] + y, box[1] + end, 0, band):
                        raise OSError(file.geterror())
        finally:
            closed = file.close()
        if not closed:
            raise OSError(file.geterror())

    def _spec(self, part: dict[str, NDArray], number: int, box: Box, compression: str) -> Any:
        """What OpenImageIO is told of a part."""
        kinds = [{2: "half", 4: "float"}[plane.dtype.itemsize] for plane in part.values()]
        spec = self._module.ImageSpec(
            box[2] - box[0] + 1, box[3] - box[1] + 1, len(part), max(kinds, key=_KINDS.index)
        )
        spec.x, spec.y = spec.full_x, spec.full_y = box[:2]
        spec.full_width, spec.full_height = spec.width, spec.height
        spec.channelnames = tuple(part)
        if len(set(kinds)) > 1:
            spec.channelformats = tuple(self._module.TypeDesc(kind) for kind in kinds)
        spec.attribute("compression", "none" if compression == "NO" else compression.lower())
        spec.attribute("oiio:subimagename", f"part{number}")
        return spec

    def _part(self, path: Path, file: Any, number: int, part: PartLayout) -> dict[str, NDArray]:
        """The planes of a part. Raises ExrError."""
        if not file.seek_subimage(number, 0):
            raise _unread(path, file.geterror)
        spec, kinds = file.spec(), dict(part.channels)
        size = part.height, part.width
        names = list(spec.channelnames)
        if (spec.height, spec.width) != size or sorted(names) != sorted(kinds):
            raise ExrError(f"{path} has a damaged part: make it again")
        order = [_KINDS[kinds[name]] for name in names]
        planes = {
            n: np.empty(size, _TYPES[k]) for n, k in zip(spec.channelnames, order, strict=True)
        }
        # Floats hold every half, but not every whole number: those are read apart.
        runs = [(0, len(order), max(order, key=_KINDS.index))]
        if "uint" in order:
            runs = [(c, c + 1, kind) for c, kind in enumerate(order)]
        for first, end, kind in runs:
            step = _band(part.width * (end - first) * _TYPES[kind]().itemsize, part.lines)
            some = list(planes.values())[first:end]
            for y in range(0, part.height, step):
                to = min(y + step, part.height)
                band = self._band(file, number, spec, (y, to), (first, end), kind, part)
                if band is None:
                    raise _unread(path, file.geterror)
                for c, plane in enumerate(some):
                    plane[y:to] = band[..., c]
        return planes

    @staticmethod
    def _band(
        file: Any,
        number: int,
        spec: Any,
        lines: tuple[int, int],
        channels: tuple[int, int],
        kind: str,
        part: PartLayout,
    ) -> NDArray | None:
        """Some lines of some channels of a part -> (lines, W, channels); None for an error."""
        y, end = (spec.y + line for line in lines)
        if part.tiles:
            across = spec.x, spec.x + spec.width
            found = file.read_tiles(number, 0, *across, y, end, 0, 1, *channels, kind)
        else:
            found = file.read_scanlines(number, 0, y, end, 0, *channels, kind)
        if found is None:
            return None
        return found.reshape(lines[1] - lines[0], part.width, channels[1] - channels[0])

    @contextmanager
    def _leave_for(self, channels: int) -> Iterator[None]:
        """Let OpenImageIO open a file of so many channels in a part."""
        if channels <= _ASKS_FROM:
            yield
            return
        with _ASKING:
            before = self._module.get_int_attribute(_LIMIT)
            self._module.attribute(_LIMIT, max(channels, before))
            try:
                yield
            finally:
                self._module.attribute(_LIMIT, before)


def _band(line_bytes: int, lines: int) -> int:
    """How many lines are read or written at once: whole chunks of `lines` each."""
    return max(1, _BAND_BYTES // (line_bytes * lines)) * lines


def _unread(path: Path, said: Callable[[], str]) -> ExrError:
    """The error of a file that cannot be decoded; said: gives OpenImageIO's words for it."""
    try:
        words = said().strip()
    except UnicodeDecodeError as e:  # they quote the file, whatever is in it
        words = e.object.decode("utf-8", "replace").strip()
    return ExrError(
        f"{path} cannot be read ({words}): it is damaged, or packed in a way that this OpenImageIO "
        "does not know; make it again, packed as ZIP"
    )
