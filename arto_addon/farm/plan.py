"""Planning a farm's job: the patches, looked for here and once, and what is to be rendered."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

import bpy

from ...core.capture_set import write_header
from ...core.choice import check as check_choice
from ...core.errors import FarmError
from ...core.patterns import pattern_set
from ..capture.asked import asked, begun
from ..capture.check import check_scene
from ..capture.planned import Given
from ..capture.sequence import frame_kept, together
from ..shot import home
from ..work import Progress, Steps
from . import job, templates


def plan(
    scene: bpy.types.Scene,
    view_layer: str,
    folder: Path,
    frames: Sequence[int],
    tiles: int | None,
    seeds: int,
) -> Steps:
    """Write a job of so many tiles (default: as the memory says) and seeds for each frame into a
    folder, and what farms take it by; returns its folder.

    Raises FarmError for a folder that has a job with parts already, or a file that was never saved;
    and what `capture` raises.
    """
    if not home.file():
        raise FarmError("this .blend was never saved, so no other machine can open it: save it")
    if (folder / "parts").is_dir() and any((folder / "parts").iterdir()):
        raise FarmError(
            f"{folder} has a job with parts that were rendered: gather it, remove it, or plan into "
            "another folder"
        )
    check_choice(scene.arto.support, pattern_set(scene.arto.patterns), scene.arto.separate)
    for old in folder.glob("frame_*"):
        shutil.rmtree(old)
    with frame_kept(scene):
        given: Given | None = None
        if len(frames) > 1:
            given = yield from together(scene, view_layer, frames)
        for i, frame in enumerate(frames):
            yield Progress(i / len(frames), f"planning frame {frame}")
            scene.frame_set(frame)
            check_scene(scene, view_layer)
            with asked(scene, view_layer, given) as this:
                if this.catchers:
                    raise FarmError(
                        "this shot has shadow catchers, which are captured on one machine: use "
                        "Capture, or turn Shadow Catcher off"
                    )
                there = folder / f"frame_{frame:04d}"
                planned, head = yield from begun(this, folder, given, tiles)
            # every frame is cut as the first one is
            tiles = len(head["tiles"])
            write_header(there, head)
            if given is None:
                given = Given(planned.hemicube, planned.route, planned.caution)
    made = job.write(folder, scene, view_layer, list(frames), tiles or 1, seeds)
    templates.write(made)
    count = len(made.parts)
    yield Progress(
        1.0, f"planned {count} parts: {len(frames)} frames, {tiles} tiles, {seeds} seeds"
    )
    return folder
