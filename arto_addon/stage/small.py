"""A small and quick render of the stage: for looking at the scene before the long ones."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
from numpy.typing import NDArray

from ...core import exr
from ..blender.output import write_to
from ..work import Render, Steps
from .stage import Pace, Stage, picture_region, picture_size

# Pixels of a small render: its cost is the same for a picture of any size.
PIXELS = 1728
_RENDER = ("resolution_x", "resolution_y", "resolution_percentage", "use_crop_to_border")


@contextmanager
def small(on: Stage, samples: int) -> Iterator[None]:
    """The stage so small that what is captured, a render region of the artist's, has `PIXELS`."""
    render, cycles = on.scene.render, on.scene.cycles
    width, height = picture_size(on.scene)
    share = math.sqrt(PIXELS / picture_region(on.scene).pixels)
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


def parts_of(on: Stage, text: str, share: float = 0.0) -> Steps:
    """Render the stage as it stands -> its parts by name, `exr.read`. Raises CancelledError.

    share: how far the whole work is.
    """
    with tempfile.TemporaryDirectory() as folder, _timed(on):
        path = Path(folder) / "small.exr"
        write_to(on.scene.render, path)
        request = Render(on.scene.name, share, text)
        yield request
        request.check()
        found: dict[str, NDArray] = exr.read(path)
        return found


@contextmanager
def _timed(on: Stage) -> Iterator[None]:
    """Note on the stage what a render took: the scene's preparation, and its light paths."""
    begun = time.perf_counter()
    first: list[float] = []

    def told(*arguments: object) -> None:
        if not first and arguments and "Sample" in str(arguments[0]):
            first.append(time.perf_counter())

    bpy.app.handlers.render_stats.append(told)
    try:
        yield
    finally:
        bpy.app.handlers.render_stats.remove(told)
    ended = time.perf_counter()
    ready = first[0] if first else begun
    paths = picture_region(on.scene).pixels * on.scene.cycles.samples
    on.pace = Pace(ready - begun, (ended - ready) / paths)
