"""Gather a farm's job: check that all parts are there and of one scene, and fit them."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import bpy

from ...core import exr, marked
from ...core.capture import head as heads
from ...core.capture.capture_set import CaptureSet
from ...core.capture.head import CaptureHead
from ...core.capture.kinds import Take
from ...core.capture.tile_entry import SeedEntry, TileEntry, fitted_name, sums_of
from ...core.errors import ArtoError, FarmError
from ...core.field.field import proxy_folder
from ...core.field.proxy import FACTORS
from ...core.files import PART, Lock, moved, replace_folder
from ...core.fit.fit import fit as fit_captured
from ...core.fit.fit import fit_into
from ..capture import room
from ..capture.around import plan_of
from ..capture.capture import check_file
from ..capture.check import check_place
from ..capture.resume import empty_take, finish, finish_field, let_go
from ..capture.stream import Stream
from ..fit.fit import is_fitted
from ..fit.guides import cleaned
from ..shot import paths, scene_id
from ..shot.shot import shot_of
from ..stage.takes import TAKES
from ..work import PLAIN, Batch, Progress, Steps, Wrote, attempted, looked, of_piece, retold
from .head import Part
from .job import Job, estimate


def gather(job_folder: Path, batch: Batch = PLAIN) -> Steps[list[Path]]:
    """Join the parts of a job; returns the folders of the frames' fields.

    The fields of each frame and of its takes replace those of the shot. Images of several seeds are
    averaged, weighted by their samples. batch: what a frame with missing parts, and a warning,
    mean. Raises FarmError, which names what is missing, before anything is changed.
    """
    job = Job(job_folder)
    there: dict[int, _Frame] = {}
    wrong: dict[str, ArtoError] = {}
    folders: list[Path] = []
    with job.scene() as (scene, view_layer):
        for frame in job.head.frames:
            try:
                there[frame] = _looked_at(job, frame)
                job.go_to(scene, frame)
                check_place(scene, view_layer)
                _check_room(scene, view_layer, there[frame])
            except ArtoError as e:
                wrong[f"frame {frame}"] = e
        yield from looked(wrong, len(job.head.frames), "frames", batch)
        left = [frame for frame in there if f"frame {frame}" not in wrong]
        for i, frame in enumerate(left):
            share = i / len(left)
            yield Progress(share, f"gathering frame {frame}")
            job.go_to(scene, frame)
            steps = of_piece(_gather(job, scene, view_layer, there[frame]), f"frame {frame}")
            folder = yield from attempted(steps, f"frame {frame}", share, batch)
            folders += [folder] if folder else []
    paths.forget()
    parts = job.folder / "parts"
    for partial in list(parts.iterdir()) if parts.is_dir() else []:
        if partial.name.endswith(PART):
            marked.remove_quietly(partial, "part", parts)
    if not folders:
        raise FarmError("none of the frames could be gathered: see what was said of each")
    yield Progress(1.0, f"gathered {len(job.parts)} parts into {len(folders)} fields")
    return folders


@dataclass(frozen=True)
class _Frame:
    """What there is of a frame that is to be gathered: its capture sets, and its parts."""

    frame: int
    sets: Mapping[Take, CaptureSet]
    parts: Mapping[Part, Found]


def _looked_at(job: Job, frame: int) -> _Frame:
    """Look at the sets and parts of a frame. Raises ArtoError where something is missing."""
    sets = {
        take: job.set_of(frame, take)
        for take in job.takes(frame)
        if not _gathered(job, frame, take)
    }
    sets = {take: _without_damaged(captured, job) for take, captured in sets.items()}
    wanted = [part for part in job.parts if part.frame == frame and part.take in sets]
    found = {part: _found(job, part, sets[part.take]) for part in wanted}
    if missing := [part for part, there in found.items() if there is None]:
        numbers = ", ".join(str(part.number) for part in missing[:20])
        raise FarmError(
            f"{len(missing)} of {len(wanted)} parts are not there ({numbers}"
            f"{', ...' if len(missing) > 20 else ''}): render them, and gather again"
        )
    return _Frame(frame, sets, {part: there for part, there in found.items() if there})


def _check_room(scene: bpy.types.Scene, view_layer: str, there: _Frame) -> None:
    """Raise SceneError where a frame must be copied to another disk that has no room for it."""
    place = paths.place(scene, view_layer).folder
    near = place
    while not near.exists() and near != near.parent:
        near = near.parent
    room.free_disk(place)  # which says so where the disk itself is missing
    for captured in there.sets.values():
        if captured.folder.stat().st_dev != near.stat().st_dev:
            needed = estimate(captured.head, not captured.kept).kept
            room.check_disk(place, needed, f"frame {there.frame}")


def _gather(job: Job, scene: bpy.types.Scene, view_layer: str, there: _Frame) -> Steps[Path]:
    """Join the parts of a frame -> the folder of its field."""
    frame = there.frame
    claimed = paths.claim(scene, view_layer, job.head.frames)
    with Lock(claimed, f"gathering {shot_of(scene, view_layer).title}"):
        for take in there.sets:
            parts = {part: found for part, found in there.parts.items() if part.take == take}
            yield from _joined(job, frame, take, parts)
        for take in there.sets:
            yield from _fitted(scene, job.set_folder(frame, take))
        # put all takes in place at the end, the first take last, as `capture` does
        for take in reversed(list(there.sets)):
            yield from _placed(scene, job.set_folder(frame, take), claimed / take)
        if there.sets and frame not in job.catchers:
            for take in TAKES:
                empty_take(claimed / take)
    yield Wrote(1.0, f"gathered frame {frame}", claimed / "field")
    return claimed / "field"


def _gathered(job: Job, frame: int, take: Take) -> bool:
    """Whether the capture set of a take of a frame was already moved to the shot."""
    return not job.set_folder(frame, take).is_dir()


@dataclass(frozen=True)
class Found:
    """What there is of a part.

    Parameters
    ----------
    folder : where the part's files are; None where its capture set has them already.
    files : the names of its EXR files.
    samples : of each pixel.
    fitted : the entry in `field.json`, if the part was fitted and its images removed.
    sums : the checksums of the files, by their names.
    """

    folder: Path | None
    files: tuple[str, ...] = ()
    samples: int = 0
    fitted: Mapping[str, object] | None = None
    sums: Mapping[str, int] = field(default_factory=dict)


def _found(job: Job, part: Part, captured: CaptureSet) -> Found | None:
    """Find what was rendered of a part, with ARTO or by a Blender without ARTO.

    None where a file is missing.
    """
    if captured.head.tiles[part.tile].done:
        return Found(None)
    again = f"render part {part.number} again"
    if told := job.there(part, captured.head.key):
        if wrong := job.damage(part, told):
            raise FarmError(f"{wrong}: {again}")
        return Found(job.part_folder(part), told.files, told.samples, told.fitted, told.sums)
    files = []
    for i, images in enumerate(plan_of(captured.head)):
        rendered = job.folder / "parts" / part.rendered_name(i)
        if not rendered.exists():
            return None
        try:
            check_file(rendered, images)
            said = str(exr.header(rendered).get("Note", ""))
        except ArtoError as e:
            raise FarmError(f"{e}: {again}") from e
        if said != part.note(i, captured.head.key):
            raise FarmError(
                f"{rendered} is not of this part (its header says '{said}'): save the part's "
                f".blend anew, and {again}"
            )
        files.append(rendered.name)
    parts = job.folder / "parts"
    samples = job.samples_of(captured.head)
    return Found(parts, tuple(files), samples, sums=sums_of(parts, files))


def _without_damaged(captured: CaptureSet, job: Job) -> CaptureSet:
    """Take back the tiles of a set whose images were moved there and were damaged since.

    Their parts count as missing then, until they are rendered again.
    """
    head = captured.head
    for number, tile in enumerate(head.tiles):
        if tile.done and tile.fitted is None and _is_damaged(captured.folder, tile):
            samples = job.samples_of(head)
            head = head.with_tile(number, files=(), seeds=(), sums={}, done=False)
            if not head.done:
                head = replace(head, samples=samples)
    if head is not captured.head:
        heads.write(captured.folder, head)
    return CaptureSet(captured.folder, unfinished=True)


def _is_damaged(folder: Path, tile: TileEntry) -> bool:
    try:
        return sums_of(folder, tile.sums) != tile.sums
    except ArtoError:
        return True


def _joined(job: Job, frame: int, take: Take, parts: dict[Part, Found]) -> Steps[None]:
    """Move the parts of a take into its capture set, tile by tile, and fit unfitted tiles."""
    folder = job.set_folder(frame, take)
    head = job.set_of(frame, take).head
    samples = job.head.seeds * job.samples_of(head)
    title = f"frame {frame}, {take}" if take else f"frame {frame}"
    for tile in range(job.head.tiles):
        some = [(p, t) for p, t in parts.items() if p.tile == tile]
        yield Progress(tile / job.head.tiles, f"{title}: tile {tile + 1} of {job.head.tiles}")
        if not head.tiles[tile].done:
            head = replace(_taken(folder, head, tile, some), samples=samples)
            heads.write(folder, head)
        if not head.kept and head.tiles[tile].fitted is None:
            captured = CaptureSet(folder, unfinished=True)
            fitted = yield from _fit(captured, tile, job.head.tiles)
            head = let_go(folder, head, tile, fitted)
    for part in parts:
        marked.remove_quietly(job.part_folder(part), "part", job.folder)


def _taken(
    folder: Path, head: CaptureHead, tile: int, some: list[tuple[Part, Found]]
) -> CaptureHead:
    """Move the files of a tile's parts into its capture set -> the set's new head.

    The head is not written yet.
    """
    seeds, fitted, sums = [], None, {}
    for part, told in some:
        names = []
        if told.folder is None:
            raise FarmError(f"{part.name} was gathered, but {folder} does not say so: plan again")
        for i, name in enumerate(told.files):
            names.append(part.file_name(i))
            if (told.folder / name).exists():  # otherwise an earlier gathering moved it
                moved(told.folder / name, folder / names[-1])
            if name in told.sums:
                sums[names[-1]] = told.sums[name]
        seeds.append(SeedEntry(told.samples, tuple(names)))
        if told.fitted:
            fitted = told.fitted
            name = fitted_name(fitted)
            _take_field(told.folder / Stream.FIELD, folder / Stream.FIELD, name)
    return head.with_tile(
        tile,
        files=tuple(name for seed in seeds for name in seed.files),
        seeds=tuple(seeds) if len(seeds) > 1 else (),
        fitted=fitted or head.tiles[tile].fitted,
        sums=sums,
        done=True,
    )


def _take_field(source: Path, field: Path, name: str) -> None:
    """Move a fitted tile and its proxies from a part's folder to the field's folder."""
    for here, there in [
        (source, field),
        *((proxy_folder(source, f), proxy_folder(field, f)) for f in FACTORS),
    ]:
        if (here / name).exists():
            there.mkdir(parents=True, exist_ok=True)
            marked.mark(there, "field")
            if (there / name).is_dir():
                marked.remove(there / name, "tile", there)
            moved(here / name, there / name)


def _fit(captured: CaptureSet, tile: int, tiles: int) -> Steps[dict]:
    """Fit a tile of a set into `field` in the set's folder -> the tile's entry in `field.json`."""
    steps = fit_into(captured, tile, captured.folder / Stream.FIELD)
    return retold(
        steps, lambda share: Progress((tile + share) / tiles, f"fitting tile {tile + 1} of {tiles}")
    )


def _fitted(scene: bpy.types.Scene, folder: Path) -> Steps[None]:
    """Give a set the scene's ID, and fit the images that it keeps, before it takes its place."""
    captured = CaptureSet(folder)
    # a job planned before the scene had an ID has none, and names may change: add the ID now
    if captured.head.shot:
        shot = replace(captured.head.shot, scene_id=scene_id.of(scene))
        heads.write(folder, replace(captured.head, shot=shot))
        captured = CaptureSet(folder)
    choice, separate = scene.arto.support, scene.arto.separate
    field = folder / Stream.FIELD
    if captured.kept and not is_fitted(captured, field, choice, separate):
        for share, text in fit_captured(captured, field, choice, separate):
            yield Progress(share, text)


def _placed(scene: bpy.types.Scene, folder: Path, place: Path) -> Steps[None]:
    """Replace the shot's last capture set and field by the complete new set and its field."""
    try:
        place.mkdir(exist_ok=True)
        near = folder
        if folder.stat().st_dev != place.stat().st_dev:
            # a folder can replace another only on one disk, so copy the set first; the job's own
            # set is removed last, so that a killed gathering can be done again
            near = marked.scratch(place / folder.name, "capture")
            yield Progress(0.99, f"copying {folder.name} to {place}")
            shutil.copytree(folder, near, dirs_exist_ok=True)
    except OSError as e:
        raise FarmError(f"{place} cannot be written ({e}): make room, and gather again") from e
    head = CaptureSet(near).head
    if head.kept:
        if (near / Stream.FIELD).exists():  # else a gathering that was stopped has put it there
            replace_folder(near / Stream.FIELD, place / "field")
    else:
        finish_field(near, place / "field", head)
    yield from cleaned(scene, place / "field")
    finish(near, place / "capture")
    if near != folder:
        marked.remove(folder, "capture", folder.parent)
