"""Kill -9 and cancel at random moments of a capture that memory would make one tile: what is lost.

Each time a process begins the capture or goes on with it, and is ended at a random moment. What is
lost is what the process did since work was kept last: since it began, or since a tile was noted
down in the capture's description.
"""

from __future__ import annotations

import argparse
import contextlib
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from arto.core.capture import head as heads
from arto.core.field.field import Field

from .apart import ROOT, Row
from .machine import write_rows

# Captures a scene in a process of its own: the folder, samples. A capture that is stopped goes on.
CAPTURE = """
import sys
from pathlib import Path
import bpy
from arto.arto_addon import work
from arto.arto_addon.capture.capture import capture
from bench import scenes
from bench.reference import registered

folder, samples = sys.argv[-2:]
path = Path(folder) / "scene.blend"
if path.is_file():
    registered()
    bpy.ops.wm.open_mainfile(filepath=str(path))
else:
    scenes.product_shot(width=96, height=72)
    registered()
    settings = bpy.context.scene.arto
    settings.folder, settings.keep = str(Path(folder) / "arto"), "never"
    settings.quality, settings.samples = "CUSTOM", int(samples)
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    print("saved", flush=True)
scene = bpy.context.scene
try:
    work.run(capture(scene, scene.view_layers[0].name))
except work.CancelledError:
    sys.exit(130)
"""
# Seconds that a process may be at work before it is ended, that it has to end by itself once it is
# told to, as a job of the window has, and a minute.
LONGEST, PATIENCE, LIMIT = 150.0, 8.0, 60.0


def kills(samples: int, times: int, seed: int) -> Iterator[Row]:
    """A row for each kill, and one for the end.

    lost_seconds: what was done again; tiles: that were there, and of how many.
    """
    chance = random.Random(seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        line = [sys.executable, "-c", CAPTURE, name, str(samples)]
        for i in range(times):
            how = ("kill -9", "cancel")[i % 2]
            begun = time.time()
            child = subprocess.Popen(
                line, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            )
            try:
                child.wait(chance.uniform(5.0, LONGEST))
            except subprocess.TimeoutExpired:
                at = time.time()
                if how == "cancel":
                    child.send_signal(signal.SIGINT)
                    with contextlib.suppress(subprocess.TimeoutExpired):
                        child.wait(PATIENCE)
                child.kill()
                child.wait()
            else:
                break  # the capture is complete
            lost = _lost(folder, begun, at)
            yield {"how": how, "after": at - begun, "limit": LIMIT, **lost}
            if lost["tiles"] == "all":
                break
        while subprocess.run(line, cwd=ROOT, capture_output=True).returncode:
            pass
        (field,) = folder.rglob("field/field.json")
        tiles = len(Field(field.parent).tiles)
        left = [p.name for p in folder.rglob("*.part")]
        yield {"how": "the end", "after": 0.0, "lost_seconds": 0.0, "limit": LIMIT,
               "tiles": f"{tiles} of {tiles}", "left": left}  # fmt: skip


def _lost(folder: Path, begun: float, at: float) -> dict[str, Any]:
    """What a process lost that was at work from `begun` until `at`."""
    found = list(folder.rglob("unfinished-*/capture.json"))
    if any(folder.rglob("capture/capture.json")):
        return {"lost_seconds": 0.0, "tiles": "all"}
    if not found:
        return {"lost_seconds": at - begun, "tiles": "0"}
    head = heads.read(found[0].parent)
    kept = max(begun, found[0].stat().st_mtime)
    return {"lost_seconds": max(at - kept, 0.0), "tiles": f"{head.done} of {len(head.tiles)}"}


def table(rows: list[Row]) -> str:
    """Markdown."""
    lines = ["| | after, s | lost, s | tiles |", "|---|---|---|---|"]
    for r in rows:
        cells = [r["how"], f"{r['after']:.0f}", f"{r['lost_seconds']:.0f}", r["tiles"]]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _kills(options: argparse.Namespace) -> None:
    rows: list[Row] = []
    for row in kills(options.samples, options.times, options.seed):
        rows.append(row)
        write_rows(options.json, rows)
        print(table([row]).splitlines()[-1], flush=True)


def add(commands: Any) -> None:
    """Add the command to the parser of `python -m bench`."""
    c = commands.add_parser("kills", help="a capture is ended at random moments: what is lost")
    c.add_argument("--json", type=Path, default=Path("out/kills.json"))
    c.add_argument("--samples", type=int, default=8192)
    c.add_argument("--times", type=int, default=20)
    c.add_argument("--seed", type=int, default=0)
    c.set_defaults(run=_kills)
