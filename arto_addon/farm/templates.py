"""What farms take a job by: an OpenJD template, a job type for Flamenco, and lines of a shell."""

from __future__ import annotations

import json
import os
import shlex
from pathlib import Path
from typing import Any

from ...core.description import MOST_BYTES
from ...core.errors import FarmError
from ...core.files import write_text
from ...core.regular import read_regular
from ..blender.addon import ADDON
from .job import Job

OPENJD = "openjd.json"
LINES = "commands.txt"
FLAMENCO = "arto_capture.js"
# Blender's own start-up, and the add-on alone of what its user has: workers have no preferences.
QUIET = ["-b", "--factory-startup", "--offline-mode", "--addons"]


def write(job: Job) -> None:
    """Write them into the job's folder."""
    write_text(job.folder / OPENJD, json.dumps(openjd(job), indent=1))
    write_text(job.folder / LINES, "\n".join(lines(job)) + "\n")
    script = Path(__file__).with_name(FLAMENCO).read_text(encoding="utf-8")
    write_text(job.folder / FLAMENCO, script)


def check(folder: Path) -> None:
    """Raise FarmError where a file of others has the name of one that is written."""
    for name, says in ((OPENJD, '"ARTO '), (LINES, "--command arto gather"), (FLAMENCO, "ARTO")):
        path = folder / name
        if not os.path.lexists(path):
            continue
        try:
            ours = says in read_regular(path, MOST_BYTES).decode("utf-8", "replace")
        except OSError:
            ours = False
        if not ours:
            raise FarmError(f"{path} was not written by ARTO: plan into another folder")


def openjd(job: Job) -> dict[str, Any]:
    """A job template by the Open Job Description of 2023-09: the parts, then what joins them."""

    def run(*verb: str) -> dict[str, Any]:
        start = [*QUIET, "{{Param.Addon}}", "{{Param.Blend}}", "--command", "arto"]
        arguments = [*start, *verb, "--job", "{{Param.Job}}", "--openjd"]
        action = {"command": "{{Param.Blender}}", "args": arguments}
        return {"script": {"actions": {"onRun": action}}}

    return {
        "specificationVersion": "jobtemplate-2023-09",
        "name": f"ARTO {Path(job.head.blend).stem}"[:64],
        "parameterDefinitions": [
            {"name": "Blender", "type": "STRING", "default": "blender"},
            {"name": "Addon", "type": "STRING", "default": ADDON},
            {"name": "Blend", "type": "PATH", "objectType": "FILE", "dataFlow": "IN"},
            {"name": "Job", "type": "PATH", "objectType": "DIRECTORY", "dataFlow": "INOUT"},
        ],
        "steps": [
            {
                "name": "Parts",
                "parameterSpace": {
                    "taskParameterDefinitions": [
                        {"name": "Part", "type": "INT", "range": f"0-{len(job.parts) - 1}"}
                    ]
                },
                **run("part", "{{Task.Param.Part}}"),
            },
            {"name": "Gather", "dependencies": [{"dependsOn": "Parts"}], **run("gather")},
        ],
    }


def lines(job: Job) -> list[str]:
    """A line of a shell for each part, and the last one that gathers them. `$BLEND` is the file,
    `$JOB` this folder; they may be run anywhere, in any order, but for the last."""
    start = ["blender", *QUIET, ADDON]
    head = f'{shlex.join(start)} "$BLEND" --command arto'
    return [
        *(f'{head} part {part.number} --job "$JOB"' for part in job.parts),
        f'{head} gather --job "$JOB"',
    ]
