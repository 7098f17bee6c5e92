"""Capturing: the basis images, rendered by Cycles into a capture set (paper 4)."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import bpy

from ...core import exr, marked
from ...core.capture import head as heads
from ...core.capture.head import CaptureHead
from ...core.capture.kinds import Take
from ...core.capture.names import GROUP, group_name
from ...core.capture.tile_entry import TileEntry, sums_of
from ...core.errors import ArtoError, CaptureSetError, DeviceMemoryError, ExrError
from ...core.files import Lock, whole
from ...core.units import clock, size
from ..blender.output import write_to
from ..fit.guides import cleaned
from ..shot import paths
from ..shot.shot import shot_of
from ..stage import takes
from ..stage.small import threads
from ..stage.stage import Stage
from ..work import Progress, Render, Steps, Warned, Wrote, part_of
from . import beside, draft, room
from .around import Around, plan_of
from .asked import Asked, asked, begun
from .check import check_patterns, check_room_of, check_scene, incomplete_images
from .plan import ALIGNED, finer, strips_of
from .planned import Given, Planned
from .resume import empty, empty_take, finish, finish_field, let_go, unfinished
from .room import Estimate
from .stream import Stream


def check_file(path: Path, images: list[tuple[int, str]]) -> None:
    """Raise CaptureSetError unless Blender wrote all images of a render into the file."""
    expected = {group_name(k, name) for k, name in images}
    found = set()
    for name in exr.part_names(path):
        if match := GROUP.search(name):
            found.add(f"ARTO_{match[1]}_{match[2]}")
    if missing := expected - found:
        raise CaptureSetError(
            f"{path} lacks {len(missing)} of {len(expected)} light groups: make room on the disk "
            "and capture again"
        )


def capture(
    scene: bpy.types.Scene,
    view_layer: str,
    given: Given | None = None,
    together: Sequence[int] = (),
    shows: bool = False,
) -> Steps[Path]:
    """Render the basis images of a scene into its capture set; returns the folder.

    Where the settings keep no basis images, each tile is fitted as it comes, and the new field
    replaces the shot's. If the same capture of the same scene was stopped, this one goes on with
    it. An earlier finished set stays until the new set is complete, and so do unfinished sets of
    other settings. The scene does not change, except that it may be given the ID that its shots are
    found by.

    given: see `Given`; together: the frames of the sequence that this one is of. A frame of a
    sequence that is there already, just as it would be captured, is not captured again. shows:
    whether a window waits for a first picture, see `draft`. Raises
    SceneError, CaptureSetError, FieldError, PatternError, BusyError (another process captures this
    shot), ExrError, CancelledError.
    """
    with _claimed(scene, view_layer, together) as (place, left):
        if left:
            yield Progress(
                0.0,
                f"a process ended here in the middle of its work ({left}): if nobody stopped it, "
                "memory is the likely cause; then lower Memory in ARTO's settings",
            )
        return (yield from _capture(scene, view_layer, place, given, bool(together), shows))


def estimate(scene: bpy.types.Scene, view_layer: str) -> Steps[Estimate]:
    """Plan a capture, without its long renders -> what the capture will take.

    Raises what `capture` raises.
    """
    with _claimed(scene, view_layer) as (place, _), asked(scene, view_layer) as this:
        plan, _ = yield from _begun(this, paths.unfinished_folder(place, this.key))
        return plan.estimate


@contextmanager
def _claimed(
    scene: bpy.types.Scene, view_layer: str, together: Sequence[int] = ()
) -> Iterator[tuple[Path, str]]:
    """Check the scene, and hold the lock of its shot's own folder -> the folder, and what a process
    was doing there that ended without letting go, or nothing."""
    check_scene(scene, view_layer)
    # let the scene follow what a script has moved
    scene.view_layers[view_layer].update()
    check_patterns(scene)
    check_room_of(paths.place(scene, view_layer).folder)
    claimed = paths.claim(scene, view_layer, together)
    with Lock(claimed, f"capturing {shot_of(scene, view_layer).title}") as held:
        yield claimed, held.left


def _capture(
    scene: bpy.types.Scene,
    view_layer: str,
    claimed: Path,
    given: Given | None,
    of_sequence: bool,
    shows: bool,
) -> Steps[Path]:
    with asked(scene, view_layer, given) as this:
        folder = paths.unfinished_folder(claimed, this.key)
        head = unfinished(folder, this.key)
        if head is None and os.path.lexists(folder):
            marked.check(folder, "capture", claimed)  # it is emptied once all is planned
        if of_sequence and head is None and beside.is_whole(claimed, this.key, this.catchers):
            yield Wrote(1.0, "it is there already", claimed / "capture")
            return claimed / "capture"
        stopped = head is not None
        if head and head.caution:
            yield Warned(0.0, f"CAUTION: {head.caution.text}")
        for text in incomplete_images(this.found, scene.frame_current):
            yield Warned(0.0, text)
        if head is None:
            steps = _begun(this, folder, given)
            _, head = yield from draft.of_look(steps, this, claimed) if shows else steps
            empty(folder)
        part = 1 / (1 + len(takes.TAKES) * this.catchers)
        head = yield from part_of(_render_tiles(this.on, folder, head, shows), 0.0, part)
    made = [(folder, claimed, head)]
    for i, name in enumerate(takes.TAKES if this.catchers else ()):
        steps = _capture_beside(scene, view_layer, claimed / name, name, head, stopped)
        found = yield from part_of(steps, (i + 1) * part, part)
        made += [found] if found else []
    # Put all takes in place at the end: until then an earlier capture stays whole. The first take
    # comes last: as long as it is unfinished, an interrupted end can be taken up again.
    for each in reversed(made):
        yield from _finish(scene, *each)
    if not head.kept:
        paths.remove_draft(claimed)
    if not this.catchers:
        for name in takes.TAKES:
            empty_take(claimed / name)
    paths.forget()
    caution = f". CAUTION: {head.caution.text}" if head.caution else ""
    text = f"captured {len(head.hemicube)} patches{caution}"
    if not head.kept:
        yield Wrote(1.0, text, claimed / "field")
    yield Wrote(1.0, text, claimed / "capture")
    return claimed / "capture"


def _begun(
    this: Asked, folder: Path, given: Given | None = None
) -> Steps[tuple[Planned, CaptureHead]]:
    """Plan the first of a shot's takes, and count in what the takes beside it need."""
    count = 1 + len(takes.TAKES) * this.catchers
    return begun(this, folder, given, takes=count, often=True, place=folder.parent)


def _capture_beside(
    scene: bpy.types.Scene,
    view_layer: str,
    place: Path,
    name: Take,
    first: CaptureHead,
    stopped: bool,
) -> Steps[tuple[Path, Path, CaptureHead] | None]:
    """Render a take beside the first -> (its folder, the place to put it, its head).

    first: the first take's head; stopped: whether this goes on with a capture that was stopped. In
    that case None is returned for a take that is there already.
    """
    given = beside.given_by(first)
    with asked(scene, view_layer, given, name) as this:
        folder = paths.unfinished_folder(place, this.key)
        head = unfinished(folder, this.key)
        there = place / "capture"
        if head is None and stopped and beside.is_there(there, this.key, first.key):
            return None
        if head is None:
            _, head = yield from begun(this, folder, given, len(first.tiles))
            empty(folder)
        head = yield from _render_tiles(this.on, folder, replace(head, pair=first.key))
    return folder, place, head


def _finish(
    scene: bpy.types.Scene, unfinished: Path, place: Path, head: CaptureHead
) -> Steps[None]:
    """Put a complete take in the last one's place; its field, if tiles were fitted as they came."""
    if not head.kept:
        finish_field(unfinished, place / "field", head)
        yield from cleaned(scene, place / "field")
    finish(unfinished, place / "capture")


def _render_tiles(
    on: Stage, folder: Path, head: CaptureHead, shows: bool = False
) -> Steps[CaptureHead]:
    """Render the missing tiles of a capture set -> the head of the complete set.

    Where the settings keep no images, the tiles are fitted as well. shows: whether a window waits
    for a first picture.
    """
    stream = None if head.kept else Stream(folder)
    around = Around(on)
    heads.write(folder, head)

    def take(patience: float | None) -> bool:
        """Note down the tile that was fitted -> whether a tile is still being fitted."""
        nonlocal head
        if stream and (ended := stream.ended(patience)):
            number, fitted = ended
            head = let_go(folder, head, number, fitted)
        return stream is not None and stream.busy

    def fit(number: int) -> Iterator[Progress]:
        while take(0.1):
            tiles = len(head.tiles)
            yield Progress((number + 0.5) / tiles, f"fitting tile {number} of {tiles}")
        if stream:
            stream.start(number)

    try:
        path = (yield from draft.draft(on, folder, head, around)) if shows else None
        if path:
            # by the planes and patterns of the tiles, which the looks did not have
            head = _finer(folder, head, -1, path * (head.samples or 0), on)
            heads.write(folder, head)
            left = room.seconds_of(head, len(plan_of(head)[0]), path, on.pace, threads(on.scene))
            yield Progress(0.0, f"this capture: about {clock(left)}, by its draft")
        t = -1
        while (t := t + 1) < len(head.tiles):
            entry, tiles = head.tiles[t], len(head.tiles)
            if entry.done:
                yield Progress((t + 1) / tiles, f"tile {t + 1} of {tiles} is there")
                if stream and entry.fitted is None:
                    yield from fit(t)
                continue
            begun_at = time.perf_counter()
            try:
                files = yield from render_tile(on, head, t, folder, around)
            except DeviceMemoryError as e:
                smaller = _in_halves(folder, head, t)
                if smaller is None:
                    raise
                yield Warned(t / tiles, f"{e}. It is tried again in smaller tiles")
                head = smaller
                heads.write(folder, head)
                on.renew()
                t -= 1
                continue
            took = time.perf_counter() - begun_at
            seconds = (head.seconds or 0.0) + took
            done = {"files": tuple(files), "sums": sums_of(folder, files), "done": True}
            head = replace(head.with_tile(t, **done), seconds=seconds)
            head = _finer(folder, head, t, took / entry.region.pixels, on)
            heads.write(folder, head)
            take(0.0)
            yield from fit(t)
        while take(0.1):
            yield Progress(0.99, f"fitting tile {len(head.tiles)} of {len(head.tiles)}")
    finally:
        around.__exit__()
        if stream:
            stream.stop()
    return head


def _finer(folder: Path, head: CaptureHead, number: int, pace: float, on: Stage) -> CaptureHead:
    """The head with the tiles after one of this number cut finer, where they would take too long.

    pace: seconds of a pixel of that tile. Work is kept at the end of each tile.
    """
    left = [tile.region for tile in head.tiles[number + 1 :]]
    ready = on.pace.again if on.pace and on.is_kept else 0.0
    cut = finer(left, pace, ready, number + 1)
    if cut == left:
        return head
    for k in range(number + 1, len(head.tiles)):
        for there in folder.glob(f"tile_{k:04d}*.exr"):  # of a process that was killed
            marked.remove_file(there, "capture")
    return replace(head, tiles=(*head.tiles[: number + 1], *map(TileEntry, cut)))


def _in_halves(folder: Path, head: CaptureHead, number: int) -> CaptureHead | None:
    """The head with the tile of this number, and all after it, cut into halves.

    None where the tile is too thin. What was rendered of the tile is removed.
    """
    if head.tiles[number].region.height < 2 * ALIGNED:
        return None
    for there in folder.glob(f"tile_{number:04d}*.exr"):
        marked.remove_file(there, "capture")
    halves = [TileEntry(r) for e in head.tiles[number:] for r in strips_of(e.region, 2)]
    return replace(head, tiles=(*head.tiles[:number], *halves))


def render_tile(
    on: Stage, head: CaptureHead, number: int, folder: Path, around: Around, stretch: str = ""
) -> Steps[list[str]]:
    """Render the missing files of a tile into a folder -> the names of all its files.

    stretch: what the names have beside the number of the tile.
    """
    plan, tiles = plan_of(head), len(head.tiles)
    total = len(plan) * tiles
    sizes = [tile.region.pixels for tile in head.tiles]
    before, span = sum(sizes[:number]) / sum(sizes), sizes[number] / sum(sizes) / len(plan)
    files = []
    for i, images in enumerate(plan):
        at = number * len(plan) + i
        text = f"render {at + 1} of {total}: {len(images)} basis images"
        name = f"tile_{number:04d}{stretch}" + (f"_{i:04d}.exr" if len(plan) > 1 else ".exr")
        # a killed process may have finished the file without noting it down
        if not is_whole(folder / name, images):
            around.set_tile(head, number, images)
            work = Render(on.scene.name, before + i * span, text, span)
            yield from _render(on, images, folder / name, work)
        files.append(name)
    return files


def is_whole(path: Path, images: list[tuple[int, str]]) -> bool:
    """Whether a file holds all basis images of a render."""
    if not path.is_file():
        return False
    try:
        check_file(path, images)
    except ArtoError:
        return False  # a missing or damaged file is rendered again
    return True


def _render(
    on: Stage,
    images: list[tuple[int, str]],
    path: Path,
    request: Render,
) -> Steps[None]:
    """Render some basis images into `path`. Their planes are around the stage."""
    with whole(path) as partial:
        write_to(on.scene.render, partial)
        on.about_to_render()
        yield request
        request.check()
        if not partial.stat().st_size:
            raise CaptureSetError(
                f"Blender did not write {path}: make room on the disk, or choose a folder that "
                "can be written"
            )
        try:
            check_file(partial, images)
        except ExrError as e:
            raise CaptureSetError(f"what was rendered is not whole ({e}). {_room(path)}") from e


def _room(path: Path) -> str:
    """What to do where a render could not be written, in words."""
    free = size(room.free_disk(path.parent))
    return (
        f"If the console says that a file could not be written: {path.parent} has {free} free, and "
        "there may be a limit for files (quota, ulimit -f); make room, and capture again"
    )
