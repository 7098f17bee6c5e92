"""How much memory there is: of the machine, or of the container that the process runs in.

Examples
--------
>>> total, free = memory()
>>> total > 0 and (free is None or 0 <= free <= total)
True
"""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path

# The kernel's files that say what a group of processes may take: the limit, what it takes, and what
# of that are files which the kernel drops when it needs room. Version 2, then version 1.
_SECOND = ("memory.max", "memory.current", "inactive_file")
_FIRST = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
# Version 1 has no word for "no limit", but a number of this size.
_NONE = 1 << 60


def memory(root: Path = Path("/")) -> tuple[int, int | None]:
    """Say how much memory this process may take.

    Parameters
    ----------
    root : Path
        Where the files of the kernel are.

    Returns
    -------
    total : int
        Bytes of the machine, or fewer where a container or a limit of the process allows no more.
    free : int or None
        Bytes of that which are free. None where the system does not say.
    """
    if sys.platform == "win32":
        return _windows()
    total, free = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"), None
    with contextlib.suppress(OSError, IndexError, ValueError):
        # memory that Linux can give without swapping; other systems have no such file
        said = (root / "proc/meminfo").read_text(encoding="ascii")
        free = int(said.split("MemAvailable:")[1].split()[0]) << 10
    for limit, taken in _limits(root):
        total = min(total, limit)
        left = max(limit - taken, 0)
        free = left if free is None else min(free, left)
    return total, free


def taken() -> int | None:
    """Say how much memory this process takes.

    Returns
    -------
    int or None
        Bytes that are in the machine's memory; the most that the process ever took, on macOS. None
        where the system does not say.
    """
    if sys.platform == "win32":
        return _taken_windows()
    with contextlib.suppress(OSError, IndexError, ValueError):
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE")
    with contextlib.suppress(ImportError):
        import resource

        return int(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    return None


def ended_by(code: int) -> str:
    """Say how a process ended, in words.

    Parameters
    ----------
    code : int
        As `subprocess` has it: below 0 for a signal; a shell has 128 and the signal.

    Returns
    -------
    str

    Examples
    --------
    >>> ended_by(1)
    'exit code 1'
    >>> ended_by(-9)[:29]
    'the system killed it: memory '
    """
    if code in (-9, 137):
        return (
            "the system killed it: memory is the likely cause, so close other programs, or lower "
            "Memory in ARTO's settings"
        )
    return f"exit code {code}"


def _limits(root: Path) -> list[tuple[int, int]]:
    """Each limit that this process is under, and what of it is taken, in bytes."""
    found = []
    with contextlib.suppress(OSError, ValueError):
        for line in (root / "proc/self/cgroup").read_text(encoding="utf-8").splitlines():
            _, controllers, path = line.split(":", 2)
            if not controllers:
                found += _of_groups(root / "sys/fs/cgroup", path, _SECOND)
            elif "memory" in controllers.split(","):
                found += _of_groups(root / "sys/fs/cgroup/memory", path, _FIRST)
    with contextlib.suppress(ImportError, OSError, ValueError, IndexError):
        import resource

        most = resource.getrlimit(resource.RLIMIT_AS)[0]
        if 0 < most < _NONE:
            pages = int((root / "proc/self/statm").read_text(encoding="ascii").split()[0])
            found.append((most, pages * os.sysconf("SC_PAGE_SIZE")))
    return found


def _of_groups(base: Path, path: str, names: tuple[str, str, str]) -> list[tuple[int, int]]:
    """The limits of a group of processes and of those that it is in, from the inside out.

    A container sees its own group at the base, whatever the path says.
    """
    parts = [part for part in path.split("/") if part not in ("", "..")]
    found = []
    for depth in range(len(parts), -1, -1):
        folder = base.joinpath(*parts[:depth])
        with contextlib.suppress(OSError, ValueError):
            limit = int((folder / names[0]).read_text(encoding="ascii"))
            if not 0 < limit < _NONE:
                continue
            taken = int((folder / names[1]).read_text(encoding="ascii"))
            for line in (folder / "memory.stat").read_text(encoding="ascii").splitlines():
                if line.startswith(names[2] + " "):
                    taken -= int(line.split()[1])
            found.append((limit, max(taken, 0)))
    return found


def _windows() -> tuple[int, int | None]:
    import ctypes

    class Status(ctypes.Structure):
        _fields_ = (
            ("length", ctypes.c_uint32), ("load", ctypes.c_uint32),
            *((n, ctypes.c_uint64) for n in ("total", "free", "p", "q", "r", "s", "t")),
        )  # fmt: skip

    status = Status()
    status.length = ctypes.sizeof(Status)
    ctypes.windll.kernel32.GlobalMemoryStatusEx(ctypes.byref(status))  # type: ignore
    return int(status.total), int(status.free)


def _taken_windows() -> int | None:
    import ctypes

    class Counters(ctypes.Structure):
        _fields_ = (
            ("size", ctypes.c_uint32), ("faults", ctypes.c_uint32),
            *((n, ctypes.c_size_t) for n in ("peak", "taken", "a", "b", "c", "d", "e", "f")),
        )  # fmt: skip

    counters = Counters()
    counters.size = ctypes.sizeof(Counters)
    library = ctypes.windll.kernel32  # type: ignore
    library.GetCurrentProcess.restype = ctypes.c_void_p
    this = ctypes.c_void_p(library.GetCurrentProcess())
    found = library.K32GetProcessMemoryInfo(this, ctypes.byref(counters), counters.size)
    return int(counters.taken) if found else None
