"""Temporary folders that leave nothing behind, not even where a process is killed."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ...core import marked


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


@contextmanager
def temporary() -> Iterator[Path]:
    """A temporary folder for as long as it is needed."""
    folder = make()
    try:
        yield folder
    finally:
        remove(folder)
