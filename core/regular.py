"""Opening files without following links, without waiting, and without taking others' names.

Examples
--------
>>> import tempfile
>>> with tempfile.TemporaryDirectory() as folder:
...     path = Path(folder) / unique("a.exr")
...     new_file(path)
...     read_regular(path, most=10)
b''
"""

from __future__ import annotations

import contextlib
import errno
import functools
import hashlib
import json
import os
import platform
import secrets
import stat
import time
from io import BufferedReader
from pathlib import Path
from typing import IO, Any

from .errors import FilesError

PART = ".part"

_NOFOLLOW = getattr(os, "O_NOFOLLOW", 0)
_QUIETLY = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
# How what may be written to is opened: no link, no waiting, and no other program has it.
SAFELY = _NOFOLLOW | _QUIETLY
# Errors that say nothing of what is in a file: who may read it, or the disk.
WITHHELD = (errno.EACCES, errno.EPERM, errno.EIO, errno.ENOMEM, errno.ESTALE, errno.ETIMEDOUT)
# Errors of a disk, or of a file's size, that has no more room.
FULL = (errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC))
# Seconds for which Windows may keep a file that somebody reads from being replaced.
_PATIENCE = 3.0
_WINDOWS = os.name == "nt"
_JUNCTION = 0xA0000003
# A name that was cut short leaves room for what makes it unique: most disks take 255 bytes.
_LONGEST = 180


def open_regular(path: Path, follow: bool = False) -> BufferedReader:
    """Open a regular file for reading, without waiting.

    Parameters
    ----------
    path : Path
    follow : bool
        Whether the path may be a link.

    Returns
    -------
    file
        Opened in binary mode.

    Raises
    ------
    OSError
        The file is missing, or it is a link, a pipe, a device or a folder.
    FilesError
        This process has too many files open, which says nothing of the file.
    """
    if not follow and not _NOFOLLOW and path.is_symlink():
        raise OSError(f"{path} is a link")
    try:
        handle = os.open(path, os.O_RDONLY | _QUIETLY | (0 if follow else _NOFOLLOW))
    except OSError as e:
        check_files_left(e)
        raise
    try:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            raise OSError(f"{path} is no regular file")
        return os.fdopen(handle, "rb")
    except BaseException:
        os.close(handle)
        raise


def check_files_left(error: OSError) -> None:
    """Tell a process that has too many files open from a file that cannot be read.

    Parameters
    ----------
    error : OSError

    Raises
    ------
    FilesError
        The error is that there are too many.
    """
    if error.errno in (errno.EMFILE, errno.ENFILE):
        raise FilesError(
            f"too many files are open ({error.strerror}): close what uses many, or raise the limit "
            "(ulimit -n), and start this again; nothing is damaged"
        ) from error


def created(path: Path) -> IO[bytes]:
    """Make a file where there is none, and open it for writing.

    Parameters
    ----------
    path : Path

    Returns
    -------
    file
        Opened in binary mode.

    Raises
    ------
    OSError
        The file cannot be made, or something has that name already, a link included.
    """
    return os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | SAFELY, 0o666), "wb")


def last_of(path: Path, most: int) -> bytes:
    """Read the end of a regular file.

    Parameters
    ----------
    path : Path
    most : int
        How many bytes are read at most.

    Returns
    -------
    bytes

    Raises
    ------
    OSError
        The file cannot be read, or is no regular file.
    """
    with open_regular(path) as file:
        file.seek(max(file.seek(0, os.SEEK_END) - most, 0))
        return file.read(most)


def read_regular(path: Path, most: int, follow: bool = False) -> bytes:
    """Read all of a regular file that is not too large.

    Parameters
    ----------
    path : Path
    most : int
        The largest size in bytes.
    follow : bool
        Whether the path may be a link.

    Returns
    -------
    bytes

    Raises
    ------
    OSError
        The file cannot be read, is too large, or is no regular file.
    """
    with open_regular(path, follow) as file:
        size = os.fstat(file.fileno()).st_size
        data = b"" if size > most else file.read(size + 1)
    if size > most or len(data) > size:
        raise OSError(f"{path} has more than {min(size, most)} bytes")
    return data


def new_file(path: Path) -> None:
    """Make an empty file where there is none.

    Parameters
    ----------
    path : Path

    Raises
    ------
    OSError
        The file cannot be made, or something has that name already, a link included.
    """
    created(path).close()


def moved(source: Path, target: Path, patience: float = _PATIENCE) -> None:
    """Give a file or folder another name; a file of that name is replaced.

    Windows refuses while somebody reads the file, which is over in a moment: there the
    function tries again.

    Parameters
    ----------
    source, target : Path
    patience : float
        For how many seconds Windows is asked.

    Raises
    ------
    OSError
        The file cannot be renamed.
    """
    until = time.monotonic() + (patience if _WINDOWS else 0)
    while True:
        try:
            source.replace(target)
            return
        except PermissionError:
            if time.monotonic() >= until:
                raise
        time.sleep(0.05)


def unique(name: str, ending: str = PART) -> str:
    """Make a name for what is being written, which no other process takes.

    The name holds the machine, the process and a random number.

    Parameters
    ----------
    name : str
        The name that the file gets when it is complete. A long one is cut short.
    ending : str

    Returns
    -------
    str
    """
    return f"{cut(name)}.{host()}-{os.getpid()}-{secrets.token_hex(8)}{ending}"


def cut(name: str) -> str:
    """Cut a name so short that what makes it unique fits behind it on every disk.

    Parameters
    ----------
    name : str

    Returns
    -------
    str
    """
    while len(name.encode("utf-8", "surrogatepass")) > _LONGEST:
        name = name[:-1]
    return name


@functools.cache
def host() -> str:
    """Name the machine as it was started, and the container: a process's number counts in these.

    Returns
    -------
    str
        Eight letters.
    """
    said = platform.node()
    with contextlib.suppress(OSError):
        said += Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii")
    with contextlib.suppress(OSError):
        said += str(Path("/proc/self/ns/pid").readlink())
    return hashlib.sha256(said.encode()).hexdigest()[:8]


def is_folder(path: Path) -> bool:
    """Say whether a path is a folder and no link.

    Parameters
    ----------
    path : Path

    Returns
    -------
    bool
    """
    with contextlib.suppress(OSError, ValueError):
        state = os.lstat(path)
        # a junction of Windows is a folder that leads elsewhere
        junction = getattr(state, "st_reparse_tag", 0) == _JUNCTION
        return stat.S_ISDIR(state.st_mode) and not junction
    return False


def json_object(path: Path, most: int) -> dict[str, Any]:
    """Read the JSON object in a regular file.

    Parameters
    ----------
    path : Path
    most : int
        The largest size in bytes.

    Returns
    -------
    dict
        Empty where the file is missing or holds none.
    """
    with contextlib.suppress(OSError, ValueError, RecursionError):
        said = json.loads(read_regular(path, most))
        if isinstance(said, dict):
            return said
    return {}
