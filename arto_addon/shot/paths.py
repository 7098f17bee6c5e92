"""Where what belongs to a shot is kept.

`//arto/<file>/<scene>/<camera>_<frame>/` holds `shot.json`, the capture set in `capture`, the
field in `field`, and captures that were stopped in `unfinished-...`. Names lead to a folder; whose
it is, its `shot.json` says. So a renamed scene, file or camera finds its folder by the scene's ID,
another's folder of the same name is left alone, and a copy of a file does not write into the
folder of the file it was copied from.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import time
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
from ...core.shot import Shot, safe_name, short_hash
from ..stage.takes import TAKES
from . import home
from . import scene_id as scene_ids
from .shot import shot_of

HEADER = "shot.json"
_MOST_BYTES = 1 << 20
# Endings that an output may have by habit: what is written is EXR.
_PICTURES = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".hdr"}
_SECONDS = 1.0  # for which a panel need not look at the disk again
_found: dict[tuple[Path, Shot, str], tuple[float, Place]] = {}


@dataclass(frozen=True)
class Place:
    """Where a shot's files are.

    folder: its own, to write to; source: where what is there already is read from, mostly the
    same; owner: whose that is where it is another file's or scene's, in words, and must be asked
    for (`adopt`); earlier: whether it was written by the version before, which named no shots.
    """

    folder: Path
    source: Path
    owner: str = ""
    earlier: bool = False

    @property
    def readable(self) -> Path:
        """Where to read from. Raises ShotError where that is another's."""
        if self.owner:
            raise ShotError(
                f"what is there was captured for {self.owner}: press Use It There in ARTO's panel "
                "(or --command arto adopt) to work with it here, or capture this shot"
            )
        return self.source


def _root(scene: bpy.types.Scene) -> Path:
    return home.absolute(scene.arto.folder)


def _shot_in(folder: Path) -> tuple[Shot, str] | None:
    """The shot whose folder this is and the .blend it was captured from, as seen from the root."""
    path = folder / HEADER
    if not os.path.lexists(path):
        return None
    try:
        said = Description(path, ShotError, _MOST_BYTES)
        return Shot.from_json(said.data.get("shot")), said.kind("blend", str, "")
    except ArtoError:
        # a folder whose shot cannot be read is nobody's: it is passed by, not written into
        return Shot("", 0, 0, 0, (), (), scene_id="damaged"), ""


def _is_ours(shot: Shot, there: Shot) -> bool:
    """Whether a folder that the shot's names lead to is the shot's own."""
    if shot.scene_id is None:
        # not captured yet in this session, or never saved since: the names must do
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
            # the file, the scene or the camera has another name now
            return Place(header.parent, header.parent)
    earlier = root / re.sub(r"[^\w .-]", "_", shot.scene)
    if any((earlier / n / h).is_file() for n, h in _HEADERS):
        return Place(own, earlier, earlier=True)
    return Place(own, own)


def _is_there(root: Path, blend: str) -> bool:
    """Whether a .blend that a description names is there. A machine of the network is not asked for
    what a file names: on Windows that would tell it the artist's name and password."""
    if blend.startswith(("//", "\\\\")) and not str(root).startswith(blend[:2]):
        return False
    return (root / blend).is_file()


_HEADERS = (("capture", CAPTURE_HEADER), ("field", FIELD_HEADER))


def place(scene: bpy.types.Scene, view_layer: str | None = None, fresh: bool = True) -> Place:
    """Where the files of the scene's shot are.

    fresh: look at the disk, also where it was looked at a moment ago. Raises SceneError, OSError.
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
    """A shot of the same scene that something was captured of, for one that nothing was: of the
    same camera or frame, if there is one. Raises SceneError, OSError."""
    root, shot = _root(scene), shot_of(scene, view_layer)
    found = []
    for header in root.glob(f"*/*/*/{HEADER}"):
        there = _shot_in(header.parent)
        if there and shot.scene_id and there[0].scene_id == shot.scene_id:
            then = there[0]
            if _anything_in(header.parent) and then.difference(shot):
                alike = (then.view_layer == shot.view_layer) + (then.camera == shot.camera)
                found.append((-alike, abs(then.frame - shot.frame), header, then))
    return min(found, key=lambda f: f[:3])[3] if found else None


def frames(scene: bpy.types.Scene, view_layer: str) -> dict[float, bool]:
    """The frames of the scene's shots that a capture was begun of, and whether there is a field of
    each. Raises SceneError, OSError."""
    root, shot = _root(scene), shot_of(scene, view_layer)
    found: dict[float, bool] = {}
    for header in root.glob(f"*/*/*/{HEADER}"):
        there = _shot_in(header.parent)
        if not there or not shot.scene_id:
            continue
        then = there[0]
        if (then.scene_id, then.view_layer) != (shot.scene_id, shot.view_layer):
            continue
        frame = then.frame + (then.subframe or 0.0)
        whole = (header.parent / "field" / FIELD_HEADER).is_file()
        found[frame] = found.get(frame, False) or whole
    return found


def shown(scene: bpy.types.Scene) -> str:
    """The shot's folder for a panel, empty where there is none."""
    try:
        folder = place(scene, fresh=bpy.app.background).folder
        return bpy.path.relpath(str(folder)) if bpy.data.filepath else str(folder)
    except (ArtoError, OSError, ValueError):  # on another drive too
        return ""


def capture_folder(scene: bpy.types.Scene, view_layer: str | None = None) -> Path:
    """The capture set to read. Raises SceneError; ShotError where it is another's."""
    return _settled(place(scene, view_layer).readable / "capture")


def field_folder(scene: bpy.types.Scene, view_layer: str | None = None) -> Path:
    """The field to read. Raises SceneError; ShotError where it is another's."""
    return _settled(place(scene, view_layer).readable / "field")


def _settled(folder: Path) -> Path:
    """The folder, back at its name where a process was killed while it was being replaced."""
    try:
        settle(folder)
    except OSError as e:
        raise SceneError(f"{folder} cannot be put back ({e}): look at its permissions") from e
    return folder


def unfinished_folder(folder: Path, key: str) -> Path:
    """Where a capture grows. It takes the place of the finished one only when it is complete."""
    return folder / f"unfinished-{key[:8]}"


def claim(scene: bpy.types.Scene, view_layer: str) -> Path:
    """The shot's own folder, made and marked as its own; for writing. Raises SceneError."""
    root, folder = _root(scene), place(scene, view_layer).folder
    there = _shot_in(folder)
    if scene_ids.of(scene) is None:
        # its names led here, or it is new
        scene_ids.give(scene, there[0].scene_id if there else None)
    shot, blend = shot_of(scene, view_layer), home.file()
    try:
        relative = os.path.relpath(blend, root) if blend else ""
    except ValueError:  # another drive
        relative = blend
    about = {"shot": shot.to_json(), "blend": Path(relative).as_posix() if relative else ""}
    text = json.dumps(about)
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
    """Whether a file has that text already."""
    with contextlib.suppress(OSError):
        return read_regular(path, _MOST_BYTES) == text.encode()
    return False


def worlds_folder(scene: bpy.types.Scene) -> Path:
    """Where maps of worlds are kept, for all shots."""
    return _root(scene) / "worlds"


def forget() -> None:
    """Look at the disk again."""
    _found.clear()


def adopt(scene: bpy.types.Scene, view_layer: str, source: Path) -> Path:
    """Take what is in `source` for this shot too; returns the shot's own folder.

    The files are shared where the disk can, which costs nothing: they are never changed, only
    replaced. Raises SceneError.
    """
    folder = claim(scene, view_layer)
    for name in _KINDS:
        if (source / name).is_dir() and not (folder / name).exists():
            partial: Path | None = None
            try:
                partial = marked.scratch(folder / name, _KINDS[name])
                _share(source / name, partial)
                partial.rename(folder / name)
            except OSError as e:
                if partial:
                    marked.remove_quietly(partial, _KINDS[name], folder)
                raise SceneError(f"{source / name} cannot be taken over ({e}): make room") from e
    _found.clear()
    return folder


# What of a shot may be another's too.
_KINDS: dict[str, marked.Kind] = {
    "capture": "capture",
    "field": "field",
    **dict.fromkeys(TAKES, "take"),
}


def _share(source: Path, target: Path) -> None:
    def link(a: str, b: str) -> str:
        try:
            os.link(a, b)
        except OSError:
            shutil.copy2(a, b)
        return b

    marks = shutil.ignore_patterns(marked.MARK)  # the target has its own
    shutil.copytree(source, target, copy_function=link, ignore=marks, dirs_exist_ok=True)


def relit_name(scene: bpy.types.Scene, look: str | None = None) -> str:
    """What tells this scene's plate from those of other scenes and looks, empty for the only one.

    The image is then `ARTO <scene> <look>`, the file `<blend>_<scene>_<look>.exr`.
    """
    shown: str = scene.arto.look.strip() if look is None else look
    if not shown and len(bpy.data.scenes) == 1:
        return ""
    name = f"{scene.name} {shown}".strip()
    others = [s.name for s in bpy.data.scenes if s != scene]
    # 'A B' under the look C, 'A' under the look B C
    if any(name.startswith(f"{other} ") for other in others) or shown == _PLAIN:
        name += f"~{short_hash(scene.name, shown)}"
    return name


_PLAIN = "relit"  # a plate's ending without a look
# How names of files end that stand beside a plate; numbers are those of frames.
_BESIDE = re.compile(
    r"(^|_)(catcher|light|layers|data|comp|composite|world|full|verify|\d{4,})$", re.IGNORECASE
)
_HASHES = re.compile(r"([._-]?)(#+)(?=[^#]*$)")


def _of_look(look: str) -> str:
    """What of a file's name is a look's. One that is called as what stands beside the plate of
    another has a mark, so that neither is written over the other."""
    name = safe_name(look)
    return f"{name}~{short_hash(look)}" if _BESIDE.search(name) else name


def _numbered(stem: str, frame: int) -> tuple[re.Match[str] | None, str]:
    """Where a file's name has hashes, with what parts them from it, and what stands there at a
    frame: as many digits as there are hashes."""
    mark = _HASHES.search(stem)
    return (mark, f"{mark[1]}{frame:0{len(mark[2])}d}") if mark else (None, "")


def numbers_frames(scene: bpy.types.Scene) -> bool:
    """Whether the output has a place for the frame's number."""
    return bool(scene.arto.output) and bool(_HASHES.search(Path(scene.arto.output).stem))


def relit_file(scene: bpy.types.Scene, look: str | None = None) -> Path:
    """The plate's EXR. look: that it is of (default: the scene's now). Raises SceneError for a
    .blend that was never saved."""
    look = scene.arto.look.strip() if look is None else look
    name = relit_name(scene, look)
    mark = f"~{name.rpartition('~')[2]}" if "~" in name else ""
    if scene.arto.output:
        path = home.absolute(scene.arto.output)
        if scene.arto.output.endswith(("/", "\\")):
            path = path / (Path(home.file()).stem or _PLAIN)
        if path.suffix.lower() in _PICTURES:
            path = path.with_suffix(".exr")
        elif path.suffix.lower() != ".exr":  # a version or a dot of the name's own
            path = path.with_name(path.name + ".exr")
        # a copied scene has the output of the one it was copied from
        shared = any(s.arto.output == scene.arto.output for s in bpy.data.scenes if s != scene)
        parts = [*([safe_name(scene.name)] if shared else []), *([_of_look(look)] if look else [])]
        # hashes are the frame's number, which is what stands last in a name
        stem, mark, number = path.stem, *_numbered(path.stem, scene.frame_current)
        if mark:
            stem = stem[: mark.start()] + "".join(f"_{part}" for part in parts) + number
            return path.with_name(stem + path.stem[mark.end() :] + ".exr")
        return path.with_name("_".join([stem, *parts]) + ".exr")
    if not home.file():
        raise SceneError(
            "this .blend was never saved, so the relit picture has no place to go: save it, or "
            "set ARTO's output to an absolute path"
        )
    blend = Path(home.file())
    parts = [safe_name(scene.name), _of_look(look or _PLAIN)] if name else [_PLAIN]
    return blend.with_name("_".join([blend.stem, *parts]) + mark + ".exr")
