"""Damages and files of others, in temporary folders: what comes of each.

An outcome is `right`, `typed error`, `wrong` (another value without a word), `lost` (a file of
others is gone or changed), `hang` (over a second) or `traceback`.
"""

from __future__ import annotations

import os
import random
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from arto.core import arrays, marked
from arto.core.capture import capture_set
from arto.core.capture.head import HEADER
from arto.core.errors import ArtoError
from arto.core.files import Lock, replace_folder
from arto.core.hemicube import Hemicube
from arto.core.patterns import pattern_set

SECONDS = 1.0
DAMAGES = 150


def safety() -> list[dict[str, Any]]:
    """The rows: kind, case, outcome."""
    rows = []
    for kind, cases in (("map", _maps), ("description", _descriptions), ("others", _others)):
        with tempfile.TemporaryDirectory() as folder:
            for case, outcome in cases(Path(folder)):
                rows.append({"kind": kind, "case": case, "outcome": outcome})
    return rows


def _outcome(work: Callable[[], bool], typed: tuple[type[Exception], ...] = (ArtoError,)) -> str:
    """What comes of some work, which says whether its result is right. typed: the errors that the
    work may raise."""
    begun = time.monotonic()
    try:
        said = "right" if work() else "wrong"
    except typed:
        said = "typed error"
    except Exception:
        said = "traceback"
    return "hang" if time.monotonic() - begun > SECONDS else said


def _damaged(good: bytes) -> list[tuple[str, bytes]]:
    """Flipped bits, cuts and stretches of noise, the same ones each time."""
    chance, out = random.Random(0), []
    for n in range(DAMAGES):
        bad, at = bytearray(good), chance.randrange(len(good))
        if n % 3 == 0:
            bad[at] ^= 1 << chance.randrange(8)
        elif n % 3 == 1:
            del bad[at:]
        else:
            bad[at : at + 8] = chance.randbytes(8)
        out.append((f"{('bit', 'cut', 'noise')[n % 3]} at {at}", bytes(bad)))
    return out


def same(path: Path, image: np.ndarray) -> bool:
    return np.array_equal(arrays.read(path, image.nbytes), image)


def _maps(folder: Path) -> list[tuple[str, str]]:
    path, image = folder / "map.npy", np.random.default_rng(0).random((8, 16, 3), np.float32)
    arrays.write(path, image)
    found = []
    for case, bad in _damaged(path.read_bytes()):
        path.write_bytes(bad)
        found.append((case, _outcome(lambda: same(path, image), (OSError, ValueError))))
    return found


def _descriptions(folder: Path) -> list[tuple[str, str]]:
    """A value that was changed to another that may be is read: a description has no digest."""
    basis = np.ones((6, 3, 2, 3, 3), np.float32)
    capture_set.write(folder, Hemicube(patches=1), pattern_set("linear"), basis, key="a")
    path = folder / HEADER
    good = path.read_bytes()
    head, found = capture_set.CaptureSet(folder).head, []
    for case, bad in _damaged(good):
        path.write_bytes(bad)
        same = _outcome(lambda: capture_set.CaptureSet(folder).head == head)
        found.append((case, same))
    return found


def _others(folder: Path) -> list[tuple[str, str]]:
    theirs = folder / "theirs"
    theirs.mkdir()
    file = theirs / "comp.nk"
    file.write_text("mine")
    lock = folder / "shot" / Lock.NAME
    lock.parent.mkdir()
    lock.symlink_to(file)
    made = marked.make(folder / "made", "field")
    (made / "link").symlink_to(theirs)
    tries: dict[str, Callable[[], object]] = {
        "remove": lambda: marked.remove(theirs, "field", folder),
        "replace": lambda: replace_folder(marked.scratch(theirs, "field"), theirs),
        "lock": lambda: Lock(lock.parent, "capturing").__enter__(),
        "holder": lambda: Lock.holder(lock.parent) == "",
        "links within": lambda: marked.remove(made, "field", folder) is None,
    }
    found = []
    for case, work in tries.items():
        said = _outcome(lambda work=work: bool(work()))
        kept = os.path.lexists(file) and file.read_text() == "mine"
        found.append((case, said if kept else "lost"))
    return found


def table(rows: list[dict[str, Any]]) -> str:
    """How many of each outcome, by kind."""
    counts: dict[tuple[str, str], int] = {}
    for row in rows:
        key = row["kind"], row["outcome"]
        counts[key] = counts.get(key, 0) + 1
    return "\n".join(f"{kind:12} {outcome:12} {n}" for (kind, outcome), n in sorted(counts.items()))
