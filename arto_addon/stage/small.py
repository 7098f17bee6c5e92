"""A small and quick render of the stage, to look at the scene before the long renders."""

from __future__ import annotations

import math
import os
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ..blender.output import write_to
from ..blender.scratch import temporary
from ..work import Render, Steps
from .stage import Pace, Stage, picture_region, picture_size

# Pixels of a small render, whatever the picture's size, so that the cost is always the same.
PIXELS = 1728
_RENDER = ("resolution_x", "resolution_y", "resolution_percentage", "use_crop_to_border")


@contextmanager
def small(on: Stage, samples: int, pixels: int = PIXELS) -> Iterator[None]:
    """Make the stage so small that the captured region has about so many pixels, and put it back.

    The captured region is the artist's render region, or the whole picture.
    """
    render, cycles = on.scene.render, on.scene.cycles
    width, height = picture_size(on.scene)
    share = math.sqrt(pixels / picture_region(on.scene).pixels)
    were = [(render, name, getattr(render, name)) for name in _RENDER]
    were.append((cycles, "samples", cycles.samples))
    try:
        render.resolution_x = max(8, round(width * share))
        render.resolution_y = max(8, round(height * share))
        render.resolution_percentage = 100
        render.use_crop_to_border = render.use_border
        cycles.samples = samples
        yield
    finally:
        for owner, name, value in were:
            setattr(owner, name, value)


def parts_of(
    on: Stage, text: str, share: float = 0.0, span: float = 0.0, only: str = ""
) -> Steps[dict[str, NDArray]]:
    """Render the stage as it stands -> the render's parts by name, as `exr.read` gives them.

    share: how much of the whole work was done before, 0 to 1; span: how much of the whole work this
    render is; only: how the names of the wanted parts end. Raises CancelledError.
    """
    with temporary() as folder:
        path = folder / "small.exr"
        write_to(on.scene.render, path)
        request = Render(on.scene.name, share, text, span)
        on.about_to_render()
        with timed() as laps:
            yield request
        request.check()
        on.pace = laps.pace(on)
        on.scene_bytes = max(on.scene_bytes, laps.scene_bytes)
        with exr.Layers(path) as there:
            return {n: np.array(there.read(n)) for n in there.names if n.endswith(only)}


class Laps:
    """When a render began, and when its first and last paths were traced: seconds, and seconds of
    all threads. scene_bytes: what the scene takes."""

    def __init__(self) -> None:
        self.begun = self.traced = self.written = _now()
        self.scene_bytes = 0

    @property
    def tracing(self) -> float:
        """Seconds in which paths were traced."""
        return self.written[0] - self.traced[0]

    def pace(self, on: Stage) -> Pace:
        """How fast the stage renders, by this render and those before it."""
        paths = picture_region(on.scene).pixels * on.scene.cycles.samples
        tracing, worked = (b - a for a, b in zip(self.traced, self.written, strict=True))
        ready, before = self.traced[0] - self.begun[0], on.pace
        ready, again = (
            max(ready, before.ready if before else 0.0),
            min(ready, before.again if before else ready),
        )
        if on.scene.cycles.device != "CPU" or worked <= 0:
            return Pace(ready, again, tracing / paths, 1.0)
        # other programs come and go: all renders together tell best how busy they keep the machine
        on.traced = tuple(a + b for a, b in zip(on.traced, (tracing, worked), strict=True))
        seconds, work = on.traced
        busy = max(seconds * threads(on.scene) / work, 1.0)
        return Pace(ready, again, worked / threads(on.scene) / paths, busy)


def _now() -> tuple[float, float]:
    return time.perf_counter(), time.process_time()


def threads(scene: bpy.types.Scene) -> int:
    """How many threads Cycles renders a scene with on the processor."""
    if scene.render.threads_mode == "FIXED":
        return int(scene.render.threads)
    return os.cpu_count() or 1


_MEMORY = re.compile(r"Mem: ?([\d.]+)([KMG])")


def _bytes_in(says: str) -> int:
    """The memory that a line of Cycles' status tells last, in bytes; 0 where it tells none."""
    found = _MEMORY.findall(says)
    if not found:
        return 0
    number, unit = found[-1]
    return int(float(number) * {"K": 2**10, "M": 2**20, "G": 2**30}[unit])


@contextmanager
def timed() -> Iterator[Laps]:
    """Time a render's stages, which Cycles' status lines tell apart."""
    laps = Laps()
    traced: list[tuple[float, float]] = []

    def told(*arguments: object) -> None:
        says = str(arguments[0]) if arguments else ""
        if "Sample" in says or "Finished" in says:
            traced.append(_now())
            laps.scene_bytes = max(laps.scene_bytes, _bytes_in(says))

    bpy.app.handlers.render_stats.append(told)
    try:
        yield laps
    finally:
        bpy.app.handlers.render_stats.remove(told)
    ended = _now()
    laps.traced, laps.written = (traced[0], traced[-1]) if traced else (laps.begun, ended)
