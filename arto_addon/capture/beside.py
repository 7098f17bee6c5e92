"""The takes beside the first, for a shot with shadow catchers (`stage.takes`).

The first take shows everything. The others show the catchers alone and the things alone, in the
light of the same patches.
"""

from __future__ import annotations

import contextlib
from pathlib import Path

from ...core.capture.capture_set import CaptureSet
from ...core.capture.head import CaptureHead
from ...core.errors import ArtoError
from ...core.field.field import Field
from ..stage.takes import TAKES, WHOLE
from .planned import Given


def given_by(head: CaptureHead) -> Given:
    """What the takes beside the first take over from its head. Raises CaptureSetError."""
    return Given(head.hemicube, head.told_route, head.caution)


def is_whole(place: Path, key: str, catchers: bool) -> bool:
    """Whether a shot's folder has the finished capture with this key, with its field and takes.

    catchers: whether the shot has takes beside the first.
    """
    with contextlib.suppress(ArtoError, OSError):
        for take in (WHOLE, *TAKES) if catchers else (WHOLE,):
            folder = place / take
            head = CaptureSet(folder / "capture").head
            if (take == WHOLE and head.key != key) or (take != WHOLE and head.pair != key):
                return False
            if not head.kept:
                field = Field(folder / "field")
                # opens each tile's file
                if field.about.key != head.key or not field.has_layer("alpha"):
                    return False
        return True
    return False


def is_there(folder: Path, key: str, pair: str | None) -> bool:
    """Whether a folder has the finished take with this key, made for the first take `pair`."""
    with contextlib.suppress(ArtoError):
        head = CaptureSet(folder).head
        return head.key == key and head.pair == pair
    return False
