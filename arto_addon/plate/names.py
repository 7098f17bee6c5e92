"""The names of plates: which image and which file is the relit picture of a scene and a look.

No two scenes of a file and no two looks of a scene share a name.
"""

from __future__ import annotations

import re
from pathlib import Path

import bpy

from ...core.errors import SceneError
from ...core.file_names import safe_name, short_hash
from ..shot import home
from ..shot.scene_id import is_alone

# Endings that an artist may give to an output by habit: .exr takes their place.
_PICTURES = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".hdr"}
_PLAIN = "relit"  # The ending of a plate's name where there is no look.
# Endings of the names of files beside a plate. Numbers are those of frames.
_BESIDE = re.compile(
    r"(^|_)(catcher|light|layers|data|comp|composite|world|full|verify|samples|finished|sequence"
    r"|match|\d{4,})$",
    re.IGNORECASE,
)
_HASHES = re.compile(r"([._-]?)(#+)(?=[^#]*$)")


def relit_name(scene: bpy.types.Scene, look: str | None = None) -> str:
    """The name by which this scene's plate differs from those of other scenes and looks; empty for
    the scene that is alone (`scene_id.is_alone`), without a look.

    The image is then `ARTO <scene> <look>`, the file `<blend>_<scene>_<look>.exr`.
    """
    shown: str = scene.arto.look.strip() if look is None else look
    if not shown and is_alone(scene):
        return ""
    name = f"{scene.name} {shown}".strip()
    others = [s.name for s in bpy.data.scenes if s != scene]
    # Scene 'A B' with the look 'C' and scene 'A' with the look 'B C' would have the same name.
    if any(name.startswith(f"{other} ") for other in others) or shown == _PLAIN:
        name += f"~{short_hash(scene.name, shown)}"
    return name


def of_look(look: str) -> str:
    """The part of a file's name that stands for a look or a world.

    Where it is named like an ending, such as `layers`, the part gets a digest, so that no plate is
    written over another's layers.
    """
    name = safe_name(look)
    return f"{name}~{short_hash(look)}" if _BESIDE.search(name) else name


def _numbered(stem: str, frame: int) -> tuple[re.Match[str] | None, str]:
    """Find the hashes in a file's name with the separator before them, and the text for both: the
    frame's number, in as many digits as there are hashes. (None, "") without hashes."""
    mark = _HASHES.search(stem)
    return (mark, f"{mark[1]}{frame:0{len(mark[2])}d}") if mark else (None, "")


def has_number(path: Path) -> bool:
    """Whether a file's name has hashes, which stand for a frame's number."""
    return bool(_HASHES.search(path.stem))


def at_frame(path: Path, frame: int) -> Path:
    """The path with a frame's number in place of the hashes in its name."""
    mark, number = _numbered(path.stem, frame)
    if mark is None:
        return path
    return path.with_name(
        path.stem[: mark.start()] + number + path.stem[mark.end() :] + path.suffix
    )


def numbers_frames(scene: bpy.types.Scene) -> bool:
    """Whether the name of the output has a place for the frame's number."""
    return bool(scene.arto.output) and has_number(Path(scene.arto.output))


def relit_file(scene: bpy.types.Scene, look: str | None = None, frame: int | None = None) -> Path:
    """The path of a plate's EXR.

    look, frame: the plate's (default: the scene's now). Raises SceneError where the path depends on
    a .blend that was never saved, or is a folder.
    """
    at: int = scene.frame_current if frame is None else frame
    look = scene.arto.look.strip() if look is None else look
    name = relit_name(scene, look)
    mark = f"~{name.rpartition('~')[2]}" if "~" in name else ""
    if scene.arto.output:
        path = home.absolute(scene.arto.output)
        if scene.arto.output.endswith(("/", "\\")):
            path = path / (Path(home.file()).stem or _PLAIN)
        elif path.name in ("", "..") or (path.is_dir() and path.suffix.lower() != ".exr"):
            raise SceneError(
                f"{path} is a folder: end it with / to write into it, or name a file (.exr)"
            )
        if path.suffix.lower() in _PICTURES:
            path = path.with_suffix(".exr")
        elif path.suffix.lower() != ".exr":  # The dot belongs to the name, as in `shot.v2`.
            path = path.with_name(path.name + ".exr")
        # A copied scene has the output of its original, so the scene's name tells them apart.
        others = [s for s in bpy.data.scenes if s != scene and not is_alone(scene)]
        shared = any(s.arto.output == scene.arto.output for s in others)
        parts = [*([safe_name(scene.name)] if shared else []), *([of_look(look)] if look else [])]
        # Hashes stand for the frame's number, which stays last in the name.
        stem, mark, number = path.stem, *_numbered(path.stem, at)
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
    parts = [safe_name(scene.name), of_look(look or _PLAIN)] if name else [_PLAIN]
    return blend.with_name("_".join([blend.stem, *parts]) + mark + ".exr")
