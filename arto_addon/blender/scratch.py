"""Temporary folders that leave nothing behind, not even where a process is killed."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ...core import marked
from ...core.errors import ExrError, FilesError


def make() -> Path:
    """Make a temporary folder. What killed processes have left of theirs is removed first.

    Raises OSError where there is no room for it.
    """
    folder = marked.scratch(Path(tempfile.gettempdir()) / "arto", "temporary")
    folder.chmod(0o700)
    return folder


def remove(folder: Path) -> None:
    """Remove a temporary folder with all that is in it."""
    marked.remove_quietly(folder, "temporary", folder.parent)


# A disk with fewer bytes left is full: what was written last filled it.
LEAST = 2**20


@contextmanager
def temporary() -> Iterator[Path]:
    """A temporary folder for as long as it is needed.

    Raises FilesError in place of an error of what was written there, where its disk is full:
    Blender does not tell that it wrote a file by a part only.
    """
    folder = make()
    try:
        yield folder
    except ExrError as e:
        if shutil.disk_usage(folder).free >= LEAST:
            raise
        raise FilesError(
            f"the disk of the folder for temporary files, {folder.parent}, is full: make room on "
            "it, or name a folder on another disk by TMPDIR (on Windows TEMP), and start this again"
        ) from e
    finally:
        remove(folder)
