"""Go on with a capture that was stopped, and put a finished capture in its place."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from ...core import marked
from ...core.capture import head as heads
from ...core.capture.capture_set import CaptureSet
from ...core.capture.head import HEADER, CaptureHead
from ...core.errors import ArtoError, CaptureSetError, FieldError
from ...core.field.field import Field
from ...core.field.head import FieldHead
from ...core.field.writer import write_head
from ...core.files import PART, replace_folder
from ...core.fit.fit import about_of
from .stream import Stream


def unfinished(folder: Path, key: str) -> CaptureHead | None:
    """The head of an unfinished capture with the same key; None where there is none."""
    if (folder / HEADER).is_file():
        with contextlib.suppress(ArtoError):
            there = CaptureSet(folder, unfinished=True).head
            if there.key == key:
                # remove the file that a killed process was writing
                for partial in folder.glob("*" + PART):
                    marked.remove_file(partial, "capture")
                return there
    return None


def empty(folder: Path) -> None:
    """Remove a capture set. Raises FilesError where it was not made by ARTO, CaptureSetError."""
    with _removing(folder):
        marked.remove(folder, "capture", folder.parent)


def empty_take(folder: Path) -> None:
    """Remove ARTO's files from a take's folder, and the folder itself if it is then empty.

    Raises CaptureSetError.
    """
    if not marked.is_folder(folder):
        return
    with _removing(folder):
        for there in list(folder.iterdir()):
            if (kind := marked.kind_of(there)) in ("capture", "field"):
                marked.remove(there, kind, folder)
            else:
                marked.remove_empty(there)
        marked.remove_empty(folder)


@contextlib.contextmanager
def _removing(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as e:
        raise CaptureSetError(f"{folder} cannot be emptied ({e}): choose another folder") from e


def finish(unfinished: Path, folder: Path) -> None:
    """Replace the last capture set by the complete new set."""
    try:
        replace_folder(unfinished, folder)
    except OSError as e:
        raise CaptureSetError(
            f"{unfinished} is complete but cannot take the place of {folder} ({e}): close what "
            "uses that folder and capture again, no render is repeated"
        ) from e


def let_go(
    folder: Path, head: CaptureHead, number: int, fitted: Mapping[str, object]
) -> CaptureHead:
    """Note down that a tile was fitted, then remove its basis images -> the new head."""
    files = head.tiles[number].files
    head = head.with_tile(number, files=(), seeds=(), sums={}, fitted=fitted)
    heads.write(folder, head)
    for name in files:
        marked.remove_file(folder / name, "capture")
    _describe(folder / Stream.FIELD, head, draft=True)
    return head


def _describe(partial: Path, head: CaptureHead, draft: bool | None = None) -> None:
    """Write the description of the field of those tiles of a capture that are fitted.

    draft: whether some are missing: Live shows those that are there.
    """
    fitted = [tile.fitted for tile in head.tiles if tile.fitted is not None]
    about = replace(about_of(head, *head.told_choice), draft=draft)
    described = FieldHead(head.hemicube, head.height, head.width, about)
    write_head(partial, described.with_tiles(fitted, partial))


def finish_field(unfinished: Path, folder: Path, head: CaptureHead) -> None:
    """Replace the last field by that of a capture whose tiles were fitted as they came."""
    partial = unfinished / Stream.FIELD
    if not partial.exists():
        # a process that was killed afterwards may have put the field in place already
        if Field(folder).about.key == head.key:
            return
        raise FieldError(
            f"the fitted tiles of {unfinished} are gone: discard it, and capture again"
        )
    if left := sum(tile.fitted is None for tile in head.tiles):
        raise FieldError(
            f"{left} of {len(head.tiles)} tiles of {unfinished} are not fitted: run "
            "Capture again, it goes on from there"
        )
    _describe(partial, head)
    try:
        replace_folder(partial, folder)
    except OSError as e:
        raise FieldError(
            f"{partial} is complete but cannot take the place of {folder} ({e}): close what uses "
            "that folder and capture again, no render is repeated"
        ) from e
