"""Long work as a generator of steps, and what drives it.

A piece of work yields `Progress` and `Render`. The driver does the steps one after the other and
waits for each render, both in batch and in the second Blender that a button starts. The generator
cleans up in its own `finally`, however the work ends.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import bpy

from ..core.errors import ArtoError, CancelledError, DeviceMemoryError, SceneError, StrictError
from . import interrupt

STOPPED = "cancelled: finished parts of a capture are kept, run it again to go on"


@dataclass
class Progress:
    """share: how much is done, 0 to 1; text: what is being done."""

    share: float
    text: str


@dataclass
class Warned(Progress):
    """A warning: the work goes on, but what it makes may not be what the artist wants.

    of: which picture or frame of a larger work; "" for the work as a whole.
    """

    of: str = ""


@dataclass
class Wrote(Progress):
    """A file or folder was written and is complete. path: where it is."""

    path: Path = field(default_factory=Path)


@dataclass
class Failed(Progress):
    """A picture or frame of a larger work failed. of: which one; error: why."""

    of: str = ""
    error: ArtoError | None = None


@dataclass
class Render:
    """A render of a scene into its output path, to be done before the next step."""

    scene: str
    share: float
    text: str
    span: float = 0.0  # the render's share of the whole work
    state: str = field(default="waiting")  # then "done", "cancelled" or "no memory"
    trouble: str = ""  # what Cycles said

    def check(self) -> None:
        """Raise CancelledError unless the render was completed; DeviceMemoryError without room."""
        if self.state == "no memory":
            raise DeviceMemoryError(
                f"Cycles has not the memory for this render ({self.trouble}): close other programs,"
                " lower Memory in ARTO's settings, or render on the CPU"
            )
        if self.state != "done":
            raise CancelledError(STOPPED)


_Step = TypeVar("_Step")
_Other = TypeVar("_Other")
_Made = TypeVar("_Made")
# A piece of work, and what it returns: `Steps[Path]`.
Steps = Generator[Progress | Render, None, _Made]


def _last_properties() -> bpy.types.OperatorProperties | None:
    # looked up at each call: Blender replaces the object
    return bpy.context.window_manager.operator_properties_last("render.render")


@contextmanager
def last_properties_kept() -> Iterator[None]:
    """Put back the properties of the last render, which Blender uses again for the next F12."""
    last = _last_properties()
    names = [p.identifier for p in last.bl_rna.properties if not p.is_readonly] if last else []
    before = {n: getattr(last, n) for n in names if last and last.is_property_set(n)}
    try:
        yield
    finally:
        last = _last_properties()
        for name in names:
            if last and name in before:
                setattr(last, name, before[name])
            elif last:
                last.property_unset(name)


def blocking_render(request: Render) -> None:
    """Do a render and wait for it."""
    ended: list[str] = []

    def on_cancel(*_: object) -> None:
        ended.append("cancelled")

    bpy.app.handlers.render_cancel.append(on_cancel)
    try:
        with last_properties_kept():
            result = bpy.ops.render.render(write_still=True, scene=request.scene)
    except KeyboardInterrupt:
        result = {"CANCELLED"}
    except RuntimeError as e:
        said = str(e).strip().rstrip(".")
        if "memory" in said.lower():
            request.state, request.trouble = "no memory", said
            return
        raise SceneError(
            f"Cycles could not render: {said}. If the console says that a file could not be "
            "written, make room on the disk (or raise the limit: quota, ulimit -f)"
        ) from e
    finally:
        bpy.app.handlers.render_cancel.remove(on_cancel)
    request.state = "cancelled" if ended or "FINISHED" not in result else "done"


def retold(
    steps: Generator[_Step, None, _Made], change: Callable[[_Step], _Other | None]
) -> Generator[_Other, None, _Made]:
    """Pass on the steps of a piece of work as `change` returns them; None leaves a step out.

    Returns what the work returns, and closes the work however it ends.
    """
    try:
        while True:
            if (other := change(next(steps))) is not None:
                yield other
    except StopIteration as end:
        return end.value
    finally:
        steps.close()


def driven(steps: Generator[_Step, None, _Made], do: Callable[[_Step], None]) -> _Made:
    """Drive the work to its end, with `do` for each step; returns what the work returns."""
    try:
        while True:
            do(next(steps))
    except StopIteration as end:
        return end.value
    finally:
        steps.close()


def part_of(steps: Steps[_Made], begin: float, span: float, title: str = "") -> Steps[_Made]:
    """Pass on the steps of a part of a larger work: their shares run from `begin` over `span`.

    title: put before the text of each step.
    """

    def change(step: Progress | Render) -> Progress | Render:
        step.share, step.text = begin + span * step.share, title + step.text
        if isinstance(step, Render):
            step.span *= span
        return step

    return retold(steps, change)


def strictly(steps: Steps[_Made]) -> Steps[_Made]:
    """Pass on the steps of a piece of work; a warning ends the work. Raises StrictError."""

    def change(step: Progress | Render) -> Progress | Render:
        if isinstance(step, Warned):
            raise StrictError(f"{step.text} (a warning, and with --strict that is an error)")
        return step

    return retold(steps, change)


def of_piece(steps: Steps[_Made], name: str) -> Steps[_Made]:
    """Pass on the steps of one of many pieces of work, and say of which its warnings are."""

    def change(step: Progress | Render) -> Progress | Render:
        if isinstance(step, Warned):
            step.of = step.of or name
        return step

    return retold(steps, change)


def of_one(steps: Steps[_Made], name: str, share: float) -> Steps[_Made]:
    """Run one of many similar pieces of work without its progress, which would be lost among many.

    What was written, warned of and failed is passed on, and so are renders. name: of the piece, for
    its warnings; share: how much of the whole work is done.
    """

    def change(step: Progress | Render) -> Progress | Render | None:
        if isinstance(step, Progress) and not isinstance(step, Warned | Wrote | Failed):
            return None
        step.share = share
        return step

    return of_piece(retold(steps, change), name)


@dataclass(frozen=True)
class Batch:
    """What a failure and a warning mean in a work of many pieces.

    keep_going: whether the other pieces are done where one failed; strict: whether a piece with a
    warning has failed.
    """

    keep_going: bool = False
    strict: bool = False


PLAIN = Batch()


def failed(names: Iterable[str], error: ArtoError, share: float, batch: Batch) -> Iterator[Failed]:
    """Tell that pieces of a work failed. Raises the error, unless the batch keeps going."""
    if isinstance(error, CancelledError):
        raise error
    # without its traceback, which would hold the arrays of what failed
    for name in names:
        yield Failed(share, f"{name} failed: {error}", name, error.with_traceback(None))
    if not batch.keep_going:
        raise error


def attempted(steps: Steps[_Made], name: str, share: float, batch: Batch) -> Steps[_Made | None]:
    """Do a piece of work of many -> what it returns; None if it failed.

    name: of the piece; share: how much of the whole work is done before it. Raises the piece's
    error, unless the batch keeps going.
    """
    try:
        return (yield from strictly(steps) if batch.strict else steps)
    except ArtoError as e:
        yield from failed([name], e, share, batch)
        return None


def tried(steps: Steps[_Made], name: str, share: float, batch: Batch) -> Steps[_Made | None]:
    """Do one of many similar pieces of work as `attempted` does, without its progress: `of_one`."""
    return (yield from attempted(of_one(steps, name, share), name, share, batch))


def looked(
    wrong: Mapping[str, ArtoError], total: int, what: str, batch: Batch
) -> Generator[Failed, None, None]:
    """Tell what is wrong with some of many pieces of work, before the first of them is begun.

    wrong: errors by the names of the pieces; total: how many pieces there are; what: the pieces in
    words. Raises an error that names all that is wrong, unless the batch keeps going and there are
    other pieces.
    """
    for name, error in wrong.items():
        yield Failed(0.0, f"{name} cannot be made: {error}", name, error.with_traceback(None))
    if not wrong or (batch.keep_going and len(wrong) < total):
        return
    first = next(iter(wrong.values()))
    if len(set(map(str, wrong.values()))) == 1:
        raise first
    said = [f"{name}: {error}" for name, error in wrong.items()]
    more = f"\n  and {len(said) - 10} more" if len(said) > 10 else ""
    lines = "\n  ".join(said[:10])
    others = " (--keep-going makes the others)" if len(wrong) < total else ""
    raise type(first)(
        f"{len(wrong)} of {total} {what} cannot be made, so none was begun{others}:"
        f"\n  {lines}{more}"
    ) from first


def run(steps: Steps[_Made], say: Callable[[Progress | Render], None] | None = None) -> _Made:
    """Drive the work to its end, renders included; returns what the work returns.

    say: called with each step.
    """

    def do(step: Progress | Render) -> None:
        if say:
            say(step)
        if told.came:
            raise CancelledError(STOPPED)
        if isinstance(step, Render):
            blocking_render(step)

    try:
        with interrupt.noted() as told:
            return driven(steps, do)
    except KeyboardInterrupt:
        raise CancelledError(STOPPED) from None


class ProgressLines:
    """Prints progress for batch runs: a line for each new text, and for each tenth of the work."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.last = ("", -1)
        self.begun = time.perf_counter()

    def __call__(self, step: Progress | Render) -> None:
        text = f"WARNING: {step.text}" if isinstance(step, Warned) else step.text
        now = (text, int(step.share * 10))
        if now != self.last:
            self.last = now
            seconds = time.perf_counter() - self.begun
            print(f"ARTO {self.name}: {step.share:4.0%} {text} ({seconds:.1f} s)", flush=True)
