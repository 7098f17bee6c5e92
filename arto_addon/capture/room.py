"""Room: the memory that a capture may take, the disk that it needs, and how long it will be."""

from __future__ import annotations

import os
import shutil
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ...core.errors import SceneError
from ...core.region import Region
from ...core.units import clock, size

# Of the machine's memory, what the chain may take where the artist does not say: Blender, the scene
# and the rest of the machine have the others.
SHARE = 1 / 6
# and at most this of what is free: the scene itself takes some of it, twice.
FREE_SHARE = 1 / 2
LEAST_MEGABYTES = 512
# Bytes of a pixel, as measured (`python -m bench speed`): of a layer on disk; of each light group
# in Cycles' and in Blender's buffers; of a patch while it is fitted; of what was fitted, its
# proxies and what writing it takes; of the layers that are no groups.
ON_DISK = 12
PER_PASS = 44
PER_PATCH = 10
FITTED = 4500
OTHER_PASSES = 9
# Of a field on disk, with its layers and proxies: of a pixel, and of each patch in it, about.
FIELD, FIELD_PATCH = 74, 2.0
# Of what is needed, how much more must be free.
SPARE = 0.05


def memory() -> tuple[int, int | None]:
    """Bytes of memory that the machine has, and that are free; None where it does not say."""
    if sys.platform == "win32":
        import ctypes

        class Status(ctypes.Structure):
            _fields_ = (
                ("length", ctypes.c_uint32), ("load", ctypes.c_uint32),
                *((n, ctypes.c_uint64) for n in ("total", "free", "p", "q", "r", "s", "t")),
            )  # fmt: skip

        status = Status()
        status.length = ctypes.sizeof(Status)
        ctypes.windll.kernel32.GlobalMemoryStatusEx(ctypes.byref(status))
        return int(status.total), int(status.free)
    total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    try:
        # what Linux could give without swapping; other systems have no such file
        said = Path("/proc/meminfo").read_text(encoding="ascii")
        return total, int(said.split("MemAvailable:")[1].split()[0]) << 10
    except (OSError, IndexError, ValueError):
        return total, None


def budget(megabytes: int) -> int:
    """Bytes that capture and fit may take; megabytes: what the artist says, 0 for a share."""
    if megabytes:
        return megabytes << 20
    total, free = memory()
    share = int(total * SHARE) if free is None else int(min(total * SHARE, free * FREE_SHARE))
    return max(LEAST_MEGABYTES << 20, share)


def bytes_a_pixel(passes: int, patches: int, fitted: bool) -> int:
    """Memory that a pixel of a tile takes while the tile is rendered and, where captures are fitted
    as they come, the last one is fitted."""
    fit = patches * PER_PATCH + FITTED if fitted else 0
    return (passes + OTHER_PASSES) * PER_PASS + fit


@dataclass(frozen=True)
class Estimate:
    """What a capture will take. seconds: None where nothing was rendered yet to tell by; memory,
    disk (while it runs), kept (after it): bytes."""

    seconds: float | None
    memory: int
    disk: int
    kept: int
    renders: int

    def to_json(self) -> dict[str, Any]:
        return asdict(self)

    def times(self, takes: int) -> Estimate:
        """Of a shot of which there are so many takes, one after the other."""
        seconds = None if self.seconds is None else takes * self.seconds
        disk, kept = self.disk + (takes - 1) * self.kept, takes * self.kept
        return Estimate(seconds, self.memory, disk, kept, takes * self.renders)

    @property
    def line(self) -> str:
        """In words."""
        time = f"about {clock(self.seconds)}, " if self.seconds is not None else ""
        return (
            f"{time}{size(self.disk)} of disk while it runs, keeps {size(self.kept)}, "
            f"{size(self.memory)} of memory"
        )


def estimate(
    plan: list[int],
    tiles: list[Region],
    patches: int,
    fitted: bool,
    seconds: float | None = None,
) -> Estimate:
    """plan: how many images each render of a tile has; fitted: whether tiles are fitted as they
    come, and their images go."""
    layers = sum(n + OTHER_PASSES for n in plan)
    largest = max(t.pixels for t in tiles)
    everything = sum(t.pixels for t in tiles)
    field = round(everything * (FIELD + patches * FIELD_PATCH))
    images = everything * layers * ON_DISK
    in_flight = min(2, len(tiles)) * largest * layers * ON_DISK
    return Estimate(
        seconds=seconds,
        memory=largest * bytes_a_pixel(max(plan), patches, fitted),
        disk=in_flight + field if fitted else images,
        kept=field if fitted else images,
        renders=len(plan) * len(tiles),
    )


def check_disk(folder: Path, needed: int, what: str) -> None:
    """Raise SceneError where a folder's disk has not the room."""
    there = folder
    while not there.exists():
        there = there.parent
    free = shutil.disk_usage(there).free
    if free < needed * (1 + SPARE):
        raise SceneError(
            f"{what} needs {size(needed)} of disk, and {folder} has {size(free)} free: make room, "
            "choose another folder in ARTO's settings, or let Keep Basis Images be Never"
        )


def check_memory(needed: int, what: str) -> None:
    """Raise SceneError where the machine has not that much memory free."""
    _, free = memory()
    if free is not None and free < needed:
        raise SceneError(
            f"{what} needs {size(needed)} of memory, and {size(free)} are free: close other "
            "programs, or lower Memory in ARTO's settings (more tiles, each smaller)"
        )
