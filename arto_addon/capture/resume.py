"""Going on with a capture that was stopped, and putting a finished one in its place."""

from __future__ import annotations

import contextlib
import shutil
from pathlib import Path
from typing import Any

from ...core.capture_set import HEADER, CaptureSet
from ...core.errors import ArtoError, CaptureSetError
from ...core.files import PART, replace_folder


def unfinished(folder: Path, key: str) -> dict[str, Any] | None:
    """The description of the very same capture, left unfinished, to go on with."""
    if (folder / HEADER).is_file():
        with contextlib.suppress(ArtoError):
            there = CaptureSet(folder, unfinished=True).head
            if there.get("key") == key:
                # what a process that was killed was writing
                for partial in folder.glob("*" + PART):
                    partial.unlink(missing_ok=True)
                return there
    return None


def empty(folder: Path) -> None:
    try:
        if folder.exists():
            shutil.rmtree(folder)
    except OSError as e:
        raise CaptureSetError(f"{folder} cannot be emptied ({e}): choose another folder") from e


def finish(unfinished: Path, folder: Path) -> None:
    """Put the complete capture set where the last one is."""
    try:
        replace_folder(unfinished, folder)
    except OSError as e:
        raise CaptureSetError(
            f"{unfinished} is complete but cannot take the place of {folder} ({e}): close what "
            "uses that folder and capture again, no render is repeated"
        ) from e
