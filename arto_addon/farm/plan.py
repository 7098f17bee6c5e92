"""Planning a farm's job: the patches, looked for here and once, and what is to be rendered."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import bpy

from ...core import marked
from ...core.capture import head as capture_heads
from ...core.capture.head import CaptureHead
from ...core.errors import CaptureSetError, FarmError
from ...core.fit.choice import check as check_choice
from ...core.patterns import pattern_set
from ...core.units import size
from ..capture import room
from ..capture.asked import asked, begun
from ..capture.beside import given_by
from ..capture.check import check_scene
from ..capture.planned import Given
from ..capture.sequence import frame_kept, together
from ..shot import home
from ..stage.takes import TAKES, WHOLE
from ..work import Progress, Steps
from . import job, templates
from .head import HEADER, is_job


def plan(
    scene: bpy.types.Scene,
    view_layer: str,
    folder: Path,
    frames: Sequence[int] | None,
    tiles: int | None,
    seeds: int,
) -> Steps:
    """Write a job of so many tiles (default: as the memory says) and seeds for each frame into a
    folder, and what farms take it by; returns its folder.

    frames: default the one that the scene is at, between two of them as well. Raises FarmError for
    a folder that has a job with parts already, or not the room for them, or a file that was never
    saved; and what `capture` raises.
    """
    if frames is not None and not frames:
        raise FarmError("there are no frames to plan: give a first and a last one")
    if not home.file():
        raise FarmError("this .blend was never saved, so no other machine can open it: save it")
    if (folder / "parts").is_dir() and any((folder / "parts").iterdir()):
        raise FarmError(
            f"{folder} has a job with parts that were rendered: gather it, remove it, or plan into "
            "another folder"
        )
    check_choice(scene.arto.support, pattern_set(scene.arto.patterns), scene.arto.separate)
    _make_way(folder, [scene.frame_current] if frames is None else list(frames))
    # as `capture` takes the scene as it stands, and `capture_frames` whole frames together
    several = frames is not None
    subframe = 0.0 if several else scene.frame_subframe
    frames = [scene.frame_current] if frames is None else list(frames)
    catchers: list[int] = []
    needed, caution = 0, None
    with frame_kept(scene):
        given: Given | None = None
        if several:
            given = yield from together(scene, view_layer, frames)
        for i, frame in enumerate(frames):
            yield Progress(i / len(frames), f"planning frame {frame}")
            scene.frame_set(frame, subframe=subframe)
            check_scene(scene, view_layer)
            # whatever a script has moved is where it should be
            scene.view_layers[view_layer].update()
            heads = yield from _heads(scene, view_layer, folder, given, tiles, seeds)
            # every frame is cut as the first one is
            tiles = len(heads[WHOLE].tiles)
            caution = caution or heads[WHOLE].caution
            if len(heads) > 1:
                catchers.append(frame)
            for take, head in heads.items():
                capture_heads.write(job.set_folder(folder, frame, take), head)
                needed += _disk(head, seeds)
    _check_disk(folder, needed)
    made = job.write(folder, scene, view_layer, frames, subframe, catchers, tiles or 1, seeds)
    templates.write(made)
    takes = f", {1 + len(TAKES)} takes of {len(catchers)} with shadow catchers" if catchers else ""
    told = f". CAUTION: {caution.text}" if caution else ""
    yield Progress(
        1.0,
        f"planned {len(made.parts)} parts: {len(frames)} frames{takes}, {tiles} tiles, {seeds} "
        f"seeds; {size(needed)} of disk until they are gathered{told}",
    )
    return folder


def _make_way(folder: Path, frames: list[int]) -> None:
    """Remove the job that was planned into a folder before, of which nothing is rendered. Raises
    FarmError where something else is in the way; then nothing has been touched."""
    header = folder / HEADER
    if os.path.lexists(header):
        try:
            job.Job(folder)
        except FarmError as e:
            if not is_job(header):
                raise FarmError(f"{header} is no job of ARTO's: plan into another folder") from e
    templates.check(folder)
    sets = [there for there in _frames_in(folder) if _is_planned(there)]
    taken = {job.set_folder(folder, frame, take) for frame in frames for take in (WHOLE, *TAKES)}
    for there in sorted(taken - set(sets)):
        if os.path.lexists(there):
            raise FarmError(
                f"{there} was not planned by ARTO, or has rendered tiles: plan into another folder"
            )
    # the description first, so that who is killed while planning leaves no job
    if os.path.lexists(header):
        marked.remove_own_file(header, is_job)
    for there in sets:
        marked.remove(there, "capture", folder)


def _frames_in(folder: Path) -> list[Path]:
    form = re.compile(rf"frame_-?\d{{3,}}(_({'|'.join(TAKES)}))?")
    return [p for p in folder.iterdir() if form.fullmatch(p.name)] if folder.is_dir() else []


def _is_planned(folder: Path) -> bool:
    """Whether a folder is a capture set of which nothing is rendered."""
    if marked.kind_of(folder) != "capture":
        return False
    try:
        return not capture_heads.read(folder).done
    except CaptureSetError:
        return False


def _heads(
    scene: bpy.types.Scene,
    view_layer: str,
    folder: Path,
    given: Given | None,
    tiles: int | None,
    seeds: int,
) -> Steps:
    """Plan the takes of a frame -> the head of each one's capture set, by the take's name, that of
    everything first."""
    with asked(scene, view_layer, given) as this:
        count = 1 + len(TAKES) * this.catchers
        _, first = yield from begun(this, folder, given, tiles, count)
    first = replace(first, key=_key_of(first, seeds))
    heads = {WHOLE: first}
    for name in TAKES if this.catchers else ():
        beside = given_by(first)
        with asked(scene, view_layer, beside, name) as this:
            _, head = yield from begun(this, folder, beside, len(first.tiles))
        heads[name] = replace(head, key=_key_of(head, seeds), pair=first.key)
    return heads


def _key_of(head: CaptureHead, seeds: int) -> str | None:
    """The key of what all seeds make together: it is no capture of the samples of one."""
    if seeds == 1:
        return head.key
    return hashlib.sha256(f"{head.key} {seeds}".encode()).hexdigest()[:16]


def _disk(head: CaptureHead, seeds: int) -> int:
    """Bytes that the parts of a take have in a job's folder until they are gathered: light by light
    where there are seeds to be averaged, or images are kept."""
    light, field = (job.estimate(head, fitted).kept for fitted in (False, True))
    if head.kept:
        return seeds * light
    return field if seeds == 1 else seeds * light + field


def _check_disk(folder: Path, needed: int) -> None:
    """Raise FarmError where a job's folder has not the room for its parts."""
    free = shutil.disk_usage(folder).free
    if free < needed * (1 + room.SPARE):
        raise FarmError(
            f"the parts of this job need {size(needed)} of disk, and {folder} has "
            f"{size(free)} free: make room, or plan into another folder, or fewer frames or "
            "seeds"
        )
