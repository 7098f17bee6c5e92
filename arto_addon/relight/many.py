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

from ...core.errors import CaptureSetError, SceneError
from ...core.file_names import safe_name
from ...core.relight import together
from ..blender.nodes import new_world
from ..capture.sequence import frame_kept
from ..plate.names import numbers_frames, relit_file
from ..plate.present import present_frames
from ..shot import paths
from ..shot.shot import check_same_shot, shot_of
from ..work import Progress, Render, Steps, retold
from ..world.check import check_world
from ..world.dials import turned
from .relight import finish, make_ready
from .shown import Light, Ready, Shown

_Made = TypeVar("_Made")


def relight_many(
    scene: bpy.types.Scene,
    view_layer: str,
    worlds: Sequence[Path] = (),
    turns: int = 1,
    frames: Sequence[int] = (),
) -> Steps[list[Path]]:
    """Show a shot in many lights; returns the paths of the pictures.

    worlds: environment maps that replace the scene's world, one after another; turns: the number of
    pictures for each world, which turns once around the vertical in equal steps; frames: the frames
    to show, of a captured sequence or of an animated world over a still.

    The pictures are named after their map and numbered by turn or frame. The scene is put back to
    its frame. Raises what `relight.compute` raises.
    """
    if turns > 1 and frames:
        raise SceneError("a turntable is of one frame: leave one of the two out")
    _check_worlds(worlds)
    scene.view_layers[view_layer].update()
    _check_frames(scene, view_layer, frames)
    done: list[Path] = []
    total = max(len(worlds), 1) * max(turns, len(frames), 1)
    still = None if frames else _shown(scene, view_layer, None)
    with frame_kept(scene):
        for frame in frames or [scene.frame_current]:
            if frames:
                scene.frame_set(frame)
                scene.view_layers[view_layer].update()
                still = _shown(scene, view_layer, still)
            assert still is not None
            # worked out at each frame: the path may contain the frame's number
            base = relit_file(scene)
            numbered = frames and numbers_frames(scene)
            every = [(file, turn) for file in worlds or [None] for turn in range(turns)]
            most = max(1, together(still.field) // len(still.takes))
            for first in range(0, len(every), most):
                # read the field once for all lights that fit into memory together
                with ExitStack() as lent:
                    ready: list[Ready] = []
                    for file, turn in every[first : first + most]:
                        number = frame if frames else turn + 1 if turns > 1 else None
                        number = None if numbered else number
                        path = _named(base, file, number)
                        world = _lent(lent, scene, view_layer, file, turn / turns)
                        look = file.stem if file else scene.arto.look
                        text = f"picture {len(done) + len(ready) + 1} of {total}: {path.name}"
                        yield Progress(len(done) / total, text)
                        steps = make_ready(still, Light(path, look, world))
                        ready.append((yield from _quietly(steps, len(done) / total)))
                    pictures = still.pictures([r.light for r in ready])
                    while ready:
                        one = ready.pop(0)
                        one.laps.go_on()
                        steps = finish(still, one, pictures.pop(0))
                        yield from _quietly(steps, len(done) / total)
                        done.append(one.lit.path)
    yield Progress(1.0, f"wrote {len(done)} pictures, the last one {done[-1]}")
    return done


def _check_worlds(worlds: Sequence[Path]) -> None:
    """Raise SceneError where a world's file is missing, or two pictures would have one name."""
    names: dict[str, Path] = {}
    for file in worlds:
        if not file.is_file():
            raise SceneError(f"there is no environment map {file}")
        # Windows and macOS do not tell upper from lower case in names
        name = safe_name(file.stem).casefold()
        if name in names:
            raise SceneError(
                f"{names[name]} and {file} would be written to one picture: give one of them "
                "another name, or relight them one after the other"
            )
        names[name] = file


def _check_frames(scene: bpy.types.Scene, view_layer: str, frames: Sequence[int]) -> None:
    """Raise CaptureSetError where only some of the frames were captured.

    With one captured frame the shot is a still, and its world may be animated.
    """
    begun = paths.frames(scene, view_layer)
    there = sorted(frame for frame, whole in begun.items() if whole)
    missing = [frame for frame in frames if frame not in there]
    if not missing or not there or (len(begun) == 1 and len(there) == 1):
        return
    known = ", ".join(f"{n:g}" for n in there[:10])
    some = ", ".join(str(frame) for frame in missing[:10]) + (", ..." if missing[10:] else "")
    raise CaptureSetError(
        f"of this shot the frames {known} are captured, and {some} not, "
        "or not to the end: capture these too (--frames), or discard what is unfinished"
    )


def _quietly(steps: Steps[_Made], share: float) -> Steps[_Made]:
    """Run the steps of one picture without their messages, which would be lost among many."""

    def change(step: Progress | Render) -> Render | None:
        if isinstance(step, Progress):
            return None
        step.share = share
        return step

    return retold(steps, change)


def _lent(
    lent: ExitStack, scene: bpy.types.Scene, view_layer: str, file: Path | None, turn: float
) -> bpy.types.World | None:
    """The world of a picture, which `lent` removes again; None for the scene's own world.

    turn: as a share of the whole circle.
    """
    world = lent.enter_context(_world_showing(file)) if file else None
    if turn:
        world = world or check_world(scene, view_layer)
        world = lent.enter_context(turned(scene, view_layer, world, turn * math.tau))
    return world


def relight_frames(
    scene: bpy.types.Scene, view_layer: str, frames: Sequence[int]
) -> Steps[list[Path]]:
    """Relight frames and show them as a sequence in the compositor; returns the pictures' paths.

    The frames are those of a captured sequence, or of an animated world over a still. Raises what
    `relight_many` raises.
    """
    done = yield from relight_many(scene, view_layer, frames=frames)
    present_frames(scene, done[0], frames)
    return done


def frames_of(scene: bpy.types.Scene) -> range:
    """The frames that an animation render of the scene has."""
    return range(scene.frame_start, scene.frame_end + 1, scene.frame_step)


def _named(base: Path, file: Path | None, number: int | None) -> Path:
    """The path of one of many pictures, as in `shot_sunset_0001.exr`."""
    parts = [base.stem, *([safe_name(file.stem)] if file else [])]
    parts += [f"{number:04d}"] if number is not None else []
    return base.with_name("_".join(parts) + ".exr")


def _shown(scene: bpy.types.Scene, view_layer: str, still: Shown | None) -> Shown:
    """Open the field of the scene's frame; of the still, where this frame was not captured."""
    folder = paths.field_folder(scene, view_layer)
    if folder.exists():
        found = Shown(scene, view_layer, folder)
        check_same_shot(scene, found.field.about.shot, "the reflectance field", view_layer)
        return found
    now = shot_of(scene, view_layer)
    near = paths.nearest(scene, view_layer)
    if still is None and near is None:
        return Shown(scene, view_layer)  # raises an error that says what to do
    if still is None:
        assert near is not None
        with frame_kept(scene):
            scene.frame_set(near.frame)
            still = Shown(scene, view_layer, paths.field_folder(scene, view_layer))
    was = still.field.about.shot or now
    if difference := replace(was, frame=now.frame, subframe=now.subframe).difference(now):
        raise CaptureSetError(
            f"frame {now.frame} was not captured, and differs from frame {was.frame} by "
            f"{difference}: capture it too (--frames)"
        )
    return still


@contextmanager
def _world_showing(file: Path) -> Iterator[bpy.types.World]:
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
