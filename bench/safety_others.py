"""Files of others, in the way of ARTO's work: they stay as they are."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from arto.core import exr, marked
from arto.core.files import Lock, replace_folder, write_text

Cases = Iterator[tuple[str, Callable[[], bool]]]


class LostError(Exception):
    """A file of somebody else is gone or changed."""


def _others(folder: Path) -> Cases:
    theirs = folder / "theirs"
    theirs.mkdir()
    file = theirs / "comp.nk"
    file.write_text("mine")
    lock = folder / "shot" / Lock.NAME
    lock.parent.mkdir()
    lock.symlink_to(file)
    made = marked.make(folder / "made", "field")
    (made / "link").symlink_to(theirs)
    for name in ("plate.exr", "plate.exr.part"):
        (folder / name).symlink_to(file)
    (folder / "says.json").symlink_to(file)

    def empty() -> bool:
        return Lock.holder(lock.parent) == ""

    def links() -> bool:
        marked.remove(made, "field", folder)
        return not made.exists()

    def write() -> bool:
        exr.write(folder / "plate.exr", {"": np.ones((2, 2, 4))})
        return not (folder / "plate.exr").is_symlink()

    def text() -> bool:
        write_text(folder / "says.json", "{}")
        return (folder / "says.json").read_text() == "{}"

    def refused(work: Callable[[], object]) -> Callable[[], bool]:
        """The work must not be done."""

        def run() -> bool:
            work()
            return False

        return run

    tries: dict[str, Callable[[], bool]] = {
        "the holder of a lock that is a link": empty,
        "remove": refused(lambda: marked.remove(theirs, "field", folder)),
        "replace": refused(lambda: replace_folder(marked.scratch(theirs, "field"), theirs)),
        "a lock that is a link": refused(lambda: Lock(lock.parent, "capturing").__enter__()),
        "links within a folder that goes": links,
        "a plate over a link": write,
        "a description over a link": text,
        "out of the folder": refused(
            lambda: marked.remove(folder / "shot" / "..", "field", folder)
        ),
    }

    def kept(work: Callable[[], bool]) -> Callable[[], bool]:
        def run() -> bool:
            try:
                return work()
            finally:
                if not os.path.lexists(file) or file.read_text() != "mine":
                    raise LostError(str(file))

        return run

    for case, work in tries.items():
        yield case, kept(work)


KINDS: dict[str, Callable[[Path], Cases]] = {"others": _others}
