"""More samples for a capture that is there, in place of a new one.

The samples are a stretch of the sequence of samples that the capture began, as a farm's seeds are.
The images of all stretches are averaged, weighted by their samples, and the field is fitted anew.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import bpy

from ...core import marked
from ...core.capture import head as heads
from ...core.capture.capture_set import CaptureSet
from ...core.capture.head import CaptureHead
from ...core.capture.kinds import Take
from ...core.capture.tile_entry import MOST_SAMPLES, SeedEntry, TileEntry, sums_of
from ...core.errors import CaptureSetError
from ...core.files import PART, Lock
from ..fit.fit import fit
from ..shot import paths
from ..shot.shot import check_same_shot, shot_of
from ..stage.takes import TAKES, WHOLE
from ..work import PLAIN, Batch, Steps, Wrote, attempted, of_piece, part_of
from . import beside, room
from .around import Around
from .asked import asked
from .capture import render_tile
from .check import check_scene
from .same import differences

# The share of the work that is done before the field is fitted anew.
RENDERED = 0.9


def more_samples(scene: bpy.types.Scene, view_layer: str, samples: int) -> Steps[Path]:
    """Add so many samples to the capture of a shot, and fit it -> the folder of its field.

    The capture and its field stay as they are until all new images are there. If this is stopped,
    the same call goes on with it. Raises SceneError, ShotError, FieldError, BusyError, ExrError,
    CancelledError, and CaptureSetError where the scene has changed since the capture, or its basis
    images were not kept.
    """
    check_scene(scene, view_layer)
    scene.view_layers[view_layer].update()
    place = paths.place(scene, view_layer)
    first = can_have_more(CaptureSet(place.readable / "capture"))
    check_same_shot(scene, first.shot, "the capture set", view_layer)
    claimed = paths.claim(scene, view_layer)
    with Lock(claimed, f"adding samples to {shot_of(scene, view_layer).title}"):
        names: tuple[Take, ...] = (*TAKES, WHOLE) if first.catchers else (WHOLE,)
        made: list[tuple[Path, CaptureHead]] = []
        for i, name in enumerate(names):
            steps = _stretch(scene, view_layer, claimed / name / "capture", name, first, samples)
            share = RENDERED / len(names)
            made.append((yield from part_of(steps, i * share, share)))
        # the first take comes last: as long as it is as before, this can be taken up again
        for folder, head in made:
            heads.write(folder, head)
    total = made[-1][1].samples
    yield Wrote(RENDERED, f"the capture has {total:g} samples now", claimed / "capture")
    return (yield from part_of(fit(scene, view_layer), RENDERED, 1 - RENDERED))


def more_of_frames(
    scene: bpy.types.Scene,
    view_layer: str,
    samples: int,
    frames: Sequence[int],
    batch: Batch = PLAIN,
) -> Steps[list[Path]]:
    """Add samples to the captures of some frames -> the folders of their fields.

    batch: what a failure and a warning mean. The scene is left at the last frame. Raises what
    `more_samples` raises.
    """
    folders: list[Path] = []
    for i, frame in enumerate(frames):
        scene.frame_set(frame)
        name, share = f"frame {frame}", i / len(frames)
        steps = part_of(
            more_samples(scene, view_layer, samples), share, 1 / len(frames), f"{name}: "
        )
        folder = yield from attempted(of_piece(steps, name), name, share, batch)
        folders += [folder] if folder else []
    return folders


def can_have_more(captured: CaptureSet) -> CaptureHead:
    """The head of a capture that samples can be added to. Raises CaptureSetError for others."""
    head = captured.head
    if not captured.kept or any(not tile.files for tile in head.tiles):
        raise CaptureSetError(
            "the basis images of this capture were not kept, so no samples can be added to them: "
            "capture again, with more samples, or with Keep Basis Images on Always"
        )
    if not head.samples or head.samples != int(head.samples) or head.route is None:
        raise CaptureSetError(
            f"{captured.folder} was not rendered by a capture, so no samples can be added to it: "
            "capture the shot"
        )
    return head


def key_of_more(key: str | None, samples: int) -> str:
    """The key of a capture to which samples were added. key: the one that it had."""
    return hashlib.sha256(f"{key} and {samples} samples".encode()).hexdigest()[:16]


def _stretch(
    scene: bpy.types.Scene,
    view_layer: str,
    folder: Path,
    name: Take,
    first: CaptureHead,
    samples: int,
) -> Steps[tuple[Path, CaptureHead]]:
    """Render more samples of a take -> its folder, and the head that it then has.

    first: the first take's head, as it was.
    """
    captured, key = CaptureSet(folder), key_of_more(first.key, samples)
    head, have = captured.head, int(first.samples or 0)
    if have + samples > MOST_SAMPLES:
        raise CaptureSetError(f"{have + samples} samples are more than Cycles counts: add fewer")
    if name != WHOLE and head.pair == key:
        return folder, head  # a process that was killed had all of this take
    can_have_more(captured)
    if head.samples != have:
        raise CaptureSetError(
            f"{folder} has {head.samples} samples, and what it belongs to has {have}: capture again"
        )
    _check_room(captured)
    for partial in folder.glob("*" + PART):
        marked.remove_file(partial, "capture")
    begun = time.perf_counter()
    with asked(scene, view_layer, beside.given_by(head), name) as this:
        here = replace(head, samples=this.head.samples)
        changed = differences(this, here)
        now = (this.head.patterns.name, bool(this.head.grain), this.shot.region)
        then = (head.patterns.name, bool(head.grain), head.shot.region if head.shot else None)
        what = zip(("the patterns", "the grain", "the render region"), now, then, strict=True)
        changed += [f"{text}: {a}, not {b}" for text, a, b in what if a != b]
        if changed:
            raise CaptureSetError(
                f"the scene is not as it was captured ({'; '.join(changed[:3])}): set it back, or "
                "capture again"
            )
        cycles = this.on.scene.cycles
        cycles.use_sample_subset = True
        cycles.sample_subset_length, cycles.sample_offset = samples, have
        cycles.samples = have + samples
        stretch, tiles = f"_from_{have}_to_{have + samples}", list[TileEntry]()
        with Around(this.on) as around:
            for t, tile in enumerate(head.tiles):
                steps = render_tile(this.on, head, t, folder, around, stretch)
                files = tuple((yield from steps))
                before = tile.seeds or (SeedEntry(have, tile.files),)
                seeds = (*before, SeedEntry(samples, files))
                sums = {**tile.sums, **sums_of(folder, files)}
                tiles.append(replace(tile, files=(*tile.files, *files), seeds=seeds, sums=sums))
    seconds = (head.seconds or 0.0) + time.perf_counter() - begun
    changes = {"samples": have + samples, "seconds": seconds, "tiles": tuple(tiles)}
    if name == WHOLE:
        return folder, replace(head, key=key, **changes)
    return folder, replace(head, key=key_of_more(head.key, samples), pair=key, **changes)


def _check_room(captured: CaptureSet) -> None:
    """Raise SceneError where the disk has no room for as many images as one stretch has."""
    tiles = captured.head.tiles
    names = [n for tile in tiles for n in (tile.seeds[0].files if tile.seeds else tile.files)]
    needed = sum((captured.folder / name).stat().st_size for name in names)
    room.check_disk(captured.folder, needed, "more samples")
