"""Room: how much memory a capture may take, how much disk it needs, and how long it takes."""

from __future__ import annotations

import shutil
from dataclasses import asdict, dataclass
from pathlib import Path

from ...core.capture.head import CaptureHead
from ...core.errors import SceneError
from ...core.memory import memory
from ...core.region import Region
from ...core.units import clock, size
from ..stage.stage import Pace

# The share of the machine's memory that capture and fit may take by default. The rest is for
# Blender, the scene and other programs.
SHARE = 1 / 6
# They may also take at most this share of the free memory: the scene needs memory too, twice.
FREE_SHARE = 1 / 2
LEAST_MEGABYTES, SMALLEST_MEGABYTES = 512, 64
# Measured bytes for a pixel (`python -m bench speed`): for a layer on disk; for a light group in
# the buffers of Cycles and Blender; for a patch while fitting; for a fitted tile, its proxies and
# writing them. The last number is how many layers a render has besides light groups.
ON_DISK = 12
PER_PASS = 44
PER_PATCH = 10
FITTED = 4500
OTHER_PASSES = 9
# About the bytes of a field on disk, with layers and proxies: for a pixel, and for each of its
# patches.
FIELD, FIELD_PATCH = 74, 2.0
# Measured seconds of one thread for a pixel of a basis image: to save it and look at it, and to fit
# it (`python -m bench heavy`).
SAVING, FITTING = 5e-8, 9e-8
# How much more disk must be free than is needed, as a share of the need.
SPARE = 0.05


def budget(megabytes: int) -> int:
    """Memory that capture and fit may take, in bytes. megabytes: the artist's limit, 0 for none."""
    if megabytes:
        return megabytes << 20
    total, free = memory()
    share = int(total * SHARE) if free is None else int(min(total * SHARE, free * FREE_SHARE))
    least = LEAST_MEGABYTES << 20
    if free is not None:  # with less than that free, tiles are as small as they must be
        least = min(least, max(SMALLEST_MEGABYTES << 20, int(free * FREE_SHARE)))
    return max(least, share)


def bytes_a_pixel(passes: int, patches: int, fitted: bool) -> int:
    """Memory that a pixel of a tile takes, in bytes, while the tile is rendered.

    fitted: whether tiles are fitted as they come; the tile before is then fitted at the same time.
    """
    fit = patches * PER_PATCH + FITTED if fitted else 0
    return (passes + OTHER_PASSES) * PER_PASS + fit


@dataclass(frozen=True)
class Estimate:
    """What a capture will take.

    seconds: None before anything was rendered; memory: bytes; disk: bytes while the capture runs;
    kept: bytes after the capture.
    """

    seconds: float | None
    memory: int
    disk: int
    kept: int
    renders: int

    def to_json(self) -> dict[str, object]:
        return asdict(self)

    def times(self, takes: int) -> Estimate:
        """The estimate for so many takes of the shot, captured one after the other."""
        seconds = None if self.seconds is None else takes * self.seconds
        disk, kept = self.disk + (takes - 1) * self.kept, takes * self.kept
        return Estimate(seconds, self.memory, disk, kept, takes * self.renders)

    @property
    def line(self) -> str:
        """The estimate in words."""
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
    """Estimate a capture's memory and disk.

    plan: how many images each render of a tile has; fitted: whether tiles are fitted as they come
    and their images removed; seconds: how long the capture takes, where known.
    """
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


def seconds_of(head: CaptureHead, images: int, path: float, pace: Pace | None, cores: int) -> float:
    """Seconds that the tiles of a capture take that are not rendered yet.

    images: of a render; path: seconds for one; pace: of the looks; cores: threads that render.
    """
    left = [tile.region.pixels for tile in head.tiles if not tile.done]
    busy, again = (pace.busy, pace.again) if pace else (1.0, 0.0)
    each = SAVING + (0.0 if head.kept else FITTING / cores)
    tracing = (head.samples or 0) * path
    return sum(left) * (tracing + images * each * busy) + len(left) * again


def check_disk(folder: Path, needed: int, what: str) -> None:
    """Raise SceneError where a folder's disk has not the room."""
    free = free_disk(folder)
    if free < needed * (1 + SPARE):
        raise SceneError(
            f"{what} needs {size(needed)} of disk, and {folder} has {size(free)} free: make room, "
            "choose another folder in ARTO's settings, or let Keep Basis Images be Never"
        )


def free_disk(folder: Path) -> int:
    """How many bytes are free on the disk of a folder, which may not be there yet.

    Raises SceneError where the disk itself is missing: a drive that is not connected.
    """
    for there in (folder, *folder.parents):
        try:
            return shutil.disk_usage(there).free
        except (FileNotFoundError, NotADirectoryError):
            continue
        except OSError as e:
            raise SceneError(f"{there} cannot be asked for its room ({e}): choose another") from e
    raise SceneError(
        f"the disk of {folder} is not there: connect it, or choose another folder in the settings"
    )


def lacks_memory(needed: int) -> bool:
    """Whether the machine has not that much memory free."""
    _, free = memory()
    return free is not None and free < needed


def check_memory(needed: int, what: str) -> None:
    """Raise SceneError where the machine has not that much memory free."""
    _, free = memory()
    if free is not None and free < needed:
        raise SceneError(
            f"{what} needs {size(needed)} of memory, and {size(free)} are free: close other "
            "programs, or lower Memory in ARTO's settings (more tiles, each smaller)"
        )
