"""The window's side of the resident renderer: a second Blender that answers questions.

There is one for the open file. It is started with the first question. One question is on its way at
a time, and questions do not queue: the window asks again for what it wants by then. The second
Blender ends by itself when nothing was asked for long, and when memory is short. It ends when the
file is closed or the window is gone, because its input closes. The next question starts another.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import bpy
from bpy.app.handlers import persistent

from ...core.errors import SceneError
from ...core.memory import ended_by
from ..blender import handlers, scratch, scripts
from ..blender.addon import ADDON
from ..blender.quitting import not_when_quitting, when_quitting

# How a line with an answer begins: Blender prints other lines too.
ANSWER = "ARTO resident "
# The line that ends the work at a question.
STOP = "stop"
# How the reason begins for which it has ended, where that is memory.
SHORT = "memory is short"
# Seconds that the second Blender has to end by itself.
_REAP = 2.0

# What can be asked for.
Kind = Literal["map", "suns"]


@dataclass(frozen=True)
class Said:
    """The answer to a question.

    found: what was found, by name; error: why nothing was found, empty for none; lost: whether
    nobody has looked at the question, so that it can be asked again.
    """

    found: Mapping[str, Any]
    error: str = ""
    lost: bool = False


class Resident:
    """The resident renderer of the open file."""

    def __init__(self) -> None:
        """Make a temporary folder. Raises SceneError where there is no room for it."""
        try:
            self.folder = scratch.make()
        except OSError as e:
            raise SceneError(f"there is no room for temporary files ({e})") from e
        self.process: subprocess.Popen[str] | None = None
        self._lock = threading.Lock()
        self._open: tuple[Kind, Callable[[Said], None]] | None = None
        self._told = False
        # why the last process ended by itself, and how much memory it took at its last answer
        self.ended, self.bytes = "", 0
        # why the scene is not to be prepared again: there was too little memory for it
        self.short = ""

    def start(self) -> None:
        """Start the second Blender. Raises SceneError where it cannot be started."""
        try:
            self.process = subprocess.Popen(
                command(),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                encoding="utf-8",
                errors="replace",
                **scripts.quietly(),
            )
        except OSError as e:
            raise SceneError(f"a second Blender cannot be started ({e})") from e
        threading.Thread(target=self._listen, args=(self.process,), daemon=True).start()

    def begin(self) -> None:
        """Start the second Blender where none runs, so that the first answer comes soon.

        Raises SceneError.
        """
        if self.process is None or self.process.poll() is not None:
            self.start()

    @property
    def busy(self) -> bool:
        """Whether a question is on its way."""
        return self._open is not None

    @property
    def at(self) -> Kind | None:
        """What is asked for at this time."""
        asked = self._open
        return asked[0] if asked else None

    def ask(
        self,
        kind: Kind,
        question: Mapping[str, Any],
        done: Callable[[Said], None],
        before: Callable[[], None] | None = None,
    ) -> bool:
        """Ask for something -> whether the question was sent: not while another is on its way.

        done: called with the answer, in another thread; before: writes the files that the question
        names, in another thread, and may raise OSError. Raises SceneError.
        """
        if self._open:
            return False
        self.begin()
        process = self.process
        assert process
        asked: tuple[Kind, Callable[[Said], None]] = kind, done
        self._open, self._told, self.ended = asked, False, ""
        line = json.dumps({"kind": kind, **question}) + "\n"
        if before is not None:  # writing many pixels takes long, and the window does not wait
            threading.Thread(target=self._send_after, args=(process, line, before)).start()
            return True
        return self._send(process, line)

    def _send_after(
        self, process: subprocess.Popen[str], line: str, before: Callable[[], None]
    ) -> None:
        try:
            before()
        except OSError as e:
            text = f"files for the second Blender cannot be written ({e}): make room on the disk"
            self._answered(Said({}, text))
            return
        self._send(process, line)

    def _send(self, process: subprocess.Popen[str], line: str) -> bool:
        assert process.stdin
        try:
            process.stdin.write(line)
            process.stdin.flush()
        except (OSError, ValueError):
            # that Blender has ended: the next question starts another
            self._answered(Said({}, lost=True))
            return False
        return True

    def stop(self) -> None:
        """Have the work at the question that is on its way ended, as nobody wants it any more."""
        process = self.process
        if self._told or not self._open or process is None or process.stdin is None:
            return
        self._told = True
        with contextlib.suppress(OSError, ValueError):
            process.stdin.write(STOP + "\n")
            process.stdin.flush()

    def _listen(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout
        ended = ""
        for line in process.stdout:
            if not line.startswith(ANSWER):
                continue
            try:
                said = json.loads(line[len(ANSWER) :])
                ended = said.get("ended", "")
                if not ended:
                    self.bytes = int(said.pop("bytes", 0))
                    self._answered(Said(said, said.pop("error", "")))
            except (ValueError, AttributeError, TypeError) as e:
                self._answered(Said({}, f"the answer of the second Blender cannot be read ({e})"))
        # If a question makes the process end, its answer is that. If another process has been
        # started since, the open question is for the new process.
        try:
            how = ended_by(process.wait(_REAP))
        except subprocess.TimeoutExpired:
            how = "it closed its output"
        with self._lock:
            if process is not self.process:
                return
            self.ended, self.bytes = ended or how, 0
            if ended.startswith(SHORT):
                self.short = ended
        self._answered(Said({}, "" if ended else f"the Blender beside ended ({how})", bool(ended)))

    def _answered(self, said: Said) -> None:
        """Close the open question."""
        with self._lock:
            asked, self._open = self._open, None
        if asked is not None:
            asked[1](said)

    def close(self, wait: bool = True) -> None:
        """End the second Blender and remove the temporary files.

        wait: until that is done; the window does not wait.
        """
        leaving = threading.Thread(target=self._leave)
        leaving.start()
        if wait:
            leaving.join()

    def _leave(self) -> None:
        if self.process:
            with contextlib.suppress(OSError):
                assert self.process.stdin
                self.process.stdin.close()
            try:
                self.process.wait(_REAP)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        scratch.remove(self.folder)


def command() -> list[str]:
    """The command that starts the second Blender; a Python where Blender runs as a module."""
    if bpy.app.binary_path and not bpy.app.module:
        start = [bpy.app.binary_path, "-b", scripts.option(), "--addons", ADDON]
        return [*start, "--command", "arto", "resident"]
    serve = f"{__name__.rpartition('.')[0]}.serve"
    run = f"import bpy, {ADDON}; {ADDON}.register(); from {serve} import serve; serve()"
    return [sys.executable, "-c", run]


_current: list[Resident] = []


def current() -> Resident:
    """The resident renderer of the open file. Raises SceneError where there is no room for it."""
    if not _current:
        _current.append(Resident())
    return _current[0]


def running() -> Resident | None:
    """The resident renderer, where its second Blender runs."""
    found = _current[0] if _current else None
    return found if found and found.process and found.process.poll() is None else None


def end(wait: bool = False) -> None:
    """End the resident renderer of the open file, and free its memory. wait: until it has ended."""
    while _current:
        _current.pop().close(wait)


@persistent
def _another_file(*_: object) -> None:
    end()


@persistent
def _quitting(*_: object) -> None:
    end(wait=True)


_HANDLERS = {"load_pre": _another_file}


def register() -> None:
    if not bpy.app.background:
        handlers.add(_HANDLERS)
        when_quitting(_quitting)


def unregister() -> None:
    not_when_quitting(_quitting)
    handlers.remove(_HANDLERS)
    end(wait=True)
