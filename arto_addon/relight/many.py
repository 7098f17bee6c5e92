"""Many lights at once: files of worlds, a turntable, frames.

Work that is the same for all lights, such as reading the field, is done once.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import bpy

from ...core.errors import ArtoError, SceneError
from ...core.relight import together
from ..blender.nodes import new_world
from ..capture.sequence import frame_kept
from ..plate.present import present_frames
from ..work import PLAIN, Batch, Progress, Steps, failed, looked, tried
from ..world.check import check_world
from ..world.dials import turned
from . import ahead
from .ahead import Wanted
from .relight import finish, make_ready
from .shown import Light, Ready, Shown

_Made = TypeVar("_Made")


def relight_many(
    scene: bpy.types.Scene,
    view_layer: str,
    worlds: Sequence[Path] = (),
    turns: int = 1,
    frames: Sequence[int] = (),
    batch: Batch = PLAIN,
) -> Steps[list[Path]]:
    """Show a shot in many lights; returns the paths of the pictures that were made.

    worlds: environment maps that replace the scene's world, one after another; turns: the number of
    pictures for each world, which turns once around the vertical in equal steps; frames: the frames
    to show, of a captured sequence or of an animated world over a still; batch: what a failure and
    a warning mean.

    All that the pictures need is looked at first, see `ahead`. The pictures are named after their
    map and numbered by turn or frame. The scene is put back to its frame. Raises what
    `relight.compute` raises.
    """
    if turns < 1:
        raise SceneError(f"a turntable of {turns} pictures cannot be: give 1 or more")
    if turns > 1 and frames:
        raise SceneError("a turntable is of one frame: leave one of the two out")
    scene.view_layers[view_layer].update()
    pictures = ahead.wanted(scene, worlds, turns, frames)
    wrong = yield from ahead.look(scene, view_layer, pictures, batch.strict)
    named = {one.path.name: error for one, error in wrong.items()}
    yield from looked(named, len(pictures), "pictures", batch)
    left = [one for one in pictures if one not in wrong]
    whole = not wrong and not worlds and turns == 1 and len(frames) > 1
    # a sequence of every second frame is none that other programs can be told of
    ends = (frames[0], frames[-1]) if whole and frames[-1] - frames[0] == len(frames) - 1 else None
    left[:1] = [replace(one, frames=ends) for one in left[:1]]
    done = yield from made(scene, view_layer, left, batch)
    if not done:
        raise SceneError("none of the pictures could be made: see what was said of each")
    yield Progress(1.0, f"wrote {len(done)} pictures, the last one {done[-1]}")
    return done


def made(
    scene: bpy.types.Scene, view_layer: str, pictures: Sequence[Wanted], batch: Batch
) -> Steps[list[Path]]:
    """Make pictures that were looked at, those of a frame together -> the paths of those made."""
    done: list[Path] = []
    begun, total, still = 0, len(pictures), None
    with frame_kept(scene):
        for frame in dict.fromkeys(one.frame for one in pictures):
            some = [one for one in pictures if one.frame == frame]
            if frame is not None:
                scene.frame_set(frame)
                scene.view_layers[view_layer].update()
            try:
                still = ahead.shown_at(scene, view_layer, still)
            except ArtoError as e:
                yield from failed([one.path.name for one in some], e, begun / total, batch)
                begun += len(some)
                continue
            most = max(1, together(still.field) // len(still.takes))
            for first in range(0, len(some), most):
                lights = some[first : first + most]
                done += yield from _group(still, lights, begun, total, batch)
                begun += len(lights)
    return done


def _group(
    shown: Shown, lights: Sequence[Wanted], begun: int, total: int, batch: Batch
) -> Steps[list[Path]]:
    """Make pictures whose lights fit into memory together -> the paths of those that were made.

    The field is read once for all of them. begun: how many of all pictures were begun before.
    """
    done: list[Path] = []
    with ExitStack() as lent:
        ready: list[Ready] = []
        for number, one in enumerate(lights, begun):
            yield Progress(begun / total, f"picture {number + 1} of {total}: {one.path.name}")
            steps = tried(_prepared(lent, shown, one), one.path.name, begun / total, batch)
            if found := (yield from steps):
                ready.append(found)
        try:
            pictures = shown.pictures([r.light for r in ready]) if ready else []
        except ArtoError as e:
            names = [r.lit.path.name for r in ready]
            yield from failed(names, e, begun / total, batch)
            return done
        while ready:
            one = ready.pop(0)
            one.laps.go_on()
            share = (begun + len(done)) / total
            path = one.lit.path
            steps = finish(shown, one, pictures.pop(0))
            if (yield from tried(steps, path.name, share, batch)) is not None:
                done.append(path)
    return done


def _prepared(lent: ExitStack, shown: Shown, one: Wanted) -> Steps[Ready]:
    """Make the light of a picture ready -> `Ready`. lent: removes the picture's world again."""
    scene = shown.scene
    world = lit_by(lent, scene, shown.layer, one)
    look = one.file.stem if one.file else scene.arto.look if one.look is None else one.look
    return (yield from make_ready(shown, Light(one.path, look, world, one.frames)))


def lit_by(
    lent: ExitStack, scene: bpy.types.Scene, view_layer: str, one: Wanted
) -> bpy.types.World | None:
    """The world of a picture; None for the scene's own. lent: removes what is made for it again."""
    world = lent.enter_context(world_showing(one.file)) if one.file else one.world
    if one.turn:
        world = world or check_world(scene, view_layer)
        world = lent.enter_context(turned(scene, view_layer, world, one.turn * math.tau))
    return world


def relight_frames(
    scene: bpy.types.Scene, view_layer: str, frames: Sequence[int], batch: Batch = PLAIN
) -> Steps[list[Path]]:
    """Relight frames and show them as a sequence in the compositor; returns the pictures' paths.

    The frames are those of a captured sequence, or of an animated world over a still; batch: see
    `relight_many`. Raises what `relight_many` raises.
    """
    done = yield from relight_many(scene, view_layer, frames=frames, batch=batch)
    present_frames(scene, done[0], frames)
    return done


def frames_of(scene: bpy.types.Scene) -> range:
    """The frames that an animation render of the scene has."""
    return range(scene.frame_start, scene.frame_end + 1, scene.frame_step)


@contextmanager
def world_showing(file: Path) -> Iterator[bpy.types.World]:
    """A world that shows an environment map from a file. Raises SceneError."""
    if not file.is_file():
        raise SceneError(f"there is no environment map {file}")
    made: list[bpy.types.ID] = []
    try:
        try:
            image = bpy.data.images.load(str(file))
        except RuntimeError as e:
            raise SceneError(f"{file} cannot be read ({e}): choose an HDRI") from e
        made.append(image)
        world = new_world(file.stem)
        made.append(world)
        nodes = world.node_tree.nodes
        texture = nodes.new("ShaderNodeTexEnvironment")
        texture.image = image
        world.node_tree.links.new(texture.outputs[0], nodes["Background"].inputs["Color"])
        yield world
    finally:
        bpy.data.batch_remove(made)
