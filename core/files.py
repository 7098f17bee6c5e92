"""Files and folders that are there whole or not at all, and held by one process at a time.

Every write of the project goes through here: what is being written has another name until it is
complete, so that a reader, a full disk or a process that is killed never meets a half of it.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import IO

from .errors import BusyError

PART = ".part"
OLD = ".old"


@contextlib.contextmanager
def whole(path: Path) -> Iterator[Path]:
    """The path to write to instead of `path`: it takes that name at the end, or is removed where
    the writing fails. Raises OSError; makes the folders above."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + PART)
    try:
        yield partial
        partial.replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)
        raise


def write_text(path: Path, text: str) -> None:
    """Write a text file, whole or not at all. Raises OSError."""
    with whole(path) as partial:
        partial.write_text(text, encoding="utf-8")


def settle(folder: Path) -> None:
    """Bring back what stood at `folder` where a process was killed while it was being replaced.

    Between the two renames of `replace_folder` there is nothing of that name: the folder is then
    still there as `.old`. Raises OSError.
    """
    old = folder.with_name(folder.name + OLD)
    if not old.exists():
        return
    if folder.exists():
        shutil.rmtree(old)
    else:
        old.rename(folder)


def replace_folder(complete: Path, folder: Path) -> None:
    """Put a complete folder where another one is, which goes. Raises OSError; then the one that
    was there still is."""
    settle(folder)
    old = folder.with_name(folder.name + OLD)
    if folder.exists():
        folder.rename(old)
    try:
        complete.rename(folder)
    except OSError:
        if old.exists():
            old.rename(folder)
        raise
    # what is left of it is found and removed by the next one
    shutil.rmtree(old, ignore_errors=True)


class Lock:
    """Holds a folder for one process: `with Lock(folder, "capturing"):` and so on.

    The operating system lets go of it when the process ends, however it ends. Raises BusyError,
    naming who holds it, and OSError where the folder cannot be written.
    """

    NAME = "lock"

    def __init__(self, folder: Path, doing: str) -> None:
        self.path = folder / self.NAME
        self.doing = doing
        self._file: IO[str] | None = None

    def __enter__(self) -> Lock:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        file = self.path.open("a+", encoding="utf-8")
        try:
            _lock_soon(file)
        except OSError:
            file.seek(0)
            holder = file.read().strip() or "another process"
            file.close()
            raise BusyError(
                f"{self.path.parent} is in use: {holder}; wait until it is done, or end it there"
            ) from None
        file.truncate(0)
        file.write(f"{self.doing}, process {os.getpid()}")
        file.flush()
        self._file = file
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        if self._file:
            # emptied, not removed: another process may have it open already, to lock it
            with contextlib.suppress(OSError):
                self._file.truncate(0)
            self._file.close()
            self._file = None

    @staticmethod
    def holder(folder: Path) -> str:
        """Who holds the folder, in words; empty for nobody."""
        path = folder / Lock.NAME
        if not path.is_file():
            return ""
        try:
            with Lock(folder, "looking"):
                return ""
        except BusyError:
            with contextlib.suppress(OSError):
                return path.read_text(encoding="utf-8").strip() or "another process"
            return "another process"
        except OSError:
            return ""


# Windows locks bytes and lets nobody else read them: one far behind the text is locked.
_BYTE = 1 << 20

if sys.platform == "win32":
    import msvcrt

    def _lock(file: IO[str]) -> None:
        file.seek(_BYTE)
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
else:
    import fcntl

    def _lock(file: IO[str]) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _lock_soon(file: IO[str]) -> None:
    """Lock it; who only looks whether it is locked (`Lock.holder`) is gone in a moment."""
    for _ in range(4):
        with contextlib.suppress(OSError):
            return _lock(file)
        time.sleep(0.02)
    return _lock(file)
