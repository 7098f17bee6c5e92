"""The resident renderer's own side: it reads questions and prints answers.

It ends by itself when nothing was asked for long, when memory is short, and when its input closes,
which means that the window is gone or the file is closed.
"""

from __future__ import annotations

import json
import os
import queue
import signal
import threading
import time
import traceback
from collections.abc import Callable
from typing import Any

from ...core.errors import ArtoError, CancelledError
from ...core.memory import memory, taken
from ...core.units import size
from .. import interrupt
from ..work import STOPPED, Progress, Render
from .making import Maps
from .prepared import Prepared
from .resident import ANSWER, SHORT, STOP

# Seconds without a question after which it ends, and seconds between looks at the memory.
IDLE, LOOKS = 300.0, 5.0
# The share of the machine's memory that it may take, and the share that it leaves free.
MOST, FREE = 1 / 2, 1 / 16
# Seconds that a render has to end by itself after the window is gone.
PATIENCE = 2.0


class Heard:
    """What the window says: questions, one after the other, and that the work is to stop."""

    def __init__(self, descriptor: int = 0) -> None:
        self._questions: queue.Queue[str | None] = queue.Queue()
        self._lock = threading.Lock()
        self._busy = self._stop = self.gone = False
        self._descriptor = descriptor
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        # read the descriptor, not `sys.stdin`: a Python that quits waits for readers of its stream
        rest = b""
        while data := os.read(self._descriptor, 1 << 16):
            *lines, rest = (rest + data).split(b"\n")
            for line in lines:
                if line.decode() == STOP:
                    self._end_work()
                else:
                    self._questions.put(line.decode())
        self.gone = True
        self._questions.put(None)
        self._end_work()
        time.sleep(PATIENCE)
        os._exit(0)

    def _end_work(self) -> None:
        with self._lock:
            if not self._busy or self._stop:
                return
            self._stop = True
            if signal.getsignal(signal.SIGINT) not in (None, signal.default_int_handler):
                # `interrupt` notes it, and ends the render that runs
                signal.raise_signal(signal.SIGINT)

    def next(self, seconds: float) -> str | None:
        """Wait for the next question. Raises queue.Empty after so many seconds without one.

        None where the window is gone.
        """
        return self._questions.get(timeout=seconds)

    def begin(self) -> None:
        """Note that a question is worked at."""
        with self._lock:
            self._busy, self._stop = True, False

    def finish(self) -> None:
        """Note that the work at a question has ended."""
        with self._lock:
            self._busy = False

    def step(self, step: Progress | Render | None = None) -> None:
        """Be called with each step of the work. Raises CancelledError where it is to stop."""
        if self._stop:
            raise CancelledError(STOPPED)


def too_much(mine: int | None, total: int, free: int | None) -> str:
    """Say why memory is short, in words; empty where it is not.

    mine: bytes that this process takes, None where the system does not say; total, free: bytes of
    the machine or the container.
    """
    if mine is not None and mine > MOST * total:
        return f"it takes {size(mine)}, and may take {size(int(MOST * total))}"
    if free is not None and free < FREE * total:
        return f"{size(free)} are free, and {size(int(FREE * total))} are to stay free"
    return ""


def _say(said: dict[str, Any]) -> None:
    print(ANSWER + json.dumps(said), flush=True)


def serve(idle: float = IDLE, heard: Heard | None = None) -> int:
    """Answer questions until the input ends; returns the exit code.

    idle: seconds without a question after which it ends.
    """
    heard = heard or Heard()
    maps = Maps()
    prepared = Prepared(maps, heard.step)
    answers: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
        "map": maps.answer,
        "suns": prepared.answer,
    }
    until = time.monotonic() + idle
    while True:
        try:
            line = heard.next(min(LOOKS, max(until - time.monotonic(), 0.0)))
        except queue.Empty:
            line = ""
        if line is None:
            return 0
        if line:
            _say(_answer(heard, answers, line))
            until = time.monotonic() + idle
        if short := too_much(taken(), *memory()):
            _say({"ended": f"{SHORT}: {short}"})
            return 0
        if not line and time.monotonic() >= until:
            _say({"ended": "nothing was asked for long"})
            return 0


def _answer(
    heard: Heard, answers: dict[str, Callable[[dict[str, Any]], dict[str, Any]]], line: str
) -> dict[str, Any]:
    """Work at a question -> the answer, with the memory that this process takes."""
    with interrupt.noted():
        heard.begin()
        try:
            asked = json.loads(line)
            said = answers[asked.pop("kind")](asked)
        except CancelledError:
            said = {"stopped": True}
        except ArtoError as e:
            said = {"error": str(e)}
        except Exception as e:
            traceback.print_exc()
            said = {"error": f"{type(e).__name__}: {e}"}
        finally:
            heard.finish()
    return said | {"bytes": taken() or 0}
