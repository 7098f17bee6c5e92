"""Whether Python in a .blend may run: as the artist has decided for this session, and else not.

A file can bring Python with it: registered texts, and drivers. Blender runs these only where the
artist allows it, and another Blender that ARTO starts must not allow more.
"""

from __future__ import annotations

import fnmatch
import os
import sys
from pathlib import Path

import bpy

from ...core.errors import SceneError

ALLOWED, REFUSED = "--enable-autoexec", "--disable-autoexec"
# What Blender's command line says about scripts, and what it means.
_SAID = {"-y": ALLOWED, ALLOWED: ALLOWED, "-Y": REFUSED, REFUSED: REFUSED}


def option() -> str:
    """The option that another Blender gets: `ALLOWED` or `REFUSED`.

    Scripts are allowed only where this session was started with them, or the artist's preference
    allows them and names no exception for this file; and nowhere where this session has refused
    one.
    """
    if bpy.app.autoexec_fail:
        return REFUSED
    # what follows a lone -- is another program's
    arguments = sys.argv[: sys.argv.index("--")] if "--" in sys.argv else sys.argv
    if said := [_SAID[a] for a in arguments if a in _SAID]:
        return said[-1]
    paths = bpy.context.preferences.filepaths
    if not paths.use_scripts_auto_execute or _is_excluded(bpy.data.filepath):
        return REFUSED
    return ALLOWED


def check_drivers() -> None:
    """Raise SceneError where Blender has refused a driver's Python since the file was opened: the
    driver gives 0, and the picture would be another one."""
    told = bpy.app.autoexec_fail_message
    if bpy.app.autoexec_fail and told.startswith("Driver"):
        raise SceneError(
            f"this file has a driver by Python that was not run ({told}), as scripts are not "
            "allowed: if you trust the file, turn on Auto Run Python Scripts in the preferences "
            "(Save & Load), else write the driver without Python"
        )


def _is_excluded(blend: str) -> bool:
    """Whether the artist's preferences name the folder of a file as one whose scripts do not run.
    The snapshot that a job works on lies in another folder."""
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
