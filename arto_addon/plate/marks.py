"""By what a file of a plate is known: only such files are written over or removed.

Each file that ARTO writes of a plate names the plate in its header. A file of that name without
this mark is somebody else's: the artist's footage, an HDRI, a texture.
"""

from __future__ import annotations

import os
from pathlib import Path

from ...core import exr
from ...core.errors import ArtoError, SceneError
from ...core.file_names import is_text, same_file
from ...core.mix.stamp import is_own
from ...core.photographs import png_file
from ...core.regular import read_regular

# The attribute in the header of each file of a plate that names the plate's own file.
PLATE = "arto.plate"
# Attributes that files of earlier versions have, which do not name their plate.
_OF_EARLIER = ("arto.light key", "arto.verify")
# The text in a PNG file that lists what a contact sheet shows.
SHEET = "arto.sheet"
# What the names of files beside a plate end with.
ENDINGS = ("catcher", "light", "layers", "data", "comp", "verify", "samples", "finished")
# What the names of scripts for compositors beside a plate end with; no script is as long as that.
SCRIPTS, _LONG = (".nk", ".comp"), 1 << 22


def is_of(path: Path, plate: Path) -> bool:
    """Whether ARTO has written a file beside a plate, by what the file's header says."""
    if path.suffix in SCRIPTS:
        return path.stem == plate.stem and is_own_script(path)
    if path.suffix.lower() == ".png":
        return is_sheet(path)
    head = _header(path)
    if PLATE in head:
        return str(head[PLATE]) == plate.name
    # the names of layers' own files are the artist's: another plate may have such a name
    named = any(path.stem == f"{plate.stem}_{e}" for e in (*ENDINGS, "full"))
    named = named or any(path.stem == f"{plate.stem}_{e}_full" for e in ENDINGS)
    return named and any(name in head for name in _OF_EARLIER)


def is_marked(path: Path) -> bool:
    """Whether ARTO has written a picture or a script, of whatever plate."""
    if path.suffix in SCRIPTS:
        return is_own_script(path)
    if path.suffix.lower() == ".png":
        return is_sheet(path)
    head = _header(path)
    return PLATE in head or any(name in head for name in _OF_EARLIER)


def is_own_script(path: Path) -> bool:
    """Whether a script for a compositor is as ARTO has written it."""
    try:
        return is_own(read_regular(path, _LONG).decode("utf-8"))
    except (OSError, ValueError):
        return False


def is_sheet(path: Path) -> bool:
    """Whether a PNG file is a contact sheet that ARTO has written."""
    try:
        return SHEET in png_file.texts(path)
    except OSError:
        return False


def _header(path: Path) -> dict[str, object]:
    """The header of a file; empty where the file is no EXR file."""
    try:
        return exr.header(path) if path.is_file() else {}
    except ArtoError:
        return {}


def in_the_way(path: Path, plate: Path) -> str:
    """Say why a file of a plate may not be written to a path; "" where it may.

    An empty file is in nobody's way, and neither is a link that leads nowhere.
    """
    if not path.exists():
        return ""
    if not path.is_file():
        return f"{path} is no file"
    if not path.stat().st_size:
        return ""
    head = _header(path)
    if not is_marked(path):
        return f"{path} is there, and ARTO has not written it"
    other = path.with_name(str(head.get(PLATE, plate.name)))
    # a plate that was renamed or copied by hand still has its old name in its header
    if same_file(path, plate) or same_file(other, plate) or not other.is_file():
        return ""
    return f"{path} belongs to another plate, {other.name}"


def check(path: Path, plate: Path, overwrite: bool) -> None:
    """Raise SceneError where a file of a plate would be written over what is not that plate's.

    overwrite: whether the artist wants that.
    """
    if not is_text(path):
        raise SceneError(
            f"the name {str(path)!a} is not written in UTF-8, so no EXR file can have it: choose "
            "another output"
        )
    if overwrite and not (os.path.lexists(path) and path.is_dir()):
        return
    if why := in_the_way(path, plate):
        raise SceneError(
            f"{why}: choose another output, or move the file away (Write Over Other "
            "Files, --overwrite, writes over it)"
        )
