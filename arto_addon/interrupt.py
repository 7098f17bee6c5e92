"""Ctrl-C in a Blender without a window.

Blender itself notes a first Ctrl-C for the render that runs, forgets it where none runs, and is
killed by a second one. So a Ctrl-C between two renders would be lost, and the next would leave
everything half done. Here each Ctrl-C is noted, and handed on to Blender for its render.
"""

from __future__ import annotations

import ctypes
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass
class Interrupts:
    """Whether Ctrl-C was pressed."""

    came: bool = False


@contextmanager
def noted() -> Iterator[Interrupts]:
    """Note every Ctrl-C for the time of a piece of work.

    Nothing is noted where Python itself answers Ctrl-C, as it does for Blender as a module, nor on
    Windows, nor outside the main thread.
    """
    told = Interrupts()
    ours = signal.getsignal(signal.SIGINT) is None and os.name == "posix"
    if not ours or threading.current_thread() is not threading.main_thread():
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

    def listen() -> None:
        while heard := os.read(ear, 1):
            if heard[0] == signal.SIGINT:
                told.came = True
                answer(signal.SIGINT)

    listener = threading.Thread(target=listen, daemon=True)
    listener.start()
    try:
        yield told
    finally:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        library.signal(signal.SIGINT, blenders)
        signal.set_wakeup_fd(before)
        os.close(mouth)
        listener.join()
        os.close(ear)
