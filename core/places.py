"""Places that files are put into: whether they stay there, and one process at a time.

Examples
--------
>>> import tempfile
>>> with tempfile.TemporaryDirectory() as folder:
...     field = marked.make(Path(folder) / "field", "field")
...     (around(field / "plates" / "a.exr") == field.resolve(), around(Path(folder)))
(True, None)
"""

from __future__ import annotations

import contextlib
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from . import marked
from .errors import BusyError

if sys.platform != "win32":
    import fcntl


def around(path: Path) -> Path | None:
    """Find the folder of ARTO's that a path is in, or is: what is in it goes with it.

    Parameters
    ----------
    path : Path
        It need not be there.

    Returns
    -------
    Path or None
    """
    whole = Path(os.path.realpath(path))
    return next((folder for folder in (whole, *whole.parents) if marked.kind_of(folder)), None)


@contextlib.contextmanager
def in_turn(folder: Path, patience: float = 60.0) -> Iterator[None]:
    """Hold a folder while several files in it take their places, for one process at a time.

    Where folders cannot be locked, as on Windows and on some disks of a network, nobody waits.

    Parameters
    ----------
    folder : Path
        Nothing is written into it.
    patience : float
        For how many seconds another process is waited for.

    Yields
    ------
    None

    Raises
    ------
    BusyError
        Another process holds the folder all the while.
    """
    handle: int | None = None
    try:
        handle = _held(folder, patience)
        yield
    finally:
        if handle is not None:
            os.close(handle)


if sys.platform == "win32":

    def _held(folder: Path, patience: float) -> int | None:
        return None
else:

    def _held(folder: Path, patience: float) -> int | None:
        try:
            handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        except OSError:
            return None
        until = time.monotonic() + patience
        while True:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                return handle
            except BlockingIOError:
                if time.monotonic() > until:
                    os.close(handle)
                    raise BusyError(
                        f"another process is putting files into {folder}: wait until it is done"
                    ) from None
            except OSError:  # a disk of a network that locks no folders
                os.close(handle)
                return None
            time.sleep(0.02)
