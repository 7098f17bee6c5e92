"""What a command has written, warned of and failed in: told line by line, and as a file of JSON."""

from __future__ import annotations

import json
import os
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Literal

from ...core.errors import ArtoError, CancelledError, FilesError, SceneError
from ...core.file_names import is_text
from ...core.files import write_text
from ...core.regular import FULL, json_object
from ..shot.home import check_outside
from ..work import Failed, Progress, Render, Warned, Wrote

FORMAT, VERSION = "ARTO report", 1
_MOST = 64 << 20
Outcome = Literal["unfinished", "done", "some failed", "failed", "wrong options", "cancelled"]
# Exit codes of the command line.
CODES: dict[Outcome, int] = {
    "unfinished": 1,
    "done": 0,
    "failed": 1,
    "wrong options": 2,
    "some failed": 3,
    "cancelled": 130,
}


class OptionError(Exception):
    """An option whose value cannot be."""


# Files that ARTO writes itself have such names: a report would be written over by them.
_TAKEN = re.compile(r"(?i)lock|(shot|arto-folder)\.json|.*\.(exr|arto|npy|blend|js|part)")
_OF_JOB = {"job.json", "openjd.json", "templates.json", "commands.txt"}


def check_place(path: Path, job: Path | None = None) -> None:
    """Raise OptionError where no file of JSON can be. job: the folder of a farm's job."""
    if not is_text(path):
        raise OptionError(f"--json {str(path)!a}: the name is not written in UTF-8")
    of_job = job is not None and path.parent == job.resolve() and path.name.lower() in _OF_JOB
    if of_job or _TAKEN.fullmatch(path.name):
        raise OptionError(f"--json {path}: ARTO's own files have such names, choose another")
    try:
        check_outside(path, "a report")
    except SceneError as e:
        raise OptionError(f"--json {e}") from e


def check_file(path: Path, form: str, job: Path | None = None) -> None:
    """Look at the place of a file of JSON. form: its `format`; job: the folder of a farm's job.

    Raises OptionError where a file is there that ARTO has not written, and where ARTO writes other
    files of that name or removes the folder.
    """
    check_place(path, job)
    if not os.path.lexists(path) or (path.is_file() and path.stat().st_size == 0):
        return
    if json_object(path, _MOST).get("format") != form:
        raise OptionError(f"--json {path}: another file is there, which ARTO has not written")


class Report:
    """What a command has done so far.

    verb: the command; path: the file to write, or None; lines: tells each step. The file says
    "unfinished" from the beginning, so what a killed process leaves is not taken for the report
    before. job: the folder of a farm's job. Raises OptionError where the file cannot be written, or
    is something else; FilesError where the disk is full.
    """

    def __init__(
        self,
        verb: str,
        path: Path | None,
        lines: Callable[[Progress | Render], None],
        job: Path | None = None,
    ) -> None:
        self.verb, self.path, self.lines = verb, path, lines
        self.outcome: Outcome = "unfinished"
        self.wrote: list[str] = []
        self.warnings: list[dict[str, str]] = []
        self.failed: list[dict[str, str]] = []
        self._errors: list[BaseException] = []
        self._begun = time.perf_counter()
        if path is not None:
            check_file(path, FORMAT, job)
            try:
                self.write()
            except OSError as e:
                said = f"--json {path} cannot be written ({e})"
                if e.errno in FULL:
                    raise FilesError(f"{said}: make room on the disk") from e
                raise OptionError(said) from e

    def __call__(self, step: Progress | Render) -> None:
        """Tell a step, and note what it wrote, warned of or failed in."""
        if isinstance(step, Wrote):
            self.wrote.append(str(step.path))
        elif isinstance(step, Warned):
            said = {"of": step.of, "text": step.text}
            if said not in self.warnings:
                self.warnings.append(said)
        elif isinstance(step, Failed):
            if step.error is not None:
                self._errors.append(step.error)
            self._failed(step.of, step.error, step.text)
            print(f"ARTO: {step.text}", file=sys.stderr, flush=True)
            return
        self.lines(step)

    def _failed(self, of: str, error: BaseException | None, text: str) -> None:
        kind = type(error).__name__ if error is not None else ""
        self.failed.append({"of": of, "error": kind, "text": text})

    def ended(self, error: BaseException | None = None) -> int:
        """Note how the command ended, and write the file; returns the exit code."""
        if error is not None:
            if error not in self._errors and error.__cause__ not in self._errors:
                self._failed("", error, str(error))
            said = str(error) if isinstance(error, ArtoError | OptionError) else repr(error)
            print(f"ARTO: {said}", file=sys.stderr, flush=True)
        if isinstance(error, CancelledError):
            self.outcome = "cancelled"
        elif isinstance(error, OptionError):
            self.outcome = "wrong options"
        elif error is not None:
            self.outcome = "failed"
        else:
            self.outcome = "some failed" if self.failed else "done"
        try:
            self.write()
        except OSError as e:
            print(f"ARTO: --json {self.path} cannot be written ({e})", file=sys.stderr)
            return CODES["failed"]
        return CODES[self.outcome]

    def write(self) -> None:
        """Write the file. Raises OSError."""
        if self.path is not None:
            write_text(self.path, json.dumps(self.to_json(), indent=1) + "\n")

    def to_json(self) -> dict[str, object]:
        return {
            "format": FORMAT,
            "version": VERSION,
            "command": self.verb,
            "outcome": self.outcome,
            "wrote": self.wrote,
            "warnings": self.warnings,
            "failed": self.failed,
            "seconds": round(time.perf_counter() - self._begun, 3),
        }


class OpenJDLines:
    """Prints progress in the lines that an Open Job Description session reads."""

    def __call__(self, step: Progress | Render) -> None:
        print(f"openjd_progress: {100 * step.share:.1f}\nopenjd_status: {step.text}", flush=True)
