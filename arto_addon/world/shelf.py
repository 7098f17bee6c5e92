"""The shelf: the HDRIs used last, and the HDRIs and worlds of Blender's asset libraries.

Folders are looked through in a thread. The list of the last HDRIs is a small file of ARTO's own in
the user's configuration.
"""

from __future__ import annotations

import contextlib
import json
import os
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import bpy

from ...core import exr
from ...core.errors import ArtoError
from ...core.files import whole
from ...core.regular import open_regular
from . import controls
from .blend_worlds import worlds_in
from .check import world_of

# The file of the last HDRIs, and how many are kept.
RECENT, MOST_RECENT = "arto_hdris.json", 12
# The most that asset libraries give, and the seconds that are spent on looking through them.
MOST, SECONDS = 300, 60.0


@dataclass(frozen=True)
class Item:
    """A light to choose. path: of an HDRI, or of a .blend; world: its name in the .blend."""

    path: str
    world: str = ""

    @property
    def title(self) -> str:
        return self.world or Path(self.path).stem


_recent: list[Item] = []
_found: list[Item] = []
_thread = threading.Thread()
# The folders that were looked through; None before the first look.
_folders: list[tuple[str, ...] | None] = [None]


def items() -> list[Item]:
    """All that is known by now: what was used last, then what the libraries have."""
    return list(dict.fromkeys([*_recent, *_found]))


def look(done: Callable[[], None]) -> None:
    """Look through the asset libraries, unless these were looked through before. It takes no time.

    done: called in the thread once all was found.
    """
    global _thread
    libraries = bpy.context.preferences.filepaths.asset_libraries
    folders = tuple(p for each in libraries if (p := bpy.path.abspath(each.path)))
    if folders == _folders[0] or _thread.is_alive():
        return
    _folders[0] = folders
    path = _file()

    def work() -> None:
        noted = [item for item in _read(path) if item not in _recent]
        _recent.extend(item for item in noted if Path(item.path).is_file())
        _found[:] = _in(folders)
        done()

    _thread = threading.Thread(target=work, daemon=True)
    _thread.start()


def looking() -> bool:
    """Whether the libraries are being looked through."""
    return _thread.is_alive()


def forget() -> None:
    """Look through the libraries again when they are next asked for."""
    _folders[0] = None


def note(path: str) -> None:
    """Remember an HDRI as the one that was used last. What cannot be written is not remembered.

    What is known keeps its place until Blender is started anew: nothing moves under the mouse.
    """
    item = Item(str(Path(bpy.path.abspath(path)).absolute()))
    if item not in items():
        _recent.insert(0, item)
    file = _file()
    before = _read(file)
    now = list(dict.fromkeys([item, *before]))[:MOST_RECENT]
    if now != before:
        with contextlib.suppress(OSError), whole(file) as partial:
            partial.write_text(json.dumps([i.path for i in now]), encoding="utf-8")


def note_shown(scene: bpy.types.Scene) -> None:
    """Remember the HDRI that lights a scene, where it is a file."""
    world = world_of(scene)
    image = controls.hdri(world) if world else None
    if image is not None and image.source == "FILE" and image.filepath and not image.packed_file:
        note(bpy.path.abspath(image.filepath, library=image.library))


def _file() -> Path:
    return Path(bpy.utils.user_resource("CONFIG")) / RECENT


def _read(path: Path) -> list[Item]:
    """The HDRIs of the file; none where it is not there, or is not what was written."""
    try:
        with open_regular(path) as file:
            found = json.loads(file.read(1 << 20))
    except (OSError, ValueError):
        return []
    if not isinstance(found, list):
        return []
    return [Item(p) for p in found if isinstance(p, str) and p][:MOST_RECENT]


def _in(folders: Iterable[str]) -> list[Item]:
    """The HDRIs and worlds in folders, by their names."""
    until, found = time.monotonic() + SECONDS, []
    for folder in folders:
        for at, below, names in os.walk(folder):
            below[:] = sorted(name for name in below if not name.startswith("."))
            for name in sorted(names):
                path = Path(at) / name
                end = path.suffix.lower()
                if end == ".blend":
                    found += [Item(str(path), world) for world in worlds_in(path)]
                elif end in {".hdr", ".exr"} and _is_panorama(path, end):
                    found.append(Item(str(path)))
                if len(found) >= MOST or time.monotonic() > until:
                    return found[:MOST]
    return found


def _is_panorama(path: Path, end: str) -> bool:
    """Whether a picture is twice as wide as high, as no texture of a surface is."""
    try:
        if end == ".exr":
            (left, bottom, right, top), _ = exr.windows(path)
            return right - left + 1 == 2 * (top - bottom + 1)
        with open_regular(path, follow=True) as file:
            head = file.read(4096)
        size = next(line for line in head.split(b"\n") if line.startswith((b"-Y ", b"+Y ")))
        _, height, _, width = size.split()
        return int(width) == 2 * int(height)
    except (OSError, ArtoError, ValueError, StopIteration):
        return False
