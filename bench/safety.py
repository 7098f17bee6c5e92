"""Damages, kills and files of others, in temporary folders: what comes of each.

An outcome is `right`, `typed error`, `wrong` (another value without a word), `lost` (a file of
others is gone or changed), `hang` (waits, or takes a second of a processor or
200 MB more than undamaged) or `traceback`.
"""

from __future__ import annotations

import contextlib
import os
import signal
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from arto.core.errors import ArtoError

from . import safety_damages, safety_kills, safety_others, safety_pictures

SECONDS, BYTES = 1.0, 200 << 20
# A piece of work, and whether its result is right.
Work = Callable[[], bool]
# A case: what it is, and the work with it.
Cases = Iterator[tuple[str, Work]]
# What work may raise: reading an array says what is wrong with it in errors of Python's own, which
# its callers turn into typed ones.
TYPED = (ArtoError, safety_damages.DamagedError)

KINDS: dict[str, Callable[[Path], Cases]] = {
    **safety_damages.KINDS,
    **safety_others.KINDS,
    **safety_pictures.KINDS,
    **safety_kills.KINDS,
}


def safety() -> list[dict[str, Any]]:
    """The rows: kind, case, outcome."""
    rows = []
    for kind, cases in KINDS.items():
        with tempfile.TemporaryDirectory() as folder:
            usual = 0.0
            for case, work in cases(Path(folder)):
                said, took = _outcome(work, usual)
                if not usual:
                    usual = took  # the first case of a kind is undamaged
                rows.append({"kind": kind, "case": case, "outcome": said})
    return rows


# Work that takes so long is done once more, to see how much memory it takes. Seeing slows it down.
_LONG = 0.1


def _outcome(work: Work, usual: float) -> tuple[str, float]:
    """What comes of some work, and the seconds of a processor that it took."""
    begun = time.process_time()
    said = _tried(work)
    took = time.process_time() - begun
    if usual and took > usual + SECONDS:
        return "hang", took
    if usual and took > usual + _LONG and said == "typed error":
        tracemalloc.start()
        _tried(work)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        if most > BYTES:
            return "hang", took
    return said, took


def _tried(work: Work) -> str:
    try:
        with _alarm(60 * SECONDS):
            return "right" if work() else "wrong"
    except TYPED:
        return "typed error"
    except safety_others.LostError:
        return "lost"
    except TimeoutError:
        return "hang"
    except Exception:
        return "traceback"


@contextlib.contextmanager
def _alarm(seconds: float) -> Iterator[None]:
    """Raise TimeoutError in work that waits for ever, as for a pipe."""
    if os.name == "nt":
        yield
        return

    def late(*_: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def table(rows: list[dict[str, Any]]) -> str:
    """How many of each outcome, by kind."""
    counts: dict[tuple[str, str], int] = {}
    for row in rows:
        key = row["kind"], row["outcome"]
        counts[key] = counts.get(key, 0) + 1
    return "\n".join(f"{kind:12} {outcome:12} {n}" for (kind, outcome), n in sorted(counts.items()))
