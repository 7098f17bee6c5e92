"""Gathering a farm's job: every part is there and of one scene, and becomes a field."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import bpy

from ...core.capture_set import CaptureSet, write_header
from ...core.errors import ArtoError, FarmError
from ...core.field import proxy_folder
from ...core.files import PART, Lock
from ...core.fit import fit_into
from ...core.proxy import FACTORS
from ..capture.capture import check_file, plan_of
from ..capture.resume import finish, finish_field, let_go
from ..capture.stream import Stream
from ..relight.denoise import cleaned
from ..shot import paths
from ..shot.shot import shot_of
from ..work import Progress, Steps
from .job import Job, Part


def gather(job_folder: Path) -> Steps:
    """Join the parts of a job: the field of each frame takes the place of its shot's; returns the
    fields' folders.

    Seeds are averaged by their samples, light by light. Raises FarmError, naming what is missing;
    then nothing has changed.
    """
    job = Job(job_folder)
    sets = {frame: job.set_of(frame) for frame in job.frames if not _gathered(job, frame)}
    found = {p: _found(job, p, sets[p.frame]) for p in job.parts if p.frame in sets}
    missing = [p for p, there in found.items() if there is None]
    if missing:
        numbers = ", ".join(str(p.number) for p in missing[:20])
        raise FarmError(
            f"{len(missing)} of {len(job.parts)} parts are not there ({numbers}"
            f"{', ...' if len(missing) > 20 else ''}): render them, and gather again"
        )
    folders = []
    with job.scene() as (scene, view_layer):
        for i, frame in enumerate(job.frames):
            yield Progress(i / len(job.frames), f"gathering frame {frame}")
            scene.frame_set(frame)
            scene.view_layers[view_layer].update()
            claimed = paths.claim(scene, view_layer)
            with Lock(claimed, f"gathering {shot_of(scene, view_layer).title}"):
                if frame in sets:
                    parts = {p: t for p, t in found.items() if p.frame == frame and t is not None}
                    yield from _joined(job, frame, parts)
                    yield from _placed(scene, job.set_folder(frame), claimed)
            folders.append(claimed / "field")
    paths.forget()
    for partial in (job.folder / "parts").glob("*" + PART):
        shutil.rmtree(partial, ignore_errors=True)
    yield Progress(1.0, f"gathered {len(job.parts)} parts into {len(folders)} fields")
    return folders


def _gathered(job: Job, frame: int) -> bool:
    """Whether a frame's capture set has gone to its shot."""
    return not job.set_folder(frame).is_dir()


def _found(job: Job, part: Part, captured: CaptureSet) -> dict[str, Any] | None:
    """What there is of a part: what it says of itself, or the files that a Blender without ARTO has
    rendered. None where not all of it is there."""
    if captured.head["tiles"][part.tile]["done"]:
        return {"taken": True}
    if told := job.there(part, captured.head["key"]):
        return told
    files = []
    for i, images in enumerate(plan_of(captured.head)):
        rendered = sorted((job.folder / "parts").glob(f"{part.name}_{i:02d}_*.exr"))
        if not rendered:
            return None
        try:
            check_file(rendered[-1], images)
        except ArtoError as e:
            raise FarmError(f"{e}: render part {part.number} again") from e
        files.append(rendered[-1].name)
    return {"files": files, "samples": job.settings["samples"], "loose": True}


def _joined(job: Job, frame: int, parts: dict[Part, dict[str, Any]]) -> Steps:
    """Take the parts of a frame into its capture set, tile by tile, and fit what is not yet."""
    folder = job.set_folder(frame)
    head = job.set_of(frame).head
    for tile in range(job.tiles):
        entry = head["tiles"][tile]
        some = [(p, t) for p, t in parts.items() if p.tile == tile]
        yield Progress(tile / job.tiles, f"frame {frame}: tile {tile + 1} of {job.tiles}")
        if not entry["done"]:
            _take(job, folder, entry, some)
            total = sum(samples for samples, _ in entry.get("seeds", ())) or head["samples"]
            head["samples"] = total
            write_header(folder, head)
        if not head["kept"] and "fitted" not in entry:
            captured = CaptureSet(folder, unfinished=True)
            let_go(folder, head, tile, (yield from _fit(captured, tile, job.tiles)))
    for part in parts:
        shutil.rmtree(job.part_folder(part), ignore_errors=True)


def _take(
    job: Job, folder: Path, entry: dict[str, Any], some: list[tuple[Part, dict[str, Any]]]
) -> None:
    """Move what a tile's parts have into its capture set; its description is not written yet."""
    seeds = []
    for part, told in some:
        source = job.folder / "parts" if told.get("loose") else job.part_folder(part)
        names = []
        for i, name in enumerate(told["files"]):
            names.append(f"tile_{part.tile:04d}_seed_{part.seed:02d}_{i:04d}.exr")
            if (source / name).exists():  # else it was moved before a gathering was stopped
                (source / name).replace(folder / names[-1])
        seeds.append([told["samples"], names])
        if fitted := told.get("fitted"):
            entry["fitted"] = fitted
            _take_field(source / Stream.FIELD, folder / Stream.FIELD, fitted["folder"])
    entry["files"] = [name for _, names in seeds for name in names]
    if len(seeds) > 1:
        entry["seeds"] = seeds
    entry["done"] = True


def _take_field(source: Path, field: Path, name: str) -> None:
    """Move a fitted tile, and its proxies, from a part's folder to the field's."""
    for here, there in [
        (source, field),
        *((proxy_folder(source, f), proxy_folder(field, f)) for f in FACTORS),
    ]:
        if (here / name).is_dir():
            there.mkdir(parents=True, exist_ok=True)
            shutil.rmtree(there / name, ignore_errors=True)
            (here / name).replace(there / name)


def _fit(captured: CaptureSet, tile: int, tiles: int) -> Steps:
    """Fit a tile of a set into `field` in its folder -> its entry in `field.json`."""
    steps = fit_into(captured, tile, captured.folder / Stream.FIELD)
    while True:
        try:
            share = next(steps)
        except StopIteration as end:
            return end.value
        yield Progress((tile + share) / tiles, f"fitting tile {tile + 1} of {tiles}")


def _placed(scene: bpy.types.Scene, folder: Path, claimed: Path) -> Steps:
    """Put a frame's complete capture set, and its field, where the shot's last ones are."""
    head = CaptureSet(folder).head
    if not head["kept"]:
        finish_field(folder, claimed / "field", head)
        yield from cleaned(scene, claimed / "field")
    finish(folder, claimed / "capture")
