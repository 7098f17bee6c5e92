"""The window's side of a job: the running job, and how the last job ended.

A job is a process and a folder. It holds no data-block of the open file and no event of the window,
so undo or opening another file does not disturb it.
"""

from __future__ import annotations

import contextlib
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import IO

import bpy
from bpy.app.handlers import persistent

from ...core import marked
from ...core.errors import ArtoError, BusyError, SceneError
from ...core.files import Lock
from ...core.memory import ended_by
from ...core.regular import created, last_of
from ...core.units import clock
from ..blender import scripts
from ..blender.addon import ADDON
from ..blender.quitting import not_when_quitting, when_quitting
from ..shot import paths, watch
from ..shot.shot import shot_of
from . import snapshot
from .outcome import Outcome
from .run import CANCEL, PATIENCE
from .task import State
from .verbs import VERBS, Verb
from .words import plain

# Seconds between the window's looks at a job's progress.
EVERY = 0.2
LOG = "log.txt"
# Bytes of the log's end that are looked at.
_LONGEST = 1 << 16


class SecondBlender:
    """A running job: a second Blender that works on a snapshot in the job's own folder."""

    def __init__(
        self, verb: Verb, scene: bpy.types.Scene, view_layer: str, guest: bool = False
    ) -> None:
        """Take the snapshot and start. Raises SceneError, BusyError, and then leaves no files.

        guest: whether nobody asked for the work, so that it makes way for whatever is asked for.
        """
        self.verb: Verb = verb
        self.guest = guest
        self.begun = time.monotonic()
        shot = shot_of(scene, view_layer)
        self.title = shot.title
        claimed = paths.claim(scene, view_layer)
        # The claim may have given the scene an ID. An undo would take the ID away, and a file
        # saved after that would no longer find its captures: an undo step must hold the ID.
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
            self.log = created(self.folder / LOG)
            self.process = subprocess.Popen(
                _command(blend, task),
                stdin=subprocess.PIPE,
                stdout=self.log,
                stderr=subprocess.STDOUT,
                **scripts.quietly(),
            )
        except OSError as e:
            self.remove()
            raise SceneError(f"a second Blender cannot be started ({e})") from e
        except BaseException:
            self.remove()
            raise
        self.told: float | None = None
        self.seen = 0  # when the picture was written that is shown of a work that goes on
        self.state = State()

    def is_of(self, scene: bpy.types.Scene) -> bool:
        """Whether the job is for this scene of the open file."""
        return (self.blend, self.scene_id) == (bpy.data.filepath, scene.arto.scene_id)

    def look(self) -> bool:
        """Read how far the job is, or how it ended, into `state` -> whether the job still runs."""
        running = self.process.poll() is None
        try:
            found = State.read(self.folder)
        except ArtoError as e:
            # a running job soon writes its state anew
            found = self.state if running else State(self.state.share, str(e), end="failed")
        if running:
            self.state = found if not found.end else self.state
            if self.told and time.monotonic() - self.told > PATIENCE + 4:
                self.process.kill()
            return True
        if not found.end and self.told:
            found = State(found.share, self.stopped, end="cancelled", result=found.result)
        elif not found.end:
            text = f"its Blender ended too early ({ended_by(self.process.returncode)})"
            lines = self._last_lines()
            kept = self.stopped.removeprefix("cancelled: ")
            found = State(found.share, f"{text}: {kept}, press it again{lines}", end="failed")
        elif found.end == "cancelled":
            found = replace(found, text=self.stopped)
        self.state = found
        return False

    @property
    def stopped(self) -> str:
        """What to say where the job did not come to its end."""
        if VERBS[self.verb].grows:
            return "stopped: the picture and its samples are kept, and the button goes on with them"
        if VERBS[self.verb].captures:
            return "cancelled: parts that were finished are kept"
        return "cancelled: nothing was changed"

    def _last_lines(self) -> str:
        with contextlib.suppress(OSError):
            text = last_of(self.folder / LOG, _LONGEST).decode("utf-8", "replace")
            # the last lines are for the console; the panel shows the first line
            return "\n" + "\n".join(text.strip().splitlines()[-8:])
        return ""

    @property
    def input(self) -> IO[bytes]:
        """The job's standard input, which the job listens to."""
        assert self.process.stdin is not None  # the process was started with a pipe
        return self.process.stdin

    def cancel(self) -> None:
        """Tell the job to end: at its next step, or in the middle of a render."""
        self.told = self.told or time.monotonic()
        with contextlib.suppress(OSError, ValueError):
            self.input.write(CANCEL.encode())
            self.input.flush()

    def remove(self) -> None:
        """Remove the folder of a job that has ended."""
        if log := getattr(self, "log", None):
            log.close()
        self.lock.__exit__(None, None, None)
        marked.remove_quietly(self.folder, "job", self.folder.parent)
        if self.told:
            # a job that could not end by itself in time was killed in the middle of a file
            for there in [path for path in self.folder.parent.iterdir() if path.is_dir()]:
                marked.sweep(there)

    @property
    def spent(self) -> float:
        """Seconds since the job began."""
        return time.monotonic() - self.begun

    @property
    def line(self) -> str:
        """The progress, in words."""
        if self.told:
            return "stopping"
        left = self.state.left
        spent = clock(self.spent)
        return f"{self.state.share:.0%}, " + (f"{clock(left)} left" if left is not None else spent)


def _command(blend: Path, task: Path) -> list[str]:
    line = [bpy.app.binary_path, "-b", scripts.option(), "--addons", ADDON, str(blend)]
    return [*line, "--command", "arto", "job", str(task)]


def _remove_leftovers(claimed: Path) -> None:
    """Remove the folders of jobs that no process holds any more, as after a crash."""
    for folder in claimed.glob("job-*"):
        if not Lock.holder(folder):
            marked.remove_quietly(folder, "job", claimed)


current: SecondBlender | None = None
# Guests that were told to end, and have not ended yet.
_leaving: list[SecondBlender] = []
# Seconds that a guest has to end by itself.
LEAVE = 3.0
outcome: Outcome | None = None
# By verb, what the window does with the result of a job.
finishers: dict[Verb, Callable[[SecondBlender], str]] = {}
# What the window does at each look at a job that runs.
followers: list[Callable[[SecondBlender], None]] = []


def asked_for() -> SecondBlender | None:
    """The running job, if the artist asked for it."""
    return current if current and not current.guest else None


def busy() -> str:
    """What runs, in words for a button that has to wait; empty where nothing does."""
    job = asked_for()
    return f"ARTO is {VERBS[job.verb].doing} {job.title}" if job else ""


def start(
    verb: Verb, scene: bpy.types.Scene, view_layer: str, guest: bool = False
) -> SecondBlender:
    """Start a job and return at once. Raises SceneError, and BusyError where a job runs already.

    guest: see `SecondBlender`. A guest that runs makes way.
    """
    global current, outcome
    dismiss()
    if current:
        raise BusyError(f"{busy()}: wait until it is done, or cancel it")
    if not guest:
        outcome = None
    current = SecondBlender(verb, scene, view_layer, guest)
    _follow_soon()
    watch.redraw()
    return current


def _follow_soon() -> None:
    if not bpy.app.timers.is_registered(_follow):
        bpy.app.timers.register(_follow, first_interval=EVERY, persistent=True)


def cancel() -> None:
    if current:
        current.cancel()


def dismiss() -> None:
    """Send a guest away, without a word: its place is free at once, and it ends by itself."""
    global current
    if current is None or not current.guest:
        return
    job, current = current, None
    job.cancel()
    _leaving.append(job)
    _follow_soon()


def forget_outcome() -> None:
    """Let go of what was said of the last job."""
    global outcome
    outcome = None


def _reap() -> None:
    """Remove what guests leave that have ended, and end those that take too long."""
    for job in list(_leaving):
        if job.process.poll() is not None:
            _leaving.remove(job)
            job.remove()
        elif job.told and time.monotonic() - job.told > LEAVE:
            job.process.kill()


def _follow() -> float | None:
    """Look at the job's progress; after its end, let the window use the result."""
    global current, outcome
    _reap()
    if current is None:
        return EVERY if _leaving else None
    job = current
    if job.look():
        _show_meanwhile(job)
        _show_share(job)
        for follow in followers:
            follow(job)
        watch.redraw()
        return EVERY
    if job.state.end == "done" and _in_the_middle():
        return EVERY  # during a drag or a stroke the window is left alone
    try:
        level = {"done": "INFO", "cancelled": "WARNING"}.get(job.state.end, "ERROR")
        text = job.state.text
        stopped = job.state.end == "cancelled" and VERBS[job.verb].grows and job.state.result
        if (job.state.end == "done" or stopped) and job.verb in finishers:
            text, level = finishers[job.verb](job), "INFO"
        _say(job, level, text)
    except Exception as e:
        _say(job, "ERROR", f"{type(e).__name__}: {e}")
        raise
    finally:
        current = None
        job.remove()
        _show_share(None)
        paths.forget()
        watch.redraw()
    return EVERY if _leaving else None


def _show_meanwhile(job: SecondBlender) -> None:
    """Show the picture of a work that makes it better and better, each time it was written."""
    if not VERBS[job.verb].grows or not job.state.result or _in_the_middle():
        return
    with contextlib.suppress(OSError):  # just now it may be replaced
        written, before = Path(job.state.result).stat().st_mtime_ns, job.seen
        job.seen = written
        if written != before:
            finishers[job.verb](job)


def _say(job: SecondBlender, level: str, text: str) -> None:
    """Note how a job ended; of a guest nothing is told but in the console."""
    global outcome
    print(f"ARTO {job.verb}: {text}", flush=True)
    if not job.guest:
        outcome = Outcome(level, text.splitlines()[0], job.verb, job.blend, job.scene_id)


# Operators that a person has in hand. Other modal operators do not count: add-ons have some that
# run all the time.
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


def _show_share(job: SecondBlender | None) -> None:
    text = None
    if job and not job.guest:
        text = f"{busy()}: {plain(job.state.text)}, {job.line}   (the cross in ARTO's tab ends it)"
    for window in bpy.context.window_manager.windows:
        # Blender needs a window here, and a timer has none after a file was opened
        with bpy.context.temp_override(window=window):
            window.workspace.status_text_set(text)


def end() -> None:
    """Let the job end because Blender quits or ARTO is switched off. Finished tiles stay.

    The job ends because its input closes, which also happens when this process is killed. It
    removes its folder by itself, so nothing waits for it here.
    """
    global current
    jobs = [*_leaving, *([current] if current else [])]
    current = None
    _leaving.clear()
    for job in jobs:
        with contextlib.suppress(OSError):
            job.input.close()
    for job in jobs:
        with contextlib.suppress(subprocess.TimeoutExpired):
            job.process.wait(2)
        job.lock.__exit__(None, None, None)


@persistent
def _quitting(*_: object) -> None:
    end()


def register() -> None:
    if not bpy.app.background:  # jobs are started only from a window
        when_quitting(_quitting)


def unregister() -> None:
    not_when_quitting(_quitting)
    end()
    if bpy.app.timers.is_registered(_follow):
        bpy.app.timers.unregister(_follow)
