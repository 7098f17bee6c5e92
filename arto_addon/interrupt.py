"""Ctrl-C in a Blender without a window.

Blender itself notes a first Ctrl-C for the render that runs, forgets it where none runs, and is
killed by a second one. So a Ctrl-C between two renders would be lost, and the next would leave
everything half done. Here each Ctrl-C is noted. It is handed on to Blender once a render has begun:
in its first moments Blender would forget it.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
from bpy.app.handlers import persistent

# What is said at a Ctrl-C that cannot end a render.
SOON = "ARTO: stopping once this render is done; Ctrl-C again ends at once"


@dataclass
class Interrupts:
    """Whether Ctrl-C was pressed."""

    came: bool = False


@contextmanager
def noted() -> Iterator[Interrupts]:
    """Note every Ctrl-C for the time of a piece of work.

    Where Python itself answers Ctrl-C, as it does for Blender as a module, a render goes on to its
    end, and the work ends after it. Nothing is noted where another program's own handler answers,
    by Blender's program on Windows, nor outside the main thread.
    """
    told = Interrupts()
    main = threading.current_thread() is threading.main_thread()
    if main and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        with _noted_by_python(told):
            yield told
        return
    ours = signal.getsignal(signal.SIGINT) is None and os.name == "posix"
    if not ours or not main:
        yield told
        return
    library = ctypes.CDLL(None)
    library.signal.restype = ctypes.c_void_p
    library.signal.argtypes = (ctypes.c_int, ctypes.c_void_p)
    blenders = library.signal(signal.SIGINT, None)
    answer = ctypes.CFUNCTYPE(None, ctypes.c_int)(blenders)
    # Python's own handler waits for a render to end. This descriptor is written to at once.
    ear, mouth = os.pipe()
    os.set_blocking(mouth, False)
    before = signal.set_wakeup_fd(mouth, warn_on_full_buffer=False)
    signal.signal(signal.SIGINT, lambda *_: None)

    turn, renders = threading.Lock(), [False]

    def listen() -> None:
        while heard := os.read(ear, 1):
            if heard[0] == signal.SIGINT:
                with turn:
                    told.came = True
                    if renders[0]:
                        answer(signal.SIGINT)

    @persistent  # the resident renderer opens a file meanwhile, which removes other handlers
    def begins(*_: object) -> None:
        with turn:
            renders[0] = True
            if told.came:
                answer(signal.SIGINT)

    @persistent
    def ends(*_: object) -> None:
        with turn:
            renders[0] = False

    handlers = bpy.app.handlers
    handlers.render_pre.append(begins)
    handlers.render_complete.append(ends)
    handlers.render_cancel.append(ends)
    listener = threading.Thread(target=listen, daemon=True)
    listener.start()
    try:
        yield told
    finally:
        handlers.render_pre.remove(begins)
        handlers.render_complete.remove(ends)
        handlers.render_cancel.remove(ends)
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        library.signal(signal.SIGINT, blenders)
        signal.set_wakeup_fd(before)
        os.close(mouth)
        listener.join()
        os.close(ear)


@contextmanager
def _noted_by_python(told: Interrupts) -> Iterator[None]:
    """Note Ctrl-C in place of Python, which would raise an error in whatever runs.

    That may be a handler that Blender calls in the midst of a render, where the error would be lost
    or end the process. A second Ctrl-C ends the process at once.
    """

    def note(*_: object) -> None:
        if told.came:
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            signal.raise_signal(signal.SIGINT)
        told.came = True
        print(SOON, file=sys.stderr, flush=True)

    before = signal.signal(signal.SIGINT, note)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
