"""Files that hand a job to a farm: an OpenJD template, a Flamenco job type, shell lines."""

from __future__ import annotations

import json
import os
import re
import shlex
from pathlib import Path

from ...core.description import MOST_BYTES
from ...core.errors import FarmError
from ...core.files import write_text
from ...core.regular import read_regular
from ..blender import scripts
from ..blender.addon import ADDON
from .job import Job

OPENJD = "openjd.json"
LINES = "commands.txt"
FLAMENCO = "arto_capture.js"
# Factory settings and this add-on alone: workers have no user preferences.
QUIET = ["-b", "--factory-startup", "--offline-mode"]


def write(job: Job) -> None:
    """Write these files into the job's folder."""
    write_text(job.folder / OPENJD, json.dumps(openjd(job), indent=1))
    write_text(job.folder / LINES, "\n".join(lines(job)) + "\n")
    script = Path(__file__).with_name(FLAMENCO).read_text(encoding="utf-8")
    if scripts.ALLOWED in _quietly():
        script = script.replace('"--addons"', f'"{scripts.ALLOWED}", "--addons"')
    write_text(job.folder / FLAMENCO, script)


def check(folder: Path) -> None:
    """Raise FarmError where a file that is not ARTO's has the name of a file to be written."""
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


def openjd(job: Job) -> dict[str, object]:
    """A job template by the Open Job Description of 2023-09: render parts, then gather."""

    def run(*verb: str) -> dict[str, object]:
        start = [*_quietly(), "{{Param.Addon}}", "{{Param.Blend}}", "--command", "arto"]
        arguments = [*start, *verb, "--job", "{{Param.Job}}", "--openjd"]
        action = {"command": "{{Param.Blender}}", "args": arguments}
        return {"script": {"actions": {"onRun": action}}}

    return {
        "specificationVersion": "jobtemplate-2023-09",
        "name": job_name(job.head.blend),
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


def _quietly() -> list[str]:
    """Blender's options on a farm. Python in the file runs where it runs in this session."""
    allowed = [scripts.ALLOWED] if scripts.option() == scripts.ALLOWED else []
    return [*QUIET, *allowed, "--addons"]


def job_name(blend: str) -> str:
    """The name of a job of a .blend: OpenJD takes it for a format string of one line."""
    name = re.sub(r"[{}]|[^\x20-\x7e\xa0-\U0010ffff]", "_", Path(blend).stem)
    return f"ARTO {name}"[:64].strip()


def lines(job: Job) -> list[str]:
    """A shell line for each part, and a last line that gathers the parts.

    `$BLEND` is the file and `$JOB` the job's folder. The lines may run on any machine in any order,
    except the last, which must run after all others.
    """
    start = ["blender", *_quietly(), ADDON]
    head = f'{shlex.join(start)} "$BLEND" --command arto'
    return [
        *(f'{head} part {part.number} --job "$JOB"' for part in job.parts),
        f'{head} gather --job "$JOB"',
    ]
