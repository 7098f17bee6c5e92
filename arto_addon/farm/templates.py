"""Files that hand a job to a farm: an OpenJD template, a Flamenco job type, shell lines."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shlex
from collections.abc import Mapping
from pathlib import Path

from ...core import signed
from ...core.description import MOST_BYTES
from ...core.errors import FarmError
from ...core.files import write_text
from ...core.regular import read_regular
from ...core.values import Values
from ..blender import scripts
from ..blender.addon import ADDON
from .job import Job

OPENJD = "openjd.json"
LINES = "commands.txt"
FLAMENCO = "arto_capture.js"
# What says of these files what ARTO wrote.
WRITTEN, FORMAT = "templates.json", "ARTO templates"
# Factory settings and this add-on alone: workers have no user preferences.
QUIET = ["-b", "--factory-startup", "--offline-mode"]


def write(job: Job) -> None:
    """Write these files into the job's folder, and what by one knows that they are as written."""
    script = Path(__file__).with_name(FLAMENCO).read_text(encoding="utf-8")
    if scripts.ALLOWED in _quietly():
        script = script.replace('"--addons"', f'"{scripts.ALLOWED}", "--addons"')
    texts = {
        OPENJD: json.dumps(openjd(job), indent=1),
        LINES: "\n".join(lines(job)) + "\n",
        FLAMENCO: script,
    }
    said = {name: _digest(text.encode()) for name, text in texts.items()}
    signed.write(job.folder / WRITTEN, {"format": FORMAT, "files": said})
    for name, text in texts.items():
        write_text(job.folder / name, text)


def check(folder: Path) -> None:
    """Raise FarmError where a file that is not just as ARTO wrote it has the name of a template."""
    said: Mapping[str, object] = {}
    if os.path.lexists(folder / WRITTEN):
        values = Values(folder / WRITTEN, FarmError)
        if values.data.get("format") != FORMAT:
            raise FarmError(f"{folder / WRITTEN} was not written by ARTO: plan into another folder")
        said = values.kind("files", dict, {})
    for name in (OPENJD, LINES, FLAMENCO):
        path = folder / name
        if not os.path.lexists(path):
            continue
        try:
            ours = said.get(name) == _digest(read_regular(path, MOST_BYTES))
        except OSError:
            ours = False
        if not ours:
            raise FarmError(
                f"{path} was not written by ARTO, or was changed since: move it away, or plan into "
                "another folder"
            )


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


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
