"""What ARTO may remove: only folders and files that say of themselves that ARTO has made them.

A folder that ARTO makes holds a mark, `arto-folder.json`, from the moment that the folder is there.
Every removal in the project goes through this module. It looks for the mark first, and touches
nothing where the mark is missing, where it is of another kind or version, where the folder is a
link, or where it lies outside the folder that the caller works in.

A folder of the version before has no mark. It is known by its own description, and only while it
holds nothing but what ARTO writes there.

Examples
--------
>>> import tempfile
>>> with tempfile.TemporaryDirectory() as folder:
...     made = make(Path(folder) / "job", "job")
...     theirs = Path(folder) / "renders"
...     theirs.mkdir()
...     new_file(theirs / "comp.nk")
...     remove(made, "job", Path(folder))
...     (made.exists(), is_ours(theirs))
(False, False)
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import stat
import time
from collections.abc import Callable
from pathlib import Path
from typing import Literal, get_args

from . import before
from .errors import FilesError
from .regular import PART, cut, host, is_folder, json_object, moved, new_file, unique

MARK = "arto-folder.json"
OLD = ".old"
FORMAT = "ARTO folder"
VERSION = 1
# capture: a capture set; field: a reflectance field; tile: a tile of one; take: a take of a shot;
# job: what the window gives a second Blender; part: a part of a farm's job; temporary: what is
# needed for a moment only, in the machine's folder for that.
Kind = Literal["capture", "field", "tile", "take", "job", "part", "temporary"]

# No mark is longer.
_MOST = 1 << 16
KINDS: tuple[Kind, ...] = get_args(Kind)
# A week, in seconds.
_FORGOTTEN = 7 * 86400.0


def mark(folder: Path, kind: Kind) -> None:
    """Write a mark into a folder that ARTO has made, unless it has one.

    A folder that holds files of others gets no mark, so it is never removed.

    Parameters
    ----------
    folder : Path
    kind : str

    Raises
    ------
    OSError
        The folder cannot be written.
    """
    if _marked_as(folder) == kind or not is_ours(folder):
        return
    text = json.dumps({"format": FORMAT, "version": VERSION, "kind": kind})
    partial = folder / unique(MARK)
    new_file(partial)
    try:
        partial.write_text(text, encoding="utf-8")
        moved(partial, folder / MARK)
    except BaseException:
        with contextlib.suppress(OSError):
            partial.unlink()
        raise


def make(folder: Path, kind: Kind) -> Path:
    """Make a new folder with its mark.

    Parameters
    ----------
    folder : Path
        Missing folders above it are made without marks.
    kind : str

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    OSError
        The folder cannot be made, or it is there already.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    folder.mkdir()
    mark(folder, kind)
    return folder


def scratch(beside: Path, kind: Kind) -> Path:
    """Make a new folder with a mark beside a path, with a name of its own.

    The folder is filled, and then takes the place of the path (`files.replace_folder`).

    Parameters
    ----------
    beside : Path
    kind : str

    Returns
    -------
    Path

    Raises
    ------
    OSError
        The folder cannot be made.
    """
    remove_leftovers(beside)
    return make(beside.with_name(unique(beside.name)), kind)


def is_ours(folder: Path, kind: Kind | None = None) -> bool:
    """Say whether ARTO has made a folder.

    A link is not ARTO's. An empty folder counts as ARTO's: nothing can be lost with it.

    Parameters
    ----------
    folder : Path
    kind : str, optional
        The kind that it must be of; any kind by default.

    Returns
    -------
    bool
    """
    with contextlib.suppress(OSError):
        if is_folder(folder) and not any(folder.iterdir()):
            return True
    found = kind_of(folder)
    return found is not None and kind in (None, found)


def kind_of(folder: Path) -> Kind | None:
    """Say of what kind a folder is that ARTO has made.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    str or None
        None for a folder that ARTO has not made, and for a link.
    """
    if not is_folder(folder):
        return None
    if (folder / MARK).exists():
        return _marked_as(folder)
    with contextlib.suppress(OSError):
        return next((kind for kind in KINDS if before.is_one(folder, kind)), None)
    return None


def remove(folder: Path, kind: Kind, inside: Path) -> None:
    """Remove a folder that ARTO has made, with all that is in it.

    Links in the folder are removed, and what they lead to stays. A missing folder is no error.

    Parameters
    ----------
    folder : Path
    kind : str
        The kind that the folder must be of.
    inside : Path
        The folder that the caller works in. `folder` must lie in it.

    Raises
    ------
    FilesError
        ARTO has not made the folder, or it lies elsewhere. Then nothing has been touched.
    OSError
        The folder cannot be removed.
    """
    if not os.path.lexists(folder):
        return
    check(folder, kind, inside)
    with contextlib.suppress(OSError):
        mark(folder, kind)  # of the version before; where there is no room, what goes makes some
    # The mark goes last: what a killed process leaves of the folder is still known.
    for there in [path for path in folder.iterdir() if path.name != MARK]:
        if is_folder(there):
            shutil.rmtree(there)
        else:
            there.unlink()
    (folder / MARK).unlink(missing_ok=True)
    folder.rmdir()


def remove_empty(folder: Path) -> None:
    """Remove a folder that holds nothing but its mark; any other folder stays.

    Parameters
    ----------
    folder : Path

    Raises
    ------
    OSError
        The folder cannot be removed.
    """
    if is_folder(folder) and {there.name for there in folder.iterdir()} <= {MARK}:
        (folder / MARK).unlink(missing_ok=True)
        folder.rmdir()


def remove_quietly(folder: Path, kind: Kind, inside: Path) -> bool:
    """Remove a folder as `remove` does, or leave it where it cannot be removed.

    Parameters
    ----------
    folder : Path
    kind : str
    inside : Path

    Returns
    -------
    bool
        Whether nothing of that name is left.
    """
    with contextlib.suppress(OSError, FilesError):
        remove(folder, kind, inside)
    return not os.path.lexists(folder)


def check(folder: Path, kind: Kind | None, inside: Path) -> None:
    """Make sure that ARTO has made a folder, and that the folder lies in another one.

    Parameters
    ----------
    folder : Path
    kind : str or None
        The kind that the folder must be of; None for any.
    inside : Path

    Raises
    ------
    FilesError
        ARTO has not made the folder, or it lies elsewhere.
    """
    # where it really is: a link on the way may lead out
    lies_in = folder.parent.resolve().is_relative_to(inside.resolve())
    if folder.name in ("", "..") or not lies_in:
        raise FilesError(f"{folder} is not in {inside}, so ARTO does not touch it")
    if not is_ours(folder, kind):
        raise FilesError(
            f"{folder} was not made by ARTO (it has no mark that says so), so ARTO leaves "
            "it: move it away, or choose another folder"
        )


def remove_file(path: Path, kind: Kind | None = None) -> None:
    """Remove a file from a folder that ARTO has made. A missing file is no error.

    Parameters
    ----------
    path : Path
    kind : str, optional
        The kind that the folder must be of; any kind by default.

    Raises
    ------
    FilesError
        ARTO has not made the folder.
    OSError
        The file cannot be removed.
    """
    if not os.path.lexists(path):
        return
    if not is_ours(path.parent, kind):
        raise FilesError(f"{path.parent} was not made by ARTO, so ARTO removes nothing in it")
    path.unlink()


def remove_own_file(path: Path, is_own: Callable[[Path], bool]) -> bool:
    """Remove a regular file if its content shows that ARTO has written it.

    Parameters
    ----------
    path : Path
    is_own : callable
        Says of the path whether ARTO has written the file.

    Returns
    -------
    bool
        Whether the file is gone.

    Raises
    ------
    OSError
        The file cannot be read or removed.
    """
    own = stat.S_ISREG(path.lstat().st_mode) and is_own(path)
    if own:
        path.unlink()
    return own


def remove_leftovers(path: Path) -> None:
    """Remove what killed processes have left beside a path.

    These are files and marked folders with a name that `unique` made of the path's name, in a
    process of this machine that has ended. A marked folder of another machine is removed after a
    week.

    Parameters
    ----------
    path : Path
    """
    _remove_left(path.parent, re.compile(re.escape(cut(path.name)) + _UNIQUE))


def sweep(folder: Path) -> None:
    """Remove what killed processes have left in a folder of ARTO's, see `remove_leftovers`.

    Parameters
    ----------
    folder : Path
        A folder of somebody else stays as it is, and so do the folders in it.
    """
    if not is_ours(folder):
        return
    _remove_left(folder, re.compile(".+" + _UNIQUE))
    with contextlib.suppress(OSError):
        for there in [path for path in folder.iterdir() if path.is_dir()]:
            sweep(there)


# How the names end that `unique` makes: the machine, the process and a random number.
_UNIQUE = r"\.([0-9a-f]{8})-(\d{1,10})-[0-9a-f]{16}" + re.escape(PART)


def _remove_left(folder: Path, form: re.Pattern[str]) -> None:
    with contextlib.suppress(OSError):
        for there in folder.iterdir():
            if not (found := form.fullmatch(there.name)):
                continue
            here = found[1] == host()
            if here and _lives(int(found[2])):
                continue
            state = there.lstat()
            if here and stat.S_ISREG(state.st_mode):
                there.unlink(missing_ok=True)
            elif (here or time.time() - state.st_mtime > _FORGOTTEN) and (kind := kind_of(there)):
                remove_quietly(there, kind, there.parent)


def _lives(process: int) -> bool:
    if os.name == "nt":  # a signal of 0 would end the process there, so nobody asks
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True


def _marked_as(folder: Path) -> Kind | None:
    """The kind that a folder's mark says; None where it has no mark of this version."""
    said = json_object(folder / MARK, _MOST)
    if said.get("format") != FORMAT or said.get("version") != VERSION:
        return None
    return next((kind for kind in KINDS if kind == said.get("kind")), None)
