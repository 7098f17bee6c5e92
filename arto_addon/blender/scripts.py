"""Whether Python in a .blend may run: only where the artist has allowed it for this session.

A file can bring Python with it: registered texts, and drivers. Blender runs both only where the
artist allows scripts. Another Blender that ARTO starts must not allow more.
"""

from __future__ import annotations

import fnmatch
import os
import sys
from pathlib import Path
from typing import TypedDict

import bpy

from ...core.errors import SceneError

ALLOWED, REFUSED = "--enable-autoexec", "--disable-autoexec"
# The options of Blender's command line about scripts, in both spellings.
_SAID = {"-y": ALLOWED, ALLOWED: ALLOWED, "-Y": REFUSED, REFUSED: REFUSED}


def option() -> str:
    """The option that another Blender gets: `ALLOWED` or `REFUSED`.

    Where this session has refused a script, the answer is `REFUSED`. Else the session's own command
    line decides. Where the command line says nothing, the artist's preference decides, with its
    exceptions for folders.
    """
    if bpy.app.autoexec_fail:
        return REFUSED
    # Arguments after a lone -- are not Blender's.
    arguments = sys.argv[: sys.argv.index("--")] if "--" in sys.argv else sys.argv
    if said := [_SAID[a] for a in arguments if a in _SAID]:
        return said[-1]
    paths = bpy.context.preferences.filepaths
    if not paths.use_scripts_auto_execute or _is_excluded(bpy.data.filepath):
        return REFUSED
    return ALLOWED


class Quietly(TypedDict, total=False):
    """Options of `subprocess.Popen`."""

    creationflags: int


def quietly() -> Quietly:
    """How another Blender is started: on Windows without a console window that would flash, and
    with a lower priority than the artist's work."""
    return {"creationflags": 0x08000000 | 0x00004000} if sys.platform == "win32" else {}


def check_drivers() -> None:
    """Raise SceneError where Blender has refused a driver's Python since the file was opened.

    The refused driver gives 0, so the picture would be wrong.
    """
    told = bpy.app.autoexec_fail_message
    if bpy.app.autoexec_fail and told.startswith("Driver"):
        raise SceneError(
            f"this file has a driver by Python that was not run ({told}), as scripts are not "
            "allowed: if you trust the file, turn on Auto Run Python Scripts in the preferences "
            "(Save & Load), else write the driver without Python"
        )


def _is_excluded(blend: str) -> bool:
    """Whether the artist's preferences exclude the folder of a .blend from running scripts.

    The window asks this before a job starts. The job itself could not: its snapshot of the .blend
    lies in another folder.
    """
    folder = os.path.normcase(Path(blend).parent) + os.sep if blend else ""
    for excluded in bpy.context.preferences.autoexec_paths:
        path = os.path.normcase(excluded.path)
        if not path or not folder:
            continue
        if excluded.use_glob:
            if fnmatch.fnmatch(folder, path) or fnmatch.fnmatch(blend, path):
                return True
        elif folder.startswith(path.rstrip(os.sep) + os.sep):
            return True
    return False
