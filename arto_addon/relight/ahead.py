"""Looking ahead: what would end a relight later is found before its first second of work.

Fields, worlds, frames, footage, Cryptomattes, names of files and room on the disk are looked at for
all pictures that were asked for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import bpy

from ...core.capture.head import HEADER as CAPTURE_HEADER
from ...core.errors import ArtoError, CaptureSetError, SceneError, StrictError
from ...core.file_names import folded
from ..blender import denoise
from ..capture.sequence import frame_kept
from ..plate import mattes, plate
from ..plate.names import numbers_frames, of_look, relit_file
from ..shot import paths, status
from ..shot.shot import check_same_shot, shot_of
from ..work import Progress, Steps
from ..world.check import check_file, check_images, check_world, differs_by_rays
from ..world.images import held_images
from .inputs import inputs
from .outputs import bytes_of, check_picture, check_room
from .shown import Shown, check_film

# Said in a warning, and in the header of the plate.
NO_DENOISER = "no: this Blender was built without Open Image Denoise"
GLASS = "opaque: what is seen through it is in it, whatever Transparent Glass says"
TINTED = (
    "where the ground of a shadow catcher is seen through glass, a render over an opaque film "
    "counts the glass twice, and is darker there: the relit picture counts it once"
)
PORTALS = (
    "what the world lights by way of a Ray Portal may have 2% less light than in a render, which "
    "counts a world's light by portals otherwise on shadow rays"
)


@dataclass(frozen=True)
class Wanted:
    """A picture that is to be made.

    path: of its EXR; frame: None for the scene's present one; file: an environment map in the
    place of the scene's world, or None; turn: of a turntable, as a share of the whole circle;
    frames: of a sequence whose first picture this is, first and last;
    look, world: a look's name and its world, None for the scene's own.
    """

    path: Path
    frame: int | None = None
    file: Path | None = None
    turn: float = 0.0
    frames: tuple[int, int] | None = None
    look: str | None = None
    world: bpy.types.World | None = None


def wanted(
    scene: bpy.types.Scene,
    worlds: Sequence[Path],
    turns: int,
    frames: Sequence[int],
    camera: str = "",
) -> list[Wanted]:
    """List the pictures of some worlds, of a turntable or of frames, in the order of the work.

    Each is named after its camera and its map, and numbered by turn or frame. camera: another one
    than the scene's. Raises SceneError where the pictures have no place to go.
    """
    out = []
    for frame in frames or [None]:
        base = relit_file(scene, frame=frame)
        for file in worlds or [None]:
            for turn in range(turns):
                number = frame if frame is not None else turn + 1 if turns > 1 else None
                if frame is not None and numbers_frames(scene):
                    number = None  # it is in the name already
                path = _named(base, file, number, camera)
                out.append(Wanted(path, frame, file, turn / turns))
    return out


def wanted_looks(scene: bpy.types.Scene, frames: Sequence[int], camera: str = "") -> list[Wanted]:
    """List the pictures of the scene's looks, at its present frame or at frames, as `wanted` does.

    A look's picture at a frame is the one that a relight of that frame makes while the look is
    shown. Raises SceneError where the pictures have no place to go.
    """
    out = []
    for frame in frames or [None]:
        number = None if numbers_frames(scene) else frame
        for look in scene.arto.looks:
            if look.world:
                path = _named(relit_file(scene, look.name, frame), None, number, camera)
                out.append(Wanted(path, frame, look=look.name, world=look.world))
    return out


def _named(base: Path, file: Path | None, number: int | None, camera: str = "") -> Path:
    """The path of one of many pictures, as in `shot_sunset_0001.exr`."""
    parts = [base.stem, *([of_look(camera)] if camera else [])]
    parts += [of_look(file.stem)] if file else []
    parts += [f"{number:04d}"] if number is not None else []
    return base.with_name("_".join(parts) + ".exr")


def look(
    scene: bpy.types.Scene, view_layer: str, pictures: Sequence[Wanted], strict: bool
) -> Steps[dict[Wanted, ArtoError]]:
    """Look at all that some pictures need -> what is wrong, an ArtoError by picture.

    The scene is put back to its frame. strict: whether the scene may not have changed since the
    capture.
    """
    wrong = same_names(pictures)
    wrong |= {p: e for p in pictures if p.file and p not in wrong and (e := _map(p.file))}
    missing = missing_frames(scene, view_layer, [p.frame for p in pictures if p.frame is not None])
    read = inputs(scene, [p.file for p in pictures if p.file])
    still = None
    needed: dict[Path, int] = {}
    rendered: dict[Path, int] = {}
    with frame_kept(scene):
        for number, frame in enumerate(every := list(dict.fromkeys(p.frame for p in pictures))):
            some = [p for p in pictures if p.frame == frame and p not in wrong]
            try:
                if frame is not None:
                    if len(every) > 1:
                        yield Progress(0.0, f"looking at frame {number + 1} of {len(every)}")
                    scene.frame_set(frame)
                    scene.view_layers[view_layer].update()
                    if frame in missing:
                        raise missing[frame]
                still = shown_at(scene, view_layer, still)
                _check_mattes(still, rendered)
                own = any(p.file is None and p.world is None for p in some)
                check_frame(still, own, strict)
            except ArtoError as e:
                wrong |= dict.fromkeys(some, e)
                continue
            for one in some:
                try:
                    if one.world:
                        check_images(one.world, scene.frame_current)
                    check_picture(still, one.path, read)
                    needed[one.path] = bytes_of(still)
                except ArtoError as e:
                    wrong[one] = e
    try:
        check_room(needed)
    except ArtoError as e:
        wrong |= {p: e for p in pictures if p not in wrong}
    return wrong


def same_names(pictures: Sequence[Wanted]) -> dict[Wanted, ArtoError]:
    """Find pictures that would be written over another one -> what is wrong, by picture."""
    by_name: dict[str, list[Wanted]] = {}
    for one in pictures:
        by_name.setdefault(folded(one.path), []).append(one)
    wrong: dict[Wanted, ArtoError] = {}
    for same in by_name.values():
        if len(same) > 1:
            files = " and ".join(str(p.file or p.path) for p in same[:3])
            error = SceneError(
                f"{files} would be written to one picture, {same[0].path.name}: give one of them "
                "another name, or relight them one after the other"
            )
            wrong |= dict.fromkeys(same, error)
    return wrong


def _map(file: Path) -> ArtoError | None:
    """What is wrong with the file of an environment map."""
    if not file.is_file():
        return SceneError(f"there is no environment map {file}")
    try:
        check_file(file, "the environment map")
    except SceneError as e:
        return e
    return None


def missing_frames(
    scene: bpy.types.Scene, view_layer: str, frames: Sequence[int]
) -> dict[int, ArtoError]:
    """Frames that were not captured, or not to the end, of a shot of which several frames were.

    With one captured frame the shot is a still, and its world may be animated.
    """
    begun = paths.frames(scene, view_layer)
    there = sorted(frame for frame, whole in begun.items() if whole)
    missing = [frame for frame in frames if frame not in there]
    if not missing or not there or (len(begun) == 1 and len(there) == 1):
        return {}
    known = ", ".join(f"{n:g}" for n in there[:10])
    some = ", ".join(str(frame) for frame in missing[:10]) + (", ..." if missing[10:] else "")
    error = CaptureSetError(
        f"of this shot the frames {known} are captured, and {some} not, "
        "or not to the end: capture these too (--frames), or discard what is unfinished"
    )
    return dict.fromkeys(missing, error)


def shown_at(scene: bpy.types.Scene, view_layer: str, still: Shown | None) -> Shown:
    """Open the field of the scene's frame; of the still, where this frame was not captured.

    still: what this function returned for an earlier frame. Raises what `Shown` raises.
    """
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


def _check_mattes(shown: Shown, rendered: dict[Path, int]) -> None:
    """Raise SceneError where one file of Cryptomattes is named for several captured frames.

    rendered: the frame by the file, for those that were looked at before; added to.
    """
    path, shot = mattes.file_of(shown.scene, shown.field), shown.field.about.shot
    if path and shot and rendered.setdefault(path, shot.frame) != shot.frame:
        raise SceneError(
            f"{path} is named for frame {rendered[path]} and for frame {shot.frame}: write #### "
            "for the frame's number in Cryptomatte"
        )


def check_looks(shown: Shown, looks: Mapping[str, tuple[Path, bpy.types.World]]) -> None:
    """Look at all that the pictures of some looks need.

    looks: the path of the picture, and the world, by the look's name. Raises ArtoError.
    """
    check_frame(shown, own_world=False, strict=False)
    by_path: dict[str, str] = {}
    for name, (path, world) in looks.items():
        if (other := by_path.setdefault(folded(path), name)) != name:
            raise SceneError(
                f"the looks '{other}' and '{name}' would be written to one picture, {path.name}: "
                "give one of them another name"
            )
        check_picture(shown, path)
        check_images(world, shown.scene.frame_current)


def check_frame(shown: Shown, own_world: bool, strict: bool) -> None:
    """Look at what all pictures of a frame need, besides their own files.

    own_world: whether the scene's own world is shown. Raises ArtoError.
    """
    scene = shown.scene
    for take in shown.takes:
        take.field.has_layer("alpha")  # raises where a tile is missing or damaged
    plate.window_of(scene).check(shown.field.shape)
    check_film(scene, shown.field)
    shown.footage_warning()
    shown.mattes()
    if own_world:
        check_images(check_world(scene, shown.layer), scene.frame_current)
    if strict:
        world = check_world(scene, shown.layer) if own_world else None
        if said := warnings(shown, world):
            raise StrictError(f"{said[0]} (a warning, and with --strict that is an error)")


def warnings(shown: Shown, world: bpy.types.World | None) -> list[str]:
    """What to warn of before a picture is made, in words. world: that lights it."""
    scene, out = shown.scene, []
    if changed := shown.changed():
        # a warning, not an error: only the artist knows whether the change shows
        out.append(f"the scene is not the captured one: {'; '.join(changed[:3])}")
    beside = shown.field.folder.parent / "capture" / CAPTURE_HEADER
    captured, key = status.capture_at(beside), shown.field.about.key
    if captured and key and captured.head.key not in (None, key):
        out.append("the reflectance field is of an earlier capture than the newest one: fit again")
    if world and (held := held_images(world, scene.frame_current)):
        out.append(held)
    if world and (by_rays := differs_by_rays(world)):
        out.append(f"the world is {by_rays}")
    if said := shown.footage_warning():
        out.append(said)
    if scene.arto.denoise and not denoise.available():
        out.append(f"denoising: {NO_DENOISER}")
    if scene.render.film_transparent and scene.cycles.film_transparent_glass:
        out.append(f"glass: {GLASS}")
    through, clear = shown.field.through(), scene.render.film_transparent
    if len(shown.takes) > 1 and not clear and through is not None:
        out.append(TINTED)
    if shown.field.about.portals is not None:
        out.append(PORTALS)
    missing = [name for name in plate.DATA if not shown.field.has_layer(name)]
    if scene.arto.write_data and missing:
        lacks = f"the data file has no {', '.join(missing)}"
        out.append(f"{lacks}: it was not captured; capture again to have it")
    return out
