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
from ...core.errors import SceneError
from ..stage.bounds import Rendered, rendered
from ..stage.settings import prepare
from ..stage.stage import stage
from ..stage.takes import WHOLE, take
from ..work import Progress, Steps, part_of
from . import planes, probe
from .capture import capture
from .check import check_scene
from .patterns import patterns_of
from .planned import ADAPTIVE_SHARE, Given, light_route


@contextmanager
def frame_kept(scene: bpy.types.Scene) -> Iterator[None]:
    """Put the scene back to its present frame at the end."""
    frame, part = scene.frame_current, scene.frame_subframe
    try:
        yield
    finally:
        scene.frame_set(frame, subframe=part)


def capture_frames(
    scene: bpy.types.Scene, view_layer: str, frames: Sequence[int]
) -> Steps[list[Path]]:
    """Capture some frames of a shot, each with its field; returns their folders.

    Finished frames are captured again; a frame that was stopped goes on (`capture`). The scene is
    put back to its frame. Raises what `capture` raises, and SceneError without frames.
    """
    if not frames:
        raise SceneError("there are no frames to capture: give a first and a last one")
    folders: list[Path] = []
    one = 1 / len(frames)
    with frame_kept(scene):
        given = yield from together(scene, view_layer, frames)
        for i, frame in enumerate(frames):
            scene.frame_set(frame)
            steps = capture(scene, view_layer, given=given)
            folders.append((yield from part_of(steps, i * one, one, f"frame {frame}: ")))
    yield Progress(1.0, f"captured {len(frames)} frames, {len(given.hemicube)} patches each")
    return folders


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
    route, caution, probes = Route(settings.route), None, []
    for frame in some:
        scene.frame_set(frame)
        with stage(scene, view_layer) as on, take(rendered(on), WHOLE):
            prepare(on, layers=len(patterns_of(settings)) + settings.grain)
            here, told = yield from light_route(on, hemicube)
            route = Route.SAMPLED if here == Route.SAMPLED else route
            caution = caution or told
            if settings.adaptive and route != Route.SAMPLED:
                found = yield from probe.probed(on, hemicube)
                probes.append(found.reshape(len(found), 1, -1, 3))
    if probes and route != Route.SAMPLED:
        every = np.concatenate(probes, axis=2)
        most = ADAPTIVE_SHARE * len(hemicube)
        hemicube = refine(hemicube, every, probe.SAMPLES, most)
    return Given(hemicube, route, caution)
