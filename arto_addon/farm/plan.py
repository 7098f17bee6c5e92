"""Plan a farm's job: find the patches, once for all parts, and write what is to be rendered."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import bpy

from ...core import marked
from ...core.capture import head as capture_heads
from ...core.capture.head import CaptureHead
from ...core.capture.kinds import Take
from ...core.errors import CaptureSetError, FarmError
from ...core.file_names import is_text
from ...core.files import is_writable
from ...core.fit.choice import check as check_choice
from ...core.units import size
from ..capture import room
from ..capture.asked import asked, begun
from ..capture.beside import given_by
from ..capture.check import check_scene
from ..capture.patterns import patterns_of
from ..capture.planned import Given
from ..capture.sequence import frame_kept, look, together
from ..shot import home
from ..shot.home import check_outside
from ..stage.takes import TAKES, WHOLE
from ..work import PLAIN, Progress, Steps, Wrote, looked
from . import job, templates
from .head import HEADER, is_job


def plan(
    scene: bpy.types.Scene,
    view_layer: str,
    folder: Path,
    frames: Sequence[int] | None,
    tiles: int | None,
    seeds: int,
) -> Steps[Path]:
    """Plan a job and write it into a folder, with templates for farms; returns the folder.

    frames: default the scene's present frame, with its subframe; tiles: the number for each frame
    (default: as many as memory makes necessary); seeds: the number for each tile.

    Raises FarmError where the folder has a job with parts already, has no room for the parts, or
    the file was never saved; and what `capture` raises.
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
    check_choice(scene.arto.support, patterns_of(scene.arto), scene.arto.separate)
    check_scene(scene, view_layer)
    _check_place(folder)
    if frames is not None:
        with frame_kept(scene):
            wrong = yield from look(scene, view_layer, frames, place=False)
        named = {f"frame {frame}": error for frame, error in wrong.items()}
        yield from looked(named, len(frames), "frames", PLAIN)
    _make_way(folder, [scene.frame_current] if frames is None else list(frames))
    # as with `capture`, a single frame keeps its subframe; as with `capture_frames`, several do not
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
            # cut all frames into as many tiles as the first
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
    yield Wrote(1.0, f"the job is in {folder}", folder)
    return folder


def _check_place(folder: Path) -> None:
    """Raise FarmError, or SceneError, where nothing can or may be written into a job's folder."""
    if not is_text(folder):
        raise FarmError(
            f"the path {str(folder)!a} is not written in UTF-8: plan into another folder"
        )
    check_outside(folder, "a job")
    if not is_writable(folder):
        raise FarmError(
            f"nothing can be written into {folder}: see who may write there, or plan into another "
            "folder"
        )


def _make_way(folder: Path, frames: list[int]) -> None:
    """Remove an earlier job from a folder, if nothing of it was rendered.

    Raises FarmError, before anything is removed, where something else is in the way.
    """
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
    # remove the head first: a process that is killed while planning then leaves no job
    if os.path.lexists(header):
        marked.remove_own_file(header, is_job)
    for there in sets:
        marked.remove(there, "capture", folder)


def _frames_in(folder: Path) -> list[Path]:
    form = re.compile(rf"frame_-?\d{{3,}}(_({'|'.join(TAKES)}))?")
    return [p for p in folder.iterdir() if form.fullmatch(p.name)] if folder.is_dir() else []


def _is_planned(folder: Path) -> bool:
    """Whether a folder is a capture set without a rendered tile."""
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
) -> Steps[dict[Take, CaptureHead]]:
    """Plan the takes of a frame -> the heads of their capture sets, by the take's name.

    The take of everything comes first.
    """
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
    """The key of the capture that all seeds make together, with the samples of all."""
    if seeds == 1:
        return head.key
    return hashlib.sha256(f"{head.key} {seeds}".encode()).hexdigest()[:16]


def _disk(head: CaptureHead, seeds: int) -> int:
    """Bytes that the parts of a take need in a job's folder until they are gathered.

    With several seeds, or where images are kept, the parts are images and not fitted tiles.
    """
    light, field = (job.estimate(head, fitted).kept for fitted in (False, True))
    if head.kept:
        return seeds * light
    return field if seeds == 1 else seeds * light + field


def _check_disk(folder: Path, needed: int) -> None:
    """Raise FarmError where the disk of a job's folder has no room for the parts."""
    free = room.free_disk(folder)
    if free < needed * (1 + room.SPARE):
        raise FarmError(
            f"the parts of this job need {size(needed)} of disk, and {folder} has "
            f"{size(free)} free: make room, or plan into another folder, or fewer frames or "
            "seeds"
        )
