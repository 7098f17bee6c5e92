"""Writing files and folders whole or not at all, and holding a folder for one process.

What is being written has another name until it is complete. So a reader, a full disk or a process
that is killed never leads to half a file under the real name. The other name is that of one
process, and nothing that was there before is opened for writing.

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
import re
import stat
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType

from . import marked
from .errors import BusyError, FilesError
from .marked import OLD
from .regular import PART, SAFELY, moved, new_file, unique

__all__ = [
    "OLD",
    "PART",
    "Lock",
    "is_writable",
    "moved",
    "replace_folder",
    "settle",
    "whole",
    "write_text",
]


def is_writable(folder: Path) -> bool:
    """Say whether something can be written into a folder, which may still have to be made.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    bool
    """
    there = folder
    while not os.path.lexists(there) and there != there.parent:
        there = there.parent
    return there.is_dir() and os.access(there, os.W_OK | os.X_OK)


@contextlib.contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Give a path to write to, and rename it to `path` once the writing has succeeded.

    If the writing fails, the partial file is removed and an older file at `path` stays. A link at
    `path` is replaced, and what it leads to stays as it is.

    Parameters
    ----------
    path : Path
        The file to write. Missing folders above it are made.

    Yields
    ------
    Path
        The name to write to meanwhile: that of an empty file beside `path`, which no other
        process has.

    Raises
    ------
    OSError
        The folder cannot be made, or the file cannot be made or renamed.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    marked.remove_leftovers(path)
    partial = path.with_name(unique(path.name))
    new_file(partial)
    try:
        yield partial
        moved(partial, path)
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
    older folder is still there with `.old` added to its name. A folder of that name that ARTO has
    not made stays where it is.

    Parameters
    ----------
    folder : Path
        The folder that was to be replaced.

    Raises
    ------
    OSError
        A folder cannot be renamed.
    """
    old = folder.with_name(folder.name + OLD)
    if not marked.is_ours(old):
        return
    if os.path.lexists(folder):
        kind = marked.kind_of(old)
        if kind:
            marked.remove_quietly(old, kind, old.parent)
        else:  # a removal was killed at its very end
            with contextlib.suppress(OSError):
                marked.remove_empty(old)
    else:
        moved(old, folder)


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
    FilesError
        ARTO has not made the older folder. It stays.
    OSError
        A folder cannot be renamed. The older folder then still has its name.
    """
    settle(folder)
    old = folder.with_name(folder.name + OLD)
    if os.path.lexists(folder):
        marked.check(folder, None, folder.parent)
        if os.path.lexists(old):
            raise FilesError(f"{old} was not made by ARTO and is in the way: move it away")
        moved(folder, old)
    try:
        moved(complete, folder)
    except OSError:
        if os.path.lexists(old):
            moved(old, folder)
        raise
    # what is left of it is found and removed by the next one
    settle(folder)


class Lock:
    """Holds a folder for one process, as a context manager.

    The operating system lets go of the lock when the process ends, however it ends. The lock is a
    file and never a link, and nothing is written into a file that is no lock.

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
    FilesError
        The folder cannot be written, or another file has the lock's name.
    """

    NAME = "lock"

    def __init__(self, folder: Path, doing: str) -> None:
        self.path = folder / self.NAME
        self.doing = doing
        # what a process was doing here that ended without letting go: cancelled, or killed
        self.left = ""
        self._handle: int | None = None

    def __enter__(self) -> Lock:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            handle = _open_lock(self.path, os.O_RDWR | os.O_CREAT)
        except OSError as e:
            raise FilesError(
                f"{self.path.parent} cannot be locked ({e}): see who may write there, or choose "
                "another folder"
            ) from e
        try:
            said = _said(handle, self.path)
            try:
                _lock_soon(handle)
            except OSError:
                raise BusyError(
                    f"{self.path.parent} is in use: {said or 'another process'}; wait until it is "
                    "done, or end it there"
                ) from None
            self.left = said
            try:
                os.ftruncate(handle, 0)
                _write(handle, f"{self.doing}, process {os.getpid()}")
            except OSError as e:
                with contextlib.suppress(OSError):
                    os.ftruncate(handle, 0)
                raise FilesError(f"{self.path} cannot be written ({e}): make room") from e
        except BaseException:
            os.close(handle)
            raise
        self._handle = handle
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        if self._handle is not None:
            # emptied, not removed: another process may have it open already, to lock it
            with contextlib.suppress(OSError):
                os.ftruncate(self._handle, 0)
            os.close(self._handle)
            self._handle = None

    @staticmethod
    def holder(folder: Path) -> str:
        """Say which process holds a folder. Nothing is written.

        Parameters
        ----------
        folder : Path

        Returns
        -------
        str
            What the process does and its number; empty where no process holds the folder.
        """
        path = folder / Lock.NAME
        try:
            handle = _open_lock(path, os.O_RDWR if os.name == "nt" else os.O_RDONLY)
        except OSError:
            return ""
        said = ""
        try:
            said = _said(handle, path)
            _lock_soon(handle, shared=True)
            return ""
        except OSError:
            return said or "another process"
        except FilesError:
            return ""
        finally:
            os.close(handle)


# A lock says what is done and by which process, or nothing.
_FORM = re.compile(r"(?s:.{0,2000}), process \d{1,10}")
_MOST = 8192


def _open_lock(path: Path, how: int) -> int:
    """Open a lock, which is a regular file and no link. Raises OSError."""
    if os.name == "nt" and path.is_symlink():
        raise OSError(f"{path} is a link")
    handle = os.open(path, how | SAFELY, 0o666)
    state = os.fstat(handle)
    if not stat.S_ISREG(state.st_mode) or state.st_nlink > 1:
        os.close(handle)
        raise OSError(f"{path} is a link, or no regular file: move it away")
    return handle


def _said(handle: int, path: Path) -> str:
    """What a lock says. Raises FilesError for a file that is no lock."""
    os.lseek(handle, 0, os.SEEK_SET)
    text = os.read(handle, _MOST + 1).decode("utf-8", "replace").strip()
    if text and not _FORM.fullmatch(text):
        raise FilesError(f"{path} is no lock of ARTO's: move it away")
    return text


def _write(handle: int, text: str) -> None:
    data = text.encode("utf-8", "replace")
    os.lseek(handle, 0, os.SEEK_SET)
    if os.write(handle, data) != len(data):
        raise OSError("there is no room")


# Windows locks bytes and lets nobody else read them: one far behind the text is locked.
_BYTE = 1 << 20

if sys.platform == "win32":
    import msvcrt

    def _lock(handle: int, shared: bool) -> None:
        os.lseek(handle, _BYTE, os.SEEK_SET)
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
else:
    import fcntl

    def _lock(handle: int, shared: bool) -> None:
        # who only looks asks for a share of it, for which a file that may be read is enough
        fcntl.flock(handle, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)


def _lock_soon(handle: int, shared: bool = False) -> None:
    """Lock it; who only looks whether it is locked (`Lock.holder`) is gone in a moment."""
    for _ in range(4):
        with contextlib.suppress(OSError):
            return _lock(handle, shared)
        time.sleep(0.02)
    return _lock(handle, shared)
