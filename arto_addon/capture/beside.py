"""The takes of a shot with shadow catchers that stand beside the first: the catchers alone, and the
things alone, in the light of the same patches (`stage.takes`)."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

from ...core.capture.capture_set import CaptureSet
from ...core.errors import ArtoError
from ...core.hemicube import Hemicube
from ..stage.takes import PAIR
from .planned import Given


def given_by(head: dict[str, Any]) -> Given:
    """What a capture set's description gives to the takes beside it."""
    return Given(Hemicube.from_json(head["hemicube"]), head["route"], head.get("caution"))


def is_there(folder: Path, key: str, pair: str) -> bool:
    """Whether a folder has the finished take of that key, made for the first take `pair`."""
    with contextlib.suppress(ArtoError):
        head = CaptureSet(folder).head
        return head.get("key") == key and head.get(PAIR) == pair
    return False
