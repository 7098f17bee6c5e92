"""The takes of a shot with shadow catchers that stand beside the first: the catchers alone, and the
things alone, in the light of the same patches (`stage.takes`)."""

from __future__ import annotations

import contextlib
from pathlib import Path

from ...core.capture.capture_set import CaptureSet
from ...core.capture.head import CaptureHead
from ...core.errors import ArtoError
from .planned import Given


def given_by(head: CaptureHead) -> Given:
    """What a capture set's head gives to the takes beside it. Raises CaptureSetError."""
    return Given(head.hemicube, head.told_route, head.caution)


def is_there(folder: Path, key: str, pair: str | None) -> bool:
    """Whether a folder has the finished take of that key, made for the first take `pair`."""
    with contextlib.suppress(ArtoError):
        head = CaptureSet(folder).head
        return head.key == key and head.pair == pair
    return False
