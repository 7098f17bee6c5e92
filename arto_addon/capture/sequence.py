"""An animated shot: a field for each frame, in the light of the same patches (paper 9).

The patches are those that the first, the middle and the last frame need together, around all that
these three frames show. With the same patches for all frames, two frames differ only by what moved.
The seeds follow the artist's own rule, so the noise changes or stays as in the artist's render.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np

from ...core.capture.kinds import Route
from ...core.capture.refine import check as can_refine
from ...core.capture.refine import refine
from ...core.errors import ArtoError, SceneError
from ..shot import paths
from ..stage.bounds import Rendered, rendered
from ..stage.settings import prepare
from ..stage.stage import stage
from ..stage.takes import TAKES, WHOLE, take
from ..work import PLAIN, Batch, Progress, Steps, attempted, looked, of_piece, part_of, strictly
from . import planes, room
from .behind import portals_seen
from .capture import capture
from .check import check_patterns, check_place, check_scene
from .look import SAMPLES
from .patterns import patterns_of
from .planned import ADAPTIVE_SHARE, Given, looked_at, room_for


@contextmanager
def frame_kept(scene: bpy.types.Scene) -> Iterator[None]:
    """Put the scene back to its present frame at the end."""
    frame, part = scene.frame_current, scene.frame_subframe
    try:
        yield
    finally:
        scene.frame_set(frame, subframe=part)


def capture_frames(
    scene: bpy.types.Scene, view_layer: str, frames: Sequence[int], batch: Batch = PLAIN
) -> Steps[list[Path]]:
    """Capture some frames of a shot, each with its field; returns the folders of those captured.

    All frames are looked at first. Frames that are there already, just as they would be captured,
    are passed by, and a frame that was stopped goes on (`capture`). batch: what a failure and a
    warning mean. The scene is put back to its frame. Raises what `capture` raises, and SceneError
    without frames.
    """
    if not frames:
        raise SceneError("there are no frames to capture: give a first and a last one")
    folders: list[Path] = []
    with frame_kept(scene):
        wrong = yield from look(scene, view_layer, frames)
        named = {f"frame {frame}": error for frame, error in wrong.items()}
        yield from looked(named, len(frames), "frames", batch)
        frames = [frame for frame in frames if frame not in wrong]
        steps = together(scene, view_layer, frames)
        given = yield from strictly(steps) if batch.strict else steps
        _check_room(scene, view_layer, given, frames)
        one = 1 / len(frames)
        for i, frame in enumerate(frames):
            scene.frame_set(frame)
            name = f"frame {frame}"
            steps = part_of(capture(scene, view_layer, given, frames), i * one, one, f"{name}: ")
            folder = yield from attempted(of_piece(steps, name), name, i * one, batch)
            folders += [folder] if folder else []
    if not folders:
        raise SceneError("none of the frames could be captured: see what was said of each")
    yield Progress(1.0, f"captured {len(folders)} frames, {len(given.hemicube)} patches each")
    return folders


def look(
    scene: bpy.types.Scene, view_layer: str, frames: Sequence[int], place: bool = True
) -> Steps[dict[int, ArtoError]]:
    """Look at what the capture of some frames needs -> what is wrong, by frame.

    place: whether the captures are written to the shots' own folders. The scene is left at the last
    frame.
    """
    wrong: dict[int, ArtoError] = {}
    for number, frame in enumerate(frames):
        yield Progress(0.0, f"looking at frame {number + 1} of {len(frames)}")
        scene.frame_set(frame)
        try:
            check_scene(scene, view_layer)
            check_patterns(scene)
            if place:
                check_place(scene, view_layer)
            with stage(scene, view_layer) as on:
                rendered(on).bounds()  # raises where the frame shows nothing, or what cannot be
        except ArtoError as e:
            wrong[frame] = e
    return wrong


def _check_room(
    scene: bpy.types.Scene, view_layer: str, given: Given, frames: Sequence[int]
) -> None:
    """Raise SceneError where the disk has no room for all frames that are not there yet."""
    there = paths.frames(scene, view_layer)
    left = sum(not there.get(frame) for frame in frames)
    if left:
        catches = any(thing.is_shadow_catcher for thing in scene.objects)
        takes = 1 + len(TAKES) * catches
        needed = room_for(scene, given).times(takes * left)
        folder = paths.place(scene, view_layer).folder
        room.check_disk(folder, needed.disk, f"the capture of {left} frames")


def together(scene: bpy.types.Scene, view_layer: str, frames: Sequence[int]) -> Steps[Given]:
    """Find the patches for all frames -> `Given`."""
    some = sorted({frames[0], frames[len(frames) // 2], frames[-1]})
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for frame in some:
        scene.frame_set(frame)
        check_scene(scene, view_layer)
        with stage(scene, view_layer) as on:
            seen = rendered(on)
        low, high = np.minimum(low, seen.low), np.maximum(high, seen.high)
    settings = scene.arto
    hemicube = planes.wanted(scene, *Rendered(low, high).bounds())
    if settings.adaptive:
        can_refine(hemicube)
    route, caution, pace, probes = Route(settings.route), None, None, []
    for frame in some:
        scene.frame_set(frame)
        with stage(scene, view_layer) as on, take(there := rendered(on), WHOLE):
            prepare(on, layers=len(patterns_of(settings)) + settings.grain)
            on.portals = portals_seen(on, there)
            here, told, found = yield from looked_at(on, hemicube)
            route = Route.SAMPLED if here == Route.SAMPLED else route
            caution = caution or told
            if found is not None:
                probes.append(found.reshape(len(found), 1, -1, 3))
            pace = on.pace or pace
    if probes and route != Route.SAMPLED:
        every = np.concatenate(probes, axis=2)
        most = ADAPTIVE_SHARE * len(hemicube)
        hemicube = refine(hemicube, every, SAMPLES, most)
    return Given(hemicube, route, caution, pace)
