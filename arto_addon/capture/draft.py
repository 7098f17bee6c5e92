"""The draft of a capture: a small picture of the whole, captured before the first tile.

The draft is a field of its own. So Live can show the shot in any light while the tiles are
rendered. There are two, and the second takes the place of the first: of the picture that the
capture looks at the scene with, which costs nothing, and a larger one by the patches of the
capture. Cycles prepares the scene for the tiles anyway, and the larger draft is the first render of
what it has prepared. The draft goes once the capture is complete.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from ...core import marked
from ...core.capture import head as heads
from ...core.capture.capture_set import CaptureSet
from ...core.capture.head import CaptureHead
from ...core.capture.seed import ROUNDING
from ...core.capture.tile_data import TileData
from ...core.capture.tile_entry import TileEntry
from ...core.errors import ArtoError, DeviceMemoryError
from ...core.field.tile_writer import TileWriter
from ...core.field.writer import FieldWriter
from ...core.fit.choice import SEARCH, STAGE_AND_MATTE, check
from ...core.fit.fit import about_of, fit, fit_tile
from ...core.patterns import pattern_set
from ..blender.output import write_to
from ..shot import paths, status
from ..stage.small import small, timed
from ..stage.stage import Stage, picture_region, picture_size
from ..work import Progress, Render, Steps, Warned, retold
from .around import Around, plan_of
from .asked import Asked
from .look import SAMPLES as LOOKS
from .look import Glance

_Made = TypeVar("_Made")

# Pixels of a draft: 240 x 135.
PIXELS = 32_400
# A capture of fewer paths is done about as soon as its draft would be.
WORTH = 1_500_000
# Samples of a draft at most, and the share of the capture's paths that a draft may take.
SAMPLES, SHARE = 8, 1 / 16
# What a draft is rendered in, in the folder of the capture.
FOLDER = "draft"


def of_look(steps: Steps[_Made], this: Asked, place: Path) -> Steps[_Made]:
    """Pass on the steps of a plan, and make a draft of the first look at the scene.

    place: the folder of the shot. The capture must be worth a draft.
    """
    worth = this.region.pixels * (this.head.samples or 1) >= WORTH

    def change(step: Progress | Render) -> Progress | Render:
        if isinstance(step, Glance) and worth:
            _of_glance(step, this, place)
            return Progress(step.share, f"a draft of {step.shape[1]} x {step.shape[0]} is there")
        return step

    return retold(steps, change)


def _of_glance(seen: Glance, this: Asked, place: Path) -> None:
    basis = seen.probe[:, None].astype(np.float32)
    own = np.where(np.abs(seen.own) < ROUNDING * basis.sum(axis=(0, 1)), 0, seen.own)
    data = TileData(seen.region, basis, own.astype(np.float32), seen.alpha, {})
    about = about_of(replace(this.named(this.head), samples=LOOKS), "whole", False)
    about = replace(about, draft=True, catchers=None, take=None)
    writer = FieldWriter(paths.draft_folder(place), seen.hemicube, seen.shape, about)
    try:
        white = pattern_set("white")
        for step in fit_tile(data, white, seen.hemicube, "whole", LOOKS):
            if isinstance(step, TileWriter):
                writer.add(step)
        writer.close()
    finally:
        writer.abandon()


def draft(on: Stage, folder: Path, head: CaptureHead, around: Around) -> Steps[float | None]:
    """Capture the draft of a capture and fit it, unless it is there or not worth its time.

    Returns how many seconds a path of the capture takes, None where none was traced.

    folder: of the capture, with a head; around: its planes, which stay for the tiles. A render for
    which the memory is short is warned of, and the capture goes on without a draft. Raises
    CancelledError, CaptureSetError, FieldError, ExrError.
    """
    place, renders = folder.parent, plan_of(head)
    marked.remove(folder / FOLDER, "capture", folder)  # of a process that was killed
    pixels, samples = size(head)
    there = status.draft_of(place, head.key)
    done = there is not None and there.hemicube == head.hemicube
    if done or len(renders) > 1 or not pixels or head.take:
        return None
    try:
        return (yield from _draft(on, folder, head, around, pixels, samples))
    except DeviceMemoryError as e:
        yield Warned(0.0, f"{e}. The capture goes on without a draft")
        return None
    finally:
        marked.remove(folder / FOLDER, "capture", folder)


def size(head: CaptureHead) -> tuple[int, int]:
    """Pixels and samples of a draft; no pixels where it is not worth its time."""
    whole = sum(tile.region.pixels for tile in head.tiles)
    asked = int(head.samples or 1)
    # no more than a tile, which fits the memory
    pixels = min(PIXELS, whole // 4, max(tile.region.pixels for tile in head.tiles))
    if whole * asked < WORTH or pixels < 64:
        return 0, 0
    samples = int(SHARE * whole * asked / pixels)
    return pixels, max(1, min(samples, SAMPLES, asked))


def _draft(
    on: Stage, folder: Path, head: CaptureHead, around: Around, pixels: int, samples: int
) -> Steps[float]:
    scene, there = on.scene, folder / FOLDER
    images = plan_of(head)[0]
    with small(on, samples, pixels):
        on.about_to_render(int(head.samples or 0))
        around.set_images(head, images)
        (width, height), region = picture_size(scene), picture_region(scene)
        name = "tile_0000.exr"
        tile = TileEntry(region, (name,), done=True)
        mine = replace(head, height=height, width=width, samples=samples, tiles=(tile,))
        heads.write(there, mine)
        write_to(scene.render, there / name)
        request = Render(scene.name, 0.0, f"a draft of {width} x {height}", 0.0)
        with timed() as laps:
            yield request
        request.check()
    captured = CaptureSet(there)
    target = paths.draft_folder(folder.parent)
    for _ in fit(captured, target, *_choice(captured), draft=True):
        yield Progress(0.0, "fitting the draft")
    yield Progress(0.0, f"a draft of {width} x {height} is there")
    return laps.tracing / (region.pixels * samples)


def _choice(captured: CaptureSet) -> tuple[str, bool]:
    """What a draft is fitted with: as the capture, where that is quick and its patterns allow."""
    choice, separate = captured.head.told_choice
    try:
        check(choice, captured.patterns, separate)
    except ArtoError:
        choice, separate = "whole", False  # the capture's own fit says what is wrong
    return ("whole", False) if choice in (SEARCH, STAGE_AND_MATTE) else (choice, separate)
