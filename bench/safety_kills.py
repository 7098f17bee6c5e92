"""Kills in the middle of writing, and two writers of one file: what is read is whole."""

from __future__ import annotations

import os
import random
import signal
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from arto.core import arrays, exr
from arto.core.field.field import Field
from arto.core.files import settle
from arto.core.signed import parsed, write

from .safety_damages import captured, fitted, picture

Cases = Iterator[tuple[str, Callable[[], bool]]]
EACH = 10


def _killed(work: Callable[[int], None], seconds: float) -> None:
    """Start a process that does the work again and again, and kill it after so many seconds."""
    child = os.fork()
    if not child:
        try:
            for n in range(100_000):
                work(n % 2)
        finally:
            os._exit(1)
    time.sleep(seconds)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)


def _kills(folder: Path) -> Cases:
    """Of each kind of file; a new write afterwards leaves nothing of the killed one's."""
    chance = random.Random(0)
    captures = [captured(folder / f"c{n}", n) for n in (0, 1)]
    image = np.ones((300, 400, 4), np.float32)
    plate, kept, said, field = (folder / n for n in ("p.exr", "map.npy", "said.json", "field"))

    def write_plate(n: int) -> None:
        exr.write(plate, {"": image * n})

    def write_map(n: int) -> None:
        arrays.write(kept, image * n)

    def write_text(n: int) -> None:
        write(said, {"n": n, "text": "x" * 100_000})

    def write_field(n: int) -> None:
        fitted(captures[n], field)

    pictures = [picture(fitted(capture, field)) for capture in captures]

    def whole_plate() -> bool:
        found = exr.read(plate)[""]
        return bool((found == found[0, 0, 0]).all())

    def whole_map() -> bool:
        found = arrays.read(kept, image.nbytes)
        return bool((found == found[0, 0, 0]).all())

    def whole_text() -> bool:
        return len(parsed(said.read_text())["text"]) == 100_000

    def whole_field() -> bool:
        settle(field)
        Field(field).close()
        return any(np.array_equal(picture(field), one) for one in pictures)

    for kind, work, whole in (
        ("plate", write_plate, whole_plate),
        ("map", write_map, whole_map),
        ("description", write_text, whole_text),
        ("field", write_field, whole_field),
    ):
        work(0)
        for n in range(EACH):
            seconds = chance.uniform(0.005, 0.2)

            def run(work=work, whole=whole, seconds=seconds) -> bool:
                _killed(work, seconds)
                good = whole()
                work(1)
                left = [p.name for p in folder.iterdir() if p.name.endswith((".part", ".old"))]
                return good and whole() and not left

            yield f"{kind} {n}, after {seconds:.3f} s", run


def _writers(folder: Path) -> Cases:
    """Two relights of one shot at a time, and somebody who looks at the plate."""
    plate = folder / "plate.exr"

    def run() -> bool:
        ended: list[int] = []

        def work(value: int) -> None:
            for _ in range(15):
                exr.write(plate, {"": np.full((60, 80, 4), value, np.float32)})
            ended.append(value)

        work(0)
        threads = [threading.Thread(target=work, args=(n,)) for n in (1, 2)]
        for thread in threads:
            thread.start()
        good = True
        while len(ended) < 3:
            found = exr.read(plate)[""]
            good &= bool((found == found[0, 0, 0]).all())
        for thread in threads:
            thread.join()
        return good and [p.name for p in folder.iterdir()] == ["plate.exr"]

    yield "two writers and a reader", run


KINDS: dict[str, Callable[[Path], Cases]] = {"writers": _writers}
if hasattr(os, "fork"):
    KINDS["kill"] = _kills
