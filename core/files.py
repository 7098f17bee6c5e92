"""Writing files and folders whole or not at all, and holding a folder for one process.

What is being written has another name until it is complete. So a reader, a full disk or a process
that is killed never leads to half a file under the real name.

Examples
--------
>>> import tempfile
>>> with tempfile.TemporaryDirectory() as folder:
...     path = Path(folder) / "shot.json"
...     write_text(path, "{}")
...     [file.name for file in Path(folder).iterdir()]
['shot.json']
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
    """Give a path to write to, and rename it to `path` once the writing has succeeded.

    If the writing fails, the partial file is removed and an older file at `path` stays.

    Parameters
    ----------
    path : Path
        The file to write. Missing folders above it are made.

    Yields
    ------
    Path
        The name to write to meanwhile: `path` with `.part` added.

    Raises
    ------
    OSError
        The folder cannot be made, or the file cannot be renamed.
    """
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
    """Write a text file in UTF-8, whole or not at all.

    Parameters
    ----------
    path : Path
    text : str

    Raises
    ------
    OSError
        The file cannot be written.
    """
    with whole(path) as partial:
        partial.write_text(text, encoding="utf-8")


def settle(folder: Path) -> None:
    """Bring back the folder that a killed process was about to replace.

    `replace_folder` renames twice. Between the two renames no folder has the name `folder`, and the
    older folder is still there with `.old` added to its name.

    Parameters
    ----------
    folder : Path
        The folder that was to be replaced.

    Raises
    ------
    OSError
        A folder cannot be renamed or removed.
    """
    old = folder.with_name(folder.name + OLD)
    if not old.exists():
        return
    if folder.exists():
        shutil.rmtree(old)
    else:
        old.rename(folder)


def replace_folder(complete: Path, folder: Path) -> None:
    """Put a complete folder in the place of another one, and remove that one.

    Parameters
    ----------
    complete : Path
        The new folder, under another name beside `folder`.
    folder : Path
        The name that it takes.

    Raises
    ------
    OSError
        A folder cannot be renamed. The older folder then still has its name.
    """
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
    # if a file of the older folder is still open, the next call removes what is left
    shutil.rmtree(old, ignore_errors=True)


class Lock:
    """Holds a folder for one process, as a context manager.

    The operating system lets go of the lock when the process ends, however it ends.

    Parameters
    ----------
    folder : Path
        The folder to hold; it is made if it is missing.
    doing : str
        What the process does there, for the messages of others: "capturing".

    Raises
    ------
    BusyError
        Another process holds the folder. The message names it.
    OSError
        The folder cannot be written.
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
            # the file is emptied and kept: another process may have opened it to lock it
            with contextlib.suppress(OSError):
                self._file.truncate(0)
            self._file.close()
            self._file = None

    @staticmethod
    def holder(folder: Path) -> str:
        """Say which process holds a folder.

        Parameters
        ----------
        folder : Path

        Returns
        -------
        str
            What the process does and its number; empty where no process holds the folder.
        """
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


# Windows locks bytes, and locked bytes cannot be read: so a byte far behind the text is locked.
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
    """Lock a file, and try again for a moment where that fails.

    `Lock.holder` locks the file only to see whether it can, and lets go at once.
    """
    for _ in range(4):
        with contextlib.suppress(OSError):
            return _lock(file)
        time.sleep(0.02)
    return _lock(file)
