"""A stage of a bench in a process of its own, so that its peak of memory is its own."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

Row = dict[str, Any]
ROOT = Path(__file__).resolve().parent.parent
# What the line with the rows begins with, among all that Blender prints.
MARK = "ARTO rows: "


def tell(rows: list[Row]) -> None:
    """Print a stage's rows, for `rows_of` in the process that started this one."""
    print(MARK + json.dumps(rows), flush=True)


def rows_of(line: Sequence[str], what: str) -> tuple[list[Row], int]:
    """Run a command that tells its rows -> the rows, and its peak of memory in bytes.

    what: names the stage in a message. Raises RuntimeError where the command fails.
    """
    with tempfile.TemporaryFile("w+") as out:
        process = subprocess.Popen(line, cwd=ROOT, stdout=out, stderr=subprocess.STDOUT, text=True)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        said = out.read()
    if process.returncode:
        raise RuntimeError(f"the stage {what} failed:\n{said[-3000:]}")
    (rows,) = (json.loads(t[len(MARK) :]) for t in said.splitlines() if t.startswith(MARK))
    return rows, usage.ru_maxrss * 1024
