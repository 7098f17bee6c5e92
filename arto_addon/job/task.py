"""What a job is told, and what it tells: two small files beside the snapshot that it works on.

`task.json` is written by the window and read by the job, `progress.json` the other way round, whole
each time.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ...core.errors import ArtoError
from ...core.files import write_text

TASK = "task.json"
PROGRESS = "progress.json"
VERBS = (
    "capture", "fit", "relight", "capture_frames", "relight_frames", "shoot", "relight_looks",
    "verify", "composite",
)  # fmt: skip


@dataclass(frozen=True)
class Painted:
    """An image whose pixels are in no file: they are beside the snapshot, as `pixels`, .npy."""

    name: str
    library: str
    pixels: str


@dataclass(frozen=True)
class Task:
    """verb: one of `VERBS`; blend: the artist's file, empty where it was never saved; devices: the
    artist's render devices, as Cycles' preferences have them; painted: see `Painted`."""

    verb: str
    scene: str
    view_layer: str
    blend: str
    devices: dict[str, Any] = field(default_factory=dict)
    painted: tuple[Painted, ...] = ()

    def write(self, folder: Path) -> Path:
        path = folder / TASK
        write_text(path, json.dumps(asdict(self)))
        return path

    @staticmethod
    def read(path: Path) -> Task:
        """Raises ArtoError for a file that is no task."""
        try:
            data = json.loads(path.read_text(encoding="utf-8"))
            painted = tuple(Painted(**p) for p in data.pop("painted"))
            return Task(**data, painted=painted)
        except (OSError, ValueError, TypeError, KeyError, AttributeError) as e:
            raise ArtoError(f"{path} is no task of ARTO's ({e!r})") from e


@dataclass(frozen=True)
class State:
    """How far a job is.

    share: 0 to 1; left: seconds, None while nobody knows; end: empty while it runs, then `done`,
    `cancelled` or `failed`; text: what it is doing, or how it ended; result: the file or folder
    that it made.
    """

    share: float = 0.0
    text: str = "starting"
    spent: float = 0.0
    left: float | None = None
    end: str = ""
    result: str = ""

    def write(self, folder: Path) -> None:
        write_text(folder / PROGRESS, json.dumps(asdict(self)))

    @staticmethod
    def read(folder: Path) -> State:
        """The last one written; the first one where there is none yet."""
        try:
            return State(**json.loads((folder / PROGRESS).read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError):
            return State()
