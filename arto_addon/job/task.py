"""What a job is told, and what it tells: two small files beside the snapshot that it works on.

The window writes `task.json` and the job reads it. The job writes `progress.json`, the whole file
each time, and the window reads it.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal, get_args

from ...core import signed
from ...core.description import Description
from ...core.errors import ArtoError
from ..blender.devices import Devices
from .verbs import VERBS, Verb

TASK = "task.json"
PROGRESS = "progress.json"

# How a job ended; empty while it runs.
End = Literal["", "done", "cancelled", "failed"]


@dataclass(frozen=True)
class Painted:
    """An image whose pixels are in no file.

    library: the path of the library that the image is from, empty for an image of the file itself;
    pixels: the name of the .npy file beside the snapshot.
    """

    name: str
    library: str
    pixels: str


@dataclass(frozen=True)
class Task:
    """What a job is to do.

    blend: the artist's file, empty where it was never saved; devices: the artist's render devices,
    None where Cycles is switched off; painted: images whose pixels are in no file; scripts: whether
    the window has allowed all scripts of the file; library: the path of the library that the scene
    is from, empty for a scene of the file itself.
    """

    verb: Verb
    scene: str
    view_layer: str
    blend: str
    devices: Devices | None = None
    painted: tuple[Painted, ...] = ()
    scripts: bool = False
    library: str = ""

    def write(self, folder: Path) -> Path:
        path = folder / TASK
        signed.write(path, asdict(self))
        return path

    @staticmethod
    def read(path: Path) -> Task:
        """Read a task. Raises ArtoError where the file is no task."""
        said = Description(path, _no_task)
        said.only(
            "verb", "scene", "view_layer", "blend", "devices", "painted", "scripts", "library"
        )
        return Task(
            said.choice("verb", VERBS),
            said.text("scene"),
            said.text("view_layer"),
            said.text("blend"),
            _devices(said),
            tuple(_painted(said, entry) for entry in said.kind("painted", list, [])),
            said.kind("scripts", bool, False),
            said.kind("library", str, ""),
        )


def _devices(said: Description) -> Devices | None:
    found = said.kind("devices", dict)
    if found is None:
        return None
    said.only("kind", "use", where=found)
    use = found.get("use")
    if not isinstance(use, dict) or not all(isinstance(used, bool) for used in use.values()):
        raise said.wrong("use", use)
    return Devices(said.text("kind", found), use)


def _painted(said: Description, entry: object) -> Painted:
    if not isinstance(entry, dict):
        raise said.wrong("painted", entry)
    said.only("name", "library", "pixels", where=entry)
    return Painted(
        said.text("name", entry),
        said.text("library", entry),
        said.file_name(entry.get("pixels"), "pixels"),
    )


def _no_task(text: str) -> ArtoError:
    return ArtoError(f"{text}: it is no task of this version of ARTO; start the work again")


@dataclass(frozen=True)
class State:
    """How far a job is.

    share: how much is done, 0 to 1; text: what the job is doing, or how it ended; spent: seconds so
    far; left: seconds to go, None while not known; result: the file or folder that was made.
    """

    share: float = 0.0
    text: str = "starting"
    spent: float = 0.0
    left: float | None = None
    end: End = ""
    result: str = ""

    def write(self, folder: Path) -> None:
        signed.write(folder / PROGRESS, asdict(self))

    @staticmethod
    def read(folder: Path) -> State:
        """Read the last state that was written; before any, the state of a job that starts.

        Raises ArtoError where the file is no state.
        """
        if not (folder / PROGRESS).exists():
            return State()
        said = Description(folder / PROGRESS, _no_state)
        said.only("share", "text", "spent", "left", "end", "result")
        left = None if said.data.get("left") is None else said.number("left", 0.0, 0.0, math.inf)
        return State(
            said.number("share", 0.0, 0.0, 1.0),
            said.text("text"),
            said.number("spent", 0.0, 0.0, math.inf),
            left,
            said.choice("end", get_args(End)),
            said.text("result"),
        )


def _no_state(text: str) -> ArtoError:
    return ArtoError(f"{text}: how far the work is cannot be told; start it again")
