"""A part of a farm's job: one tile of one take of a frame, rendered with one seed.

The part is also fitted if the job has a single seed and keeps no images.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import bpy

from ...core import marked
from ...core.capture.capture_set import CaptureSet
from ...core.capture.tile_entry import sums_of
from ...core.errors import FarmError
from ...core.files import replace_folder, whole
from ...core.fit.fit import fit_into
from ..blender import devices
from ..blender.output import write_to
from ..blender.saving import check_whole
from ..capture import room
from ..capture.around import Around, plan_of
from ..capture.asked import Asked, asked
from ..capture.capture import render_tile
from ..capture.check import check_scene
from ..capture.planned import Given
from ..capture.same import differences
from ..capture.stream import Stream
from ..work import Progress, Steps, Wrote, retold
from .head import Part, PartHead, write_part
from .job import Job, estimate


def render_part(job_folder: Path, number: int, device: str = "") -> Steps[Path]:
    """Render a part of a job, unless it is there already; returns the part's folder.

    A part is there as a whole or not at all; a part whose process was killed is rendered again.
    device: see `devices.render_with`; the part says which it was rendered with.
    Raises FarmError where the scene has changed since the plan, and what `capture` raises.
    """
    job = Job(job_folder)
    part = job.part(number)
    captured = job.set_of(part.frame, part.take)
    folder = job.part_folder(part)
    if told := job.there(part, captured.head.key):
        wrong = job.damage(part, told)
        if not wrong:
            yield Wrote(1.0, f"{part.name} is there", folder)
            return folder
        yield Progress(0.0, f"{wrong}: {part.name} is rendered again")
    fitted = job.head.seeds == 1 and not captured.kept
    needed = estimate(captured.head, fitted)
    room.check_memory(needed.memory, part.name)
    room.check_disk(folder, needed.disk // max(job.head.tiles, 1), part.name)
    begun = time.perf_counter()
    partial: Path | None = None
    try:
        # a folder with a unique name: a farm may have given the part to two machines
        partial = marked.scratch(folder, "part")
        with (
            _on_stage(job, part, captured) as this,
            Around(this.on) as around,
        ):
            devices.render_with(this.on.scene, device)
            rendered_with = devices.used(this.on.scene)
            files = yield from render_tile(this.on, captured.head, part.tile, partial, around)
        entry = None
        if fitted:
            entry = yield from _fitted(captured, part, partial, files)
            for name in files:
                marked.remove_file(partial / name, "part")
            files = []
        told = PartHead(
            part=part,
            key=captured.head.key or "",
            samples=job.samples_of(captured.head),
            files=tuple(files),
            seconds=round(time.perf_counter() - begun, 3),
            fitted=entry,
            sums=sums_of(partial, files),
            device=rendered_with,
        )
        write_part(partial, told)
        try:
            replace_folder(partial, folder)
        except OSError:
            # a farm may give a part to two machines: then the other one was first
            if not job.there(part, captured.head.key):
                raise
    except OSError as e:
        raise FarmError(f"{folder} cannot be written ({e}): make room, or see who may write") from e
    finally:
        if partial:
            marked.remove_quietly(partial, "part", folder.parent)
    yield Wrote(1.0, f"rendered {part.name} ({rendered_with})", folder)
    return folder


def save_part(job_folder: Path, number: int) -> Steps[Path]:
    """Save a part as .blend files for a Blender without ARTO, one for each render of the part.

    Returns the first file. `gather` finds the pictures that the files render to. Raises what
    `render_part` raises, and FarmError for two cases that such a Blender would render differently:
    a moment between two frames, and a take that changes linked objects.
    """
    job = Job(job_folder)
    part = job.part(number)
    captured = job.set_of(part.frame, part.take)
    if job.head.subframe:
        raise FarmError(
            f"{part.name} is of a moment between two frames, and what renders a file renders whole "
            "ones: render that part with ARTO, or plan it at a whole frame"
        )
    saved = []
    with _on_stage(job, part, captured) as this:
        for thing in this.otherwise:
            if thing.library or thing.override_library:
                raise FarmError(
                    f"'{thing.name}' comes from a library, and a file has it as the library does, "
                    f"but {part.name} needs it otherwise, as there are shadow catchers: render "
                    "that part with ARTO, or make the object local and plan again"
                )
        this.on.let_go()
        for i, images in enumerate(plan_of(captured.head)):
            yield Progress(i / len(plan_of(captured.head)), f"saving {part.name}")
            path = job.folder / "parts" / f"{part.name}_{i:02d}.blend"
            path.parent.mkdir(parents=True, exist_ok=True)
            with Around(this.on) as around:
                around.set_tile(captured.head, part.tile, images)
                write_to(this.on.scene.render, Path(f"//{part.name}_{i:02d}_####.exr"))
                # by which a gathering knows of what the picture is, whatever its name
                this.on.scene.render.use_stamp_note = True
                this.on.scene.render.stamp_note_text = part.note(i, captured.head.key)
                _save_alone(this.on.scene, path)
            saved.append(path)
            yield Wrote((i + 1) / len(plan_of(captured.head)), f"saved {path.name}", path)
    yield Progress(1.0, f"saved {len(saved)} files of {part.name}")
    return saved[0]


def _save_alone(scene: bpy.types.Scene, path: Path) -> None:
    """Save a file with this scene and all that the scene needs, at the scene's frame."""
    scene.frame_start = scene.frame_end = scene.frame_current
    with whole(path) as partial:
        bpy.data.libraries.write(str(partial), {scene}, path_remap="RELATIVE", compress=True)
        check_whole(partial)


@contextmanager
def _on_stage(job: Job, part: Part, captured: CaptureSet) -> Iterator[Asked]:
    """Set the stage for a part and its seed. Raises FarmError where the scene has changed."""
    head = captured.head
    given = Given(head.hemicube, head.told_route, None)
    samples = job.samples_of(head)
    with job.scene() as (scene, view_layer):
        job.go_to(scene, part.frame)
        check_scene(scene, view_layer)
        with asked(scene, view_layer, given, part.take) as this:
            changed = differences(this, replace(head, samples=samples))
            if changed:
                raise FarmError(
                    f"this is not the scene that was planned ({'; '.join(changed[:3])}): give "
                    "every machine the same file and the same Blender, or plan again"
                )
            if job.head.seeds > 1:
                # Each seed is a stretch of one long sequence of samples. Separate seeds would be
                # worse: samples of one stretch lie between those of the others. All takes use the
                # same stretch: the noise that they share cancels where takes are divided.
                cycles = this.on.scene.cycles
                cycles.use_sample_subset = True
                cycles.sample_subset_length = samples
                cycles.sample_offset = part.seed * samples
                cycles.samples = job.head.seeds * samples
            yield this


def _fitted(captured: CaptureSet, part: Part, folder: Path, files: list[str]) -> Steps[dict]:
    """Fit a part's tile into the part's folder -> the tile's entry in `field.json`."""
    head = captured.head.with_tile(part.tile, files=tuple(files))
    rendered = CaptureSet(folder, unfinished=True, head=head)
    steps = fit_into(rendered, part.tile, folder / Stream.FIELD)
    return retold(steps, lambda share: Progress(0.5 + share / 2, f"fitting {part.name}"))
