"""The window's side of a job: the one that runs in this session, and what became of the last.

A job holds no data-block of the file that is open and no event of the window: it is a process and a
folder. So whatever the artist does meanwhile, undo, another file, quitting, does not reach it.
"""

from __future__ import annotations

import contextlib
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import bpy
from bpy.app.handlers import persistent

from ...core import marked
from ...core.errors import ArtoError, BusyError, SceneError
from ...core.files import Lock
from ...core.units import clock
from ..blender import scripts
from ..blender.addon import ADDON
from ..blender.quitting import not_when_quitting, when_quitting
from ..shot import paths, watch
from ..shot.shot import shot_of
from . import snapshot
from .run import CANCEL, PATIENCE
from .task import State
from .verbs import VERBS, Verb

# How often the window looks how far the job is.
EVERY = 0.2
LOG = "log.txt"


@dataclass
class Outcome:
    """How the last job ended. level: `INFO`, `WARNING` or `ERROR`."""

    level: str
    text: str
    verb: Verb | None = None


class SecondBlender:
    """A job that runs: a Blender of its own on a snapshot in a folder of its own."""

    def __init__(self, verb: Verb, scene: bpy.types.Scene, view_layer: str) -> None:
        """Take the snapshot and start. Raises SceneError, BusyError; then nothing is left."""
        self.verb: Verb = verb
        self.begun = time.monotonic()
        shot = shot_of(scene, view_layer)
        self.title = shot.title
        claimed = paths.claim(scene, view_layer)
        # an undo step with the ID that the claim may have given is wanted: without it an undo
        # would take it away, and a save after that lose what was captured
        self.scene_id = scene.arto.scene_id
        self.blend = bpy.data.filepath
        self.light = scene.arto.look.strip()
        _remove_leftovers(claimed)
        if VERBS[verb].captures and (holder := Lock.holder(claimed)):
            raise BusyError(
                f"{claimed} is in use: {holder}; wait until it is done, or end it there"
            )
        self.folder = Path(tempfile.mkdtemp(prefix="job-", dir=claimed))
        marked.mark(self.folder, "job")
        self.lock = Lock(self.folder, "following").__enter__()
        try:
            blend, task = snapshot.take(self.folder, verb, scene, view_layer)
            self.log = (self.folder / LOG).open("wb")
            self.process = subprocess.Popen(
                _command(blend, task),
                stdin=subprocess.PIPE,
                stdout=self.log,
                stderr=subprocess.STDOUT,
                **_QUIETLY,
            )
        except OSError as e:
            self.remove()
            raise SceneError(f"a second Blender cannot be started ({e})") from e
        except BaseException:
            self.remove()
            raise
        self.told: float | None = None
        self.state = State()

    def look(self) -> bool:
        """Whether it still runs; `state` is then how far it is, else how it ended."""
        running = self.process.poll() is None
        try:
            found = State.read(self.folder)
        except ArtoError as e:
            # while the job runs it writes another one soon
            found = self.state if running else State(self.state.share, str(e), end="failed")
        if running:
            self.state = found if not found.end else self.state
            if self.told and time.monotonic() - self.told > PATIENCE + 4:
                self.process.kill()
            return True
        if not found.end and self.told:
            found = State(found.share, "cancelled: finished tiles are kept", end="cancelled")
        elif not found.end:
            text = f"its Blender ended too early (exit code {self.process.returncode})"
            lines = self._last_lines()
            found = State(
                found.share,
                f"{text}: finished tiles are kept, press it again to go on{lines}",
                end="failed",
            )
        self.state = found
        return False

    def _last_lines(self) -> str:
        with contextlib.suppress(OSError):
            text = (self.folder / LOG).read_text(encoding="utf-8", errors="replace")
            # for the console; the panel has the first line
            return "\n" + "\n".join(text.strip().splitlines()[-8:])
        return ""

    @property
    def input(self) -> IO[bytes]:
        """What the job listens to."""
        assert self.process.stdin is not None  # it was started with a pipe
        return self.process.stdin

    def cancel(self) -> None:
        """Tell it to end: at the next step, or in the middle of a render."""
        self.told = self.told or time.monotonic()
        with contextlib.suppress(OSError, ValueError):
            self.input.write(CANCEL.encode())
            self.input.flush()

    def remove(self) -> None:
        """Remove its folder, once it has ended."""
        if log := getattr(self, "log", None):
            log.close()
        self.lock.__exit__(None, None, None)
        marked.remove_quietly(self.folder, "job", self.folder.parent)

    @property
    def spent(self) -> float:
        """Seconds since it was begun."""
        return time.monotonic() - self.begun

    @property
    def line(self) -> str:
        """How far it is, in words."""
        if self.told:
            return "stopping"
        left = self.state.left
        spent = clock(self.spent)
        return f"{self.state.share:.0%}, " + (f"{clock(left)} left" if left is not None else spent)


# No window of a console, and the artist's work first.
_QUIETLY: dict = (
    {"creationflags": 0x08000000 | 0x00004000} if sys.platform == "win32" else {}  # type: ignore
)


def _command(blend: Path, task: Path) -> list[str]:
    line = [bpy.app.binary_path, "-b", scripts.option(), "--addons", ADDON, str(blend)]
    return [*line, "--command", "arto", "job", str(task)]


def _remove_leftovers(claimed: Path) -> None:
    """Folders of jobs whose windows are gone without a word."""
    for folder in claimed.glob("job-*"):
        if not Lock.holder(folder):
            marked.remove_quietly(folder, "job", claimed)


current: SecondBlender | None = None
outcome: Outcome | None = None
# What is done in the window with what a job has made, by verb.
finishers: dict[Verb, Callable[[SecondBlender], str]] = {}


def busy() -> str:
    """What runs, in words for a button that has to wait; empty where nothing does."""
    return f"ARTO is {VERBS[current.verb].doing} {current.title}" if current else ""


def start(verb: Verb, scene: bpy.types.Scene, view_layer: str) -> SecondBlender:
    """Start a job. Raises BusyError where one runs, SceneError; the window goes on."""
    global current, outcome
    if current:
        raise BusyError(f"{busy()}: wait until it is done, or cancel it")
    outcome = None
    current = SecondBlender(verb, scene, view_layer)
    bpy.app.timers.register(_follow, first_interval=EVERY, persistent=True)
    watch.redraw()
    return current


def cancel() -> None:
    if current:
        current.cancel()


def _follow() -> float | None:
    """Look how far the job is; when it has ended, do what is to be done in the window."""
    global current, outcome
    if current is None:
        return None
    job = current
    if job.look():
        _show_share(job)
        watch.redraw()
        return EVERY
    if job.state.end == "done" and _in_the_middle():
        return EVERY  # of a drag or a stroke: the window is not touched
    try:
        level = {"done": "INFO", "cancelled": "WARNING"}.get(job.state.end, "ERROR")
        text = job.state.text
        if job.state.end == "done" and job.verb in finishers:
            text = finishers[job.verb](job)
        outcome = Outcome(level, text, job.verb)
    except Exception as e:
        outcome = Outcome("ERROR", f"{type(e).__name__}: {e}", job.verb)
        raise
    finally:
        current = None
        job.remove()
        _show_share(None)
        paths.forget()
        if outcome:
            print(f"ARTO {job.verb}: {outcome.text}", flush=True)
            outcome.text = outcome.text.splitlines()[0]
        watch.redraw()
    return None


# What a person has in hand: other add-ons have operators that run all the time.
_HANDS = (
    "TRANSFORM_",
    "PAINT_",
    "SCULPT_",
    "MESH_",
    "CURVE_",
    "VIEW3D_",
    "NODE_",
    "GREASE_PENCIL_",
)


def _in_the_middle() -> bool:
    windows = bpy.context.window_manager.windows
    return any(o.bl_idname.startswith(_HANDS) for w in windows for o in w.modal_operators)


_RENDERS = re.compile(r"render (\d+) of (\d+): \d+ basis images")


def plain(text: str) -> str:
    """What a job is doing, in an artist's words."""
    found = _RENDERS.fullmatch(text)
    if found is None:
        return text
    part, parts = found.groups()
    return "rendering" if parts == "1" else f"rendering, part {part} of {parts}"


def _show_share(job: SecondBlender | None) -> None:
    text = None
    if job:
        text = f"{busy()}: {plain(job.state.text)}, {job.line}   (ESC: cancel)"
    for window in bpy.context.window_manager.windows:
        # a timer has no window of its own after a file was opened, and Blender asks for one here
        with bpy.context.temp_override(window=window):
            window.workspace.status_text_set(text)


def end() -> None:
    """Blender quits, or ARTO is switched off: the job ends with it, finished tiles stay.

    It ends because its input closes, as it does when this process is killed, and removes its folder
    by itself: there is no need to wait for it.
    """
    global current
    if current is None:
        return
    job, current = current, None
    with contextlib.suppress(OSError):
        job.input.close()
    with contextlib.suppress(subprocess.TimeoutExpired):
        job.process.wait(2)
    job.lock.__exit__(None, None, None)


@persistent
def _quitting(*_: object) -> None:
    end()


def register() -> None:
    if not bpy.app.background:  # without a window there is no job to end
        when_quitting(_quitting)


def unregister() -> None:
    not_when_quitting(_quitting)
    end()
    if bpy.app.timers.is_registered(_follow):
        bpy.app.timers.unregister(_follow)
