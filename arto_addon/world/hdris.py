"""HDRIs on disk: whether a file is one, and where they are."""

from __future__ import annotations

from pathlib import Path

import bpy

from ...core import picture_files
from ...core.errors import SceneError
from .check import world_of
from .controls import hdri

# Endings of the files that are offered as HDRIs.
ENDINGS = (".exr", ".hdr", ".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp")
# How files of these kinds begin.
_BEGINNINGS = (
    b"\x76\x2f\x31\x01", b"#?", b"\x89PNG", b"\xff\xd8\xff", b"II*\x00", b"MM\x00*", b"II+\x00",
    b"MM\x00+", b"RIFF",
)  # fmt: skip


def check(path: Path) -> None:
    """Raise SceneError where a file is no picture: Blender itself takes any file for one."""
    try:
        with path.open("rb") as file:
            begins = file.read(8)
    except OSError as e:
        raise SceneError(f"{path} cannot be read ({e.strerror}): choose an HDRI") from e
    if not begins.startswith(_BEGINNINGS):
        raise SceneError(f"{path.name} is no picture: choose an HDRI ({', '.join(ENDINGS[:2])})")
    if picture_files.is_cut_file(path):
        raise SceneError(f"{path.name} is cut off: copy it anew, or choose another")


def folder(scene: bpy.types.Scene) -> str:
    """The folder to look for an HDRI in: that of the world's, else that of the .blend."""
    world = world_of(scene)
    image = hdri(world) if world else None
    if image is not None and image.filepath:
        path = Path(bpy.path.abspath(image.filepath, library=image.library))
        if path.parent.is_dir():
            return str(path.parent)
    return str(Path(bpy.data.filepath).parent) if bpy.data.filepath else str(Path.home())
