"""The job's side: `blender -b snapshot.blend --command arto job task.json`.

The job does the same work as a batch run, with the paths of the artist's file, and writes down its
progress. It ends when its standard input says so, or when its standard input closes, which means
that the window is gone.
"""

from __future__ import annotations

import contextlib
import os
import re
import signal
import threading
import time
import traceback
from collections.abc import Iterator
from pathlib import Path

import bpy

from ...core import marked
from ...core.errors import ArtoError, CancelledError, SceneError
from ..blender import devices, scripts
from ..blender.compositing import places_of_groups
from ..blender.front import to_front
from ..shot import home
from ..work import STOPPED, Progress, Render, Steps, Wrote, run
from .snapshot import put_pixels
from .task import State, Task
from .verbs import VERBS

CANCEL = "cancel\n"
# Seconds that a render has to end by itself after it was told to.
PATIENCE = 8.0
# How often a second the progress is written down.
_OFTEN = 5.0


def main(path: Path) -> int:
    """Do the work of a task; returns the exit code."""
    folder = path.parent
    if not marked.is_ours(folder, "job"):
        # the folder is someone else's: do not write into it, and do not remove it
        print(f"ARTO: {folder} is no folder of a job of ARTO's: start the work again", flush=True)
        return 1
    told = _Told(folder)
    writer = _Writer(folder, told)
    state = State()
    code = 0
    try:
        with writer.samples():
            made = run(_steps(Task.read(path), folder), writer)
        state = State(1.0, writer.text, end="done", result=str(made or ""))
    except CancelledError as e:
        state, code = State(writer.share, str(e), end="cancelled", result=writer.result), 130
    except ArtoError as e:
        state, code = State(writer.share, str(e), end="failed"), 1
    except Exception as e:
        traceback.print_exc()
        state, code = State(writer.share, f"{type(e).__name__}: {e}", end="failed"), 1
    told.done = True
    if told.alone:
        marked.remove_quietly(
            folder, "job", folder.parent
        )  # the window is gone, so nobody else removes the folder
    else:
        state.write(folder)
    print(f"ARTO job: {state.end}: {state.text}", flush=True)
    return code


def _steps(task: Task, folder: Path) -> Steps[Path | None]:
    return VERBS[task.verb].steps(opened(task, folder), task.view_layer)


def opened(task: Task, folder: Path) -> bpy.types.Scene:
    """Make the open snapshot what the artist's file is in memory -> the task's scene.

    folder: the snapshot's. Raises SceneError.
    """
    home.set_file(task.blend)
    scene = home.of_library(bpy.data.scenes, task.scene, task.library)
    if scene is None:
        raise SceneError(f"there is no scene '{task.scene}'")
    to_front(scene)
    if task.scripts and task.view_layer in scene.view_layers:
        scene.view_layers[task.view_layer].update()
        scripts.check_drivers()
    devices.use(task.devices)
    _turn_paths(folder)
    for painted in task.painted:
        image = home.of_library(bpy.data.images, painted.name, painted.library)
        if image is None:
            raise SceneError(f"the painted image '{painted.name}' is not in the copy of the file")
        put_pixels(image, folder / painted.pixels)
    return scene


def _turn_paths(folder: Path) -> None:
    """Make relative paths that Blender did not rewrite lead from the artist's file again."""
    if not home.file():
        return
    start = str(Path(home.file()).parent)
    trees = [
        t for m in (*bpy.data.materials, *bpy.data.worlds, *bpy.data.lights) if (t := m.node_tree)
    ]
    owners: list[bpy.types.bpy_struct] = [
        n for tree in (*trees, *places_of_groups()) for n in tree.nodes
    ]
    owners += [m for o in bpy.data.objects for m in o.modifiers]
    for owner in owners:
        for prop in owner.bl_rna.properties:
            if prop.type != "STRING" or prop.subtype not in {"FILE_PATH", "DIR_PATH"}:
                continue
            path = getattr(owner, prop.identifier)
            if not path.startswith("//") or prop.is_readonly:
                continue
            there = Path(bpy.path.abspath(path, start=start))
            if there.exists() and not Path(bpy.path.abspath(path, start=str(folder))).exists():
                setattr(owner, prop.identifier, str(there))


class Pace:
    """How fast work goes on, and so how many seconds are left of it.

    Other programs come and go, so the later half of the time counts, and not all of it.
    """

    def __init__(self) -> None:
        self._seen: list[tuple[float, float]] = []

    def begin(self, now: float, share: float) -> None:
        """Count from here, if nothing was counted yet. share: how much is done, 0 to 1."""
        self._seen = self._seen or [(now, share)]

    def left(self, now: float, share: float) -> float | None:
        """Seconds that are left; None where too little was seen. share: how much is done."""
        if not self._seen:
            return None
        if now - self._seen[-1][0] >= 0.2:
            self._seen.append((now, share))
            if len(self._seen) > 4000:  # of hours, half as many looks will do
                self._seen = self._seen[::2]
        first = self._seen[0]
        # the last look in the first half of the time, and of the work if that was shorter
        half = [at for at in self._seen if at[0] <= (first[0] + now) / 2]
        at, then = half[-1]
        if share <= then:
            at, then = first
        if share <= then or now - at <= 0.5:
            return None
        return (now - at) / (share - then) * (1 - share)


class _Told:
    """Listens to the window: a line ends the work, and so does the end of the pipe."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.to_end = False
        self.done = False
        self.alone = False
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        # read the descriptor, not `sys.stdin`: a Python that quits waits for readers of its stream
        self.alone = os.read(0, len(CANCEL)) == b""
        self.to_end = True
        # a first Ctrl-C ends a render; a second Ctrl-C would kill Blender at once
        signal.raise_signal(signal.SIGINT)
        until = time.monotonic() + PATIENCE
        while not self.done and time.monotonic() < until:
            time.sleep(0.1)
        if not self.done:
            if self.alone:
                marked.remove_quietly(self.folder, "job", self.folder.parent)
            os._exit(130)


class _Writer:
    """Writes the progress down, with the samples of a render."""

    def __init__(self, folder: Path, told: _Told) -> None:
        self.folder = folder
        self.told = told
        self.begun = time.monotonic()
        self.share = 0.0
        self.text = "starting"
        self._pace = Pace()
        self._written = 0.0
        self.result = ""
        self._render: Render | None = None

    def __call__(self, step: Progress | Render) -> None:
        if self.told.to_end:
            raise CancelledError(STOPPED)
        self._render = step if isinstance(step, Render) else None
        said = self.text
        self.share, self.text = min(step.share, 1.0), step.text
        if isinstance(step, Wrote):
            self.result = str(step.path)
        if self._render and (step.share > 0 or self._render.span):
            # what an earlier run had done took no time in this one: count from here
            self._pace.begin(time.monotonic(), step.share)
        self._write(soon=said != self.text)
        if said != self.text:
            print(f"ARTO job: {self.share:4.0%} {self.text}", flush=True)

    def _write(self, soon: bool = False) -> None:
        now = time.monotonic()
        if not soon and now - self._written < 1 / _OFTEN:
            return
        self._written = now
        left = self._pace.left(now, self.share)
        with contextlib.suppress(
            OSError
        ):  # progress matters little: the work itself reports a full disk
            State(self.share, self.text, now - self.begun, left, result=self.result).write(
                self.folder
            )

    @contextlib.contextmanager
    def samples(self) -> Iterator[None]:
        """Follow the samples of the renders."""

        def told(*arguments: object) -> None:
            found = _SAMPLE.search(str(arguments[0])) if arguments else None
            if found and self._render:
                part = int(found[1]) / max(int(found[2]), 1)
                self.share = min(self._render.share + self._render.span * min(part, 1.0), 1.0)
                self._write()

        bpy.app.handlers.render_stats.append(told)
        try:
            yield
        finally:
            bpy.app.handlers.render_stats.remove(told)


_SAMPLE = re.compile(r"Sample (\d+)/(\d+)")
