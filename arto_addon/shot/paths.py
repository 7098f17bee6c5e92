"""Where the files of a shot are kept.

`//arto/<file>/<scene>/<camera>_<frame>/` holds `shot.json`, the capture set in `capture`, the
field in `field`, and captures that were stopped in `unfinished-...`. Names lead to a folder, and
the `shot.json` in the folder says to which shot the folder belongs. So a renamed scene, file or
camera finds its folder by the scene's ID. The folder of another shot with the same names is left
alone. A copied file does not write into the folder of its original.
"""

from __future__ import annotations

import contextlib
import os
import re
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy

from ...core import marked
from ...core.capture.head import HEADER as CAPTURE_HEADER
from ...core.description import Description
from ...core.errors import ArtoError, SceneError, ShotError
from ...core.field.head import HEADER as FIELD_HEADER
from ...core.files import settle, write_text
from ...core.regular import read_regular
from ...core.shot import Shot
from ...core.signed import text_of
from . import home
from . import scene_id as scene_ids
from .shot import shot_of

HEADER = "shot.json"
_MOST_BYTES = 1 << 20
_SECONDS = 1.0  # A panel looks at the disk again after so many seconds.
_found: dict[tuple[Path, Shot, str], tuple[float, Place]] = {}


@dataclass(frozen=True)
class Place:
    """Where a shot's files are.

    folder: the shot's own folder, to write to; source: the folder to read from, mostly the same;
    owner: the other file or scene that `source` belongs to, in words, or "" (the artist must agree
    before its files are used, see `adopt`); earlier: whether `source` is of an earlier version of
    ARTO, whose folders name no shots.
    """

    folder: Path
    source: Path
    owner: str = ""
    earlier: bool = False

    @property
    def readable(self) -> Path:
        """The folder to read from. Raises ShotError where the folder has another owner."""
        if self.owner:
            raise ShotError(
                f"what is there was captured for {self.owner}: press Use It Here in ARTO's panel "
                "(or --command arto adopt) to work with it here, or capture this shot"
            )
        return self.source


def _root(scene: bpy.types.Scene) -> Path:
    return home.absolute(scene.arto.folder)


def _shot_in(folder: Path) -> tuple[Shot, str] | None:
    """The shot to which a folder belongs, and the captured .blend as a path from the root."""
    path = folder / HEADER
    if not os.path.lexists(path):
        return None
    try:
        said = Description(path, ShotError, _MOST_BYTES)
        return Shot.from_json(said.data.get("shot")), said.kind("blend", str, "")
    except ArtoError:
        # A folder whose shot cannot be read is passed by: nothing is written into it.
        return _DAMAGED, ""


_DAMAGED = Shot("", 0, 0, 0, (), (), scene_id="damaged")


def _is_ours(shot: Shot, there: Shot) -> bool:
    """Whether a folder with the shot's names belongs to the shot. there: the folder's shot."""
    if shot.scene_id is None:
        # The scene has no ID: not captured yet, or not saved since. So the names decide.
        same_names = (shot.file, shot.scene) == (there.file, there.scene)
        return bool(shot.file) and same_names and _with_id(shot, there.scene_id).is_place_of(there)
    return shot.is_place_of(there)


def _with_id(shot: Shot, scene_id: str | None) -> Shot:
    return Shot.from_json({**shot.to_json(), "scene_id": scene_id})


def _anything_in(folder: Path) -> bool:
    heads = (folder / "capture" / CAPTURE_HEADER, folder / "field" / FIELD_HEADER)
    return any(h.is_file() for h in heads) or any(folder.glob("unfinished-*/" + CAPTURE_HEADER))


def _look(root: Path, shot: Shot, origin: bpy.types.Scene | None) -> Place:
    named = root.joinpath(*shot.folders)
    marked = named.with_name(f"{named.name}~{shot.mark}")
    own: Path | None = None
    for folder in (named, marked):
        there = _shot_in(folder)
        if there is None:
            own = own or folder
        elif there[0] is _DAMAGED and _anything_in(folder):
            raise ShotError(
                f"{folder / HEADER} is damaged, and it says whose the captures beside it are: put "
                "a copy of it back; or remove it, if they are this shot's; or move the folder away"
            )
        elif _is_ours(shot, there[0]):
            if _anything_in(folder):
                return Place(folder, folder)
            own = folder
            break
    if own is None:
        own = marked.with_name(f"{marked.name}-{os.urandom(3).hex()}")
    scene_id = origin.arto.scene_id if origin else shot.scene_id
    if scene_id:
        for header in sorted(root.glob(f"*/*/*/{HEADER}")):
            there = _shot_in(header.parent)
            if there is None or not _anything_in(header.parent):
                continue
            was, blend = there
            if not _with_id(shot, scene_id).is_place_of(was):
                continue
            if blend and was.file != shot.file and _is_there(root, blend):
                return Place(own, header.parent, f"the file '{Path(blend).name}'")
            if origin:
                return Place(own, header.parent, f"the scene '{origin.name}'")
            # The file, the scene or the camera was renamed.
            return Place(header.parent, header.parent)
    earlier = root / re.sub(r"[^\w .-]", "_", shot.scene)
    if any((earlier / n / h).is_file() for n, h in _HEADERS):
        return Place(own, earlier, earlier=True)
    return Place(own, own)


def _is_there(root: Path, blend: str) -> bool:
    """Whether a .blend that a description names exists. A path to another machine is followed only
    if the root is on the network too: else Windows could be made to send the artist's name and
    password to any machine."""
    if blend.startswith(("//", "\\\\")) and not str(root).startswith(blend[:2]):
        return False
    return (root / blend).is_file()


_HEADERS = (("capture", CAPTURE_HEADER), ("field", FIELD_HEADER))


def place(scene: bpy.types.Scene, view_layer: str | None = None, fresh: bool = True) -> Place:
    """Find where the files of the scene's shot are.

    fresh: look at the disk even if the last look was a moment ago. Raises SceneError, OSError, and
    ShotError where a folder with this shot's names does not say whose it is.
    """
    root, shot, origin = _root(scene), shot_of(scene, view_layer), scene_ids.copied_from(scene)
    key = root, shot, origin.name if origin else ""
    now = time.monotonic()
    if fresh or key not in _found or now - _found[key][0] > _SECONDS:
        if len(_found) > 100:
            _found.clear()
        _found[key] = now, _look(root, shot, origin)
    return _found[key][1]


def nearest(scene: bpy.types.Scene, view_layer: str | None = None) -> Shot | None:
    """Find the captured shot of the same scene that is most like this one, by view layer, camera
    and frame; for a shot of which nothing was captured. Raises SceneError, OSError."""
    root, shot = _root(scene), shot_of(scene, view_layer)
    found = []
    for header in root.glob(f"*/*/*/{HEADER}"):
        there = _shot_in(header.parent)
        if there and _same_scene(shot, there[0]):
            then = there[0]
            if _anything_in(header.parent) and then.difference(shot):
                alike = (then.view_layer == shot.view_layer) + (then.camera == shot.camera)
                found.append((-alike, abs(then.frame - shot.frame), header, then))
    return min(found, key=lambda f: f[:3])[3] if found else None


def all_in(folder: Path) -> list[tuple[Path, Shot]]:
    """Find the captured shots in a folder: the shot whose own folder it is, or those below."""
    found = []
    for depth in ("", "*/", "*/*/", "*/*/*/"):
        for header in sorted(folder.glob(depth + HEADER)):
            there = _shot_in(header.parent)
            if there and _anything_in(header.parent):
                found.append((header.parent, there[0]))
    return found


def alike(scene: bpy.types.Scene, view_layer: str) -> Path | None:
    """Find captured shots of a scene with this one's name that is not known to be this scene.

    They are of its camera and view layer. Returns the folder of the one shot, or the folder above
    several; None where there are none. Raises SceneError, OSError.
    """
    shot = shot_of(scene, view_layer)
    names = shot.scene, shot.view_layer, shot.camera
    found = [(p, s) for p, s in all_in(_root(scene)) if not _same_scene(shot, s)]
    some = [(p, s) for p, s in found if (s.scene, s.view_layer, s.camera) == names]
    near = [path for path, _ in sorted(some, key=lambda each: abs(each[1].frame - shot.frame))]
    if not near:
        return None
    beside = [path for path in near if path.parent == near[0].parent]
    return near[0] if len(beside) == 1 else near[0].parent


def frames(scene: bpy.types.Scene, view_layer: str) -> dict[float, bool]:
    """Find the frames of which a capture was begun -> by frame, whether there is a field.

    A frame that was asked for together with a captured one counts as begun. Raises SceneError,
    OSError.
    """
    root, shot = _root(scene), shot_of(scene, view_layer)
    found: dict[float, bool] = {}
    for header in root.glob(f"*/*/*/{HEADER}"):
        there = _shot_in(header.parent)
        if not there or not _anything_in(header.parent):
            continue
        then = there[0]
        if not _same_scene(shot, then) or then.view_layer != shot.view_layer:
            continue
        frame = then.frame + (then.subframe or 0.0)
        whole = (header.parent / "field" / FIELD_HEADER).is_file()
        found[frame] = found.get(frame, False) or whole
        for other in _together_with(header.parent):
            found.setdefault(other, False)
    return found


def _same_scene(shot: Shot, there: Shot) -> bool:
    """Whether two shots are of one scene: by its ID, or by names where the scene has none yet."""
    if shot.scene_id:
        return there.scene_id == shot.scene_id
    return bool(shot.file) and (shot.file, shot.scene) == (there.file, there.scene)


def _together_with(folder: Path) -> list[int]:
    """The frames that were to be captured together with the one in a shot's folder."""
    try:
        said = Description(folder / HEADER, ShotError, _MOST_BYTES).kind("frames", list, [])
    except ArtoError:
        return []
    return [frame for frame in said if type(frame) is int]


def shown(scene: bpy.types.Scene) -> str:
    """The shot's folder as a panel shows it; empty where there is none."""
    try:
        folder = place(scene, fresh=bpy.app.background).folder
        return home.relative(folder)
    except (ArtoError, OSError, ValueError):  # ValueError: the folder is on another drive.
        return ""


def capture_folder(scene: bpy.types.Scene, view_layer: str | None = None) -> Path:
    """The folder of the capture set to read. Raises SceneError; ShotError for another's folder."""
    return _settled(place(scene, view_layer).readable / "capture")


def field_folder(scene: bpy.types.Scene, view_layer: str | None = None) -> Path:
    """The folder of the field to read. Raises SceneError; ShotError for another's folder."""
    return _settled(place(scene, view_layer).readable / "field")


def _settled(folder: Path) -> Path:
    """Put a folder back to its name, if a process was killed while replacing it."""
    try:
        settle(folder)
    except OSError as e:
        raise SceneError(f"{folder} cannot be put back ({e}): look at its permissions") from e
    return folder


def unfinished_folder(folder: Path, key: str) -> Path:
    """The folder in which a capture grows until it is complete. key: the capture's."""
    return folder / f"unfinished-{key[:8]}"


def claim(scene: bpy.types.Scene, view_layer: str, together: Sequence[int] = ()) -> Path:
    """Make the shot's own folder, mark it as the shot's, and return it.

    together: the frames that are captured as one sequence, to be noted down. Raises SceneError.
    """
    root, folder = _root(scene), place(scene, view_layer).folder
    home.check_outside(folder.parent, "captures")
    there = _shot_in(folder)
    if scene_ids.of(scene) is None:
        # The shot's names led here, or the folder is new.
        scene_ids.give(scene, there[0].scene_id if there else None)
    shot, blend = shot_of(scene, view_layer), home.file()
    try:
        relative = os.path.relpath(blend, root) if blend else ""
    except ValueError:  # The .blend is on another drive.
        relative = blend
    about: dict[str, object] = {
        "shot": shot.to_json(),
        "blend": Path(relative).as_posix() if relative else "",
    }
    if len(together) > 1:
        about["frames"] = list(together)
    text = text_of(about)
    try:
        path = folder / HEADER
        if not _says(path, text):
            write_text(path, text)
    except OSError as e:
        raise SceneError(
            f"{folder} cannot be written ({e}): make room on the disk, or choose another folder "
            "in ARTO's settings"
        ) from e
    _found.clear()
    return folder


def _says(path: Path, text: str) -> bool:
    """Whether a file has this text already."""
    with contextlib.suppress(OSError):
        return read_regular(path, _MOST_BYTES) == text.encode()
    return False


def worlds_folder(scene: bpy.types.Scene) -> Path:
    """The folder of the maps of worlds, which all shots share."""
    return _root(scene) / "worlds"


def draft_folder(folder: Path) -> Path:
    """The folder of the draft of a capture that is not complete, in the folder of its shot."""
    return folder / "draft"


def remove_draft(folder: Path) -> None:
    """Remove the draft from the folder of a shot whose capture is complete, or is given up.

    A draft that cannot be removed is of no capture any more, so nobody looks at it.
    """
    marked.remove_quietly(draft_folder(folder), "field", folder)


def forget() -> None:
    """Forget what the disk looked like, so that the next question looks again."""
    _found.clear()
