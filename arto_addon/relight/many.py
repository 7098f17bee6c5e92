"""Many lights at once: files of worlds, a turntable, frames. What hangs on no light is shared."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

import bpy

from ...core.errors import CaptureSetError, SceneError
from ...core.relight import together
from ...core.shot import safe_name
from ..blender.nodes import new_world
from ..capture.sequence import frame_kept
from ..plate.present import present_frames
from ..shot import paths
from ..shot.shot import check_same_shot, shot_of
from ..work import Progress, Render, Steps, retold
from ..world.check import check_world
from ..world.dials import turned
from .relight import finish, make_ready
from .shown import Light, Ready, Shown


def relight_many(
    scene: bpy.types.Scene,
    view_layer: str,
    worlds: Sequence[Path] = (),
    turns: int = 1,
    frames: Sequence[int] = (),
) -> Steps:
    """Show a shot in many lights; returns the paths of the pictures.

    worlds: environment maps to take in the place of the scene's world; turns: so many pictures of
    each, turned about the vertical from one to the next, once around; frames: of an animated world,
    or of the shot where its frames were captured. Pictures are named after map, and numbered by
    turn or frame. Raises what `relight.compute` raises; the scene is put back to its frame.
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
            # at this frame: the output may have its number in it
            base = paths.relit_file(scene)
            numbered = frames and paths.numbers_frames(scene)
            every = [(file, turn) for file in worlds or [None] for turn in range(turns)]
            most = max(1, together(still.field) // len(still.takes))
            for first in range(0, len(every), most):
                # the field is read once for so many lights
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
    """Raise SceneError where a file of a world is missing, or two pictures had one name."""
    names: dict[str, Path] = {}
    for file in worlds:
        if not file.is_file():
            raise SceneError(f"there is no environment map {file}")
        # no difference to Windows and macOS
        name = safe_name(file.stem).casefold()
        if name in names:
            raise SceneError(
                f"{names[name]} and {file} would be written to one picture: give one of them "
                "another name, or relight them one after the other"
            )
        names[name] = file


def _check_frames(scene: bpy.types.Scene, view_layer: str, frames: Sequence[int]) -> None:
    """Raise CaptureSetError where some frames of a shot were captured and others of the sequence
    were not: an animated world over a still is of one captured frame."""
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


def _quietly(steps: Steps, share: float) -> Steps:
    """The steps but for what they say: said once for all, it would be lost among them."""

    def change(step: Progress | Render) -> Render | None:
        if isinstance(step, Progress):
            return None
        step.share = share
        return step

    return retold(steps, change)


def _lent(
    lent: ExitStack, scene: bpy.types.Scene, view_layer: str, file: Path | None, turn: float
) -> bpy.types.World | None:
    """The world of a picture, for as long as it is lent; None for the scene's own.

    turn: of the whole circle.
    """
    world = lent.enter_context(_world_showing(file)) if file else None
    if turn:
        world = lent.enter_context(turned(world or check_world(scene, view_layer), turn * math.tau))
    return world


def relight_frames(scene: bpy.types.Scene, view_layer: str, frames: Sequence[int]) -> Steps:
    """Relight the frames of a shot, or of an animated world over a still, and show them as a
    sequence in the compositor; returns their paths. Raises as `relight_many`."""
    done = yield from relight_many(scene, view_layer, frames=frames)
    present_frames(scene, done[0], frames)
    return done


def frames_of(scene: bpy.types.Scene) -> range:
    """The frames that the scene renders."""
    return range(scene.frame_start, scene.frame_end + 1, scene.frame_step)


def _named(base: Path, file: Path | None, number: int | None) -> Path:
    """The name of one of many pictures: `shot_sunset_0001.exr`."""
    parts = [base.stem, *([safe_name(file.stem)] if file else [])]
    parts += [f"{number:04d}"] if number is not None else []
    return base.with_name("_".join(parts) + ".exr")


def _shown(scene: bpy.types.Scene, view_layer: str, still: Shown | None) -> Shown:
    """The field of the scene's frame; where none was captured, that of the still before it."""
    folder = paths.field_folder(scene, view_layer)
    if folder.exists():
        found = Shown(scene, view_layer, folder)
        check_same_shot(scene, found.field.about.shot, "the reflectance field", view_layer)
        return found
    now = shot_of(scene, view_layer)
    near = paths.nearest(scene, view_layer)
    if still is None and near is None:
        return Shown(scene, view_layer)  # which says what to do
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
