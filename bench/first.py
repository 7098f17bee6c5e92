"""The first picture: seconds from the click on Capture to the first live picture, in the window.

The real Blender with the extension installed, on a display of its own. It needs Linux, xvfb-run,
and BLENDER, the command line of the Blender executable.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .apart import ROOT, Row
from .machine import write_rows

# Saves a scene, in Blender without a window: the file, its name, width, height, samples, share.
MAKE = """
import sys
path, name, width, height, samples, share = sys.argv[-6:]
sys.path.insert(0, sys.argv[-7])
import bpy
from bench import heavy_scenes, scenes, worlds

size = int(width), int(height)
if name == "product":
    scene = scenes.product_shot(width=size[0], height=size[1])
    worlds.set_world_hdri(scene, "forest")
else:
    scene = heavy_scenes.SCENES[name](*size, float(share))
bpy.ops.preferences.addon_enable(module="bl_ext.user_default.arto")
scene.arto.quality, scene.arto.samples = "CUSTOM", int(samples)
bpy.ops.wm.save_as_mainfile(filepath=path)
"""

# Clicks in the window, and writes down what was seen when.
CLICK = """
import glob, json, os, sys, time
import bpy

out, whole = sys.argv[-2], sys.argv[-1] == "whole"
live, session, status, paths = (
    next(m for n, m in sys.modules.items() if n.endswith(".arto_addon." + name))
    for name in ("live.live", "job.session", "shot.status", "shot.paths")
)
found, begun = {}, 0.0


def work():
    # seconds of all threads, of this process and of those that it has started
    of = {}
    for path in glob.glob("/proc/[0-9]*/stat"):
        try:
            with open(path) as file:
                pid, rest = file.read().split(" (", 1)
        except OSError:
            continue
        values = rest.rsplit(") ", 1)[1].split()
        of[int(pid)] = int(values[1]), sum(map(int, values[11:15]))
    ours = {os.getpid()}
    while more := {pid for pid, (parent, _) in of.items() if parent in ours} - ours:
        ours |= more
    return sum(of[pid][1] for pid in ours if pid in of) / os.sysconf("SC_CLK_TCK")


def note(name, value):
    if name not in found:
        found[name] = value
        print("ARTO first:", name, value, flush=True)


def look():
    global begun
    now = time.perf_counter()
    window = bpy.context.window_manager.windows[0]
    if not begun:
        begun, found["work"] = now, work()
        with bpy.context.temp_override(window=window):
            bpy.ops.arto.shoot("INVOKE_DEFAULT")
        return 0.02
    job, on = session.current, live.current
    if on is not None and "ARTO Live" in bpy.data.images and on.opened.draft:
        if "seconds" not in found:
            note("cpu_seconds", work() - found["work"])
        note("seconds", now - begun)
        note("line", on.line)
        scene = bpy.context.scene
        heads = status.stopped(paths.place(scene).source)
        if heads and heads[0].hemicube == on.opened.field.hemicube and on.settled:
            note("draft_seconds", now - begun)
            note("pace", heads[0].others.get("pace"))
            note("at", now)
    ended = job is None or session.outcome is not None
    told = job is not None and job.state.left is not None and "at" in found
    # what a capture says that it takes, once it had the time to look at itself
    told = told and now - found["at"] > 20
    if ended or (told and not whole):
        note("capture_seconds", now - begun if ended else job.state.spent + job.state.left)
        note("measured", ended)
        note("capture_cpu", work() - found["work"])
        note("outcome", session.outcome.text if session.outcome else "")
        with open(out, "w") as file:
            json.dump(found, file)
        bpy.ops.wm.quit_blender()
    return 0.02


bpy.context.preferences.view.show_splash = False
bpy.app.timers.register(look, first_interval=4.0)
"""


def first(
    scenes: list[str], sizes: list[tuple[int, int]], samples: int, share: float, whole: bool
) -> Iterator[Row]:
    """A row for each scene and size.

    seconds: from the click to the first live picture; draft_seconds: to the larger draft;
    capture_seconds: of the whole, plate included, or what it told of itself where that is not
    `measured`; limit: 10 s and what Cycles takes to prepare the scene; cpu_seconds, capture_cpu: of
    all threads, until the first picture and until the end, which other programs on the machine
    change less. share: of each heavy scene's triangles.
    """
    from tools import package

    blender = shlex.split(os.environ.get("BLENDER", ""))
    if not blender:
        raise SystemExit("BLENDER is not set: it is the command line of the Blender executable")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        environment = {**os.environ, "BLENDER_USER_RESOURCES": str(folder / "user")}

        def run(*command: str | Path) -> None:
            line = list(map(str, command))
            done = subprocess.run(line, cwd=ROOT, env=environment, capture_output=True, text=True)
            if done.returncode:
                raise RuntimeError(
                    f"{line[:3]} failed:\n{done.stdout[-2000:]}{done.stderr[-2000:]}"
                )

        install = ("--command", "extension", "install-file", "-r", "user_default", "--enable")
        run(*blender, *install, package.build())
        (folder / "make.py").write_text(MAKE)
        (folder / "click.py").write_text(CLICK)
        for i, (scene, size) in enumerate((s, size) for s in scenes for size in sizes):
            at, out = folder / str(i), folder / str(i) / "found.json"
            at.mkdir()
            of = (ROOT, at / "scene.blend", scene, *map(str, size), str(samples), str(share))
            run(
                *blender, "-b", "--python-exit-code", "1", "--python", folder / "make.py", "--", *of
            )
            display = ("xvfb-run", "-a", "-s", "-screen 0 1600x900x24", *blender)
            window = ("-p", "0", "0", "1600", "900", at / "scene.blend")
            words = ("--", out, "whole" if whole else "told")
            run(*display, *window, "--python", folder / "click.py", *words)
            yield _row(scene, size, samples, json.loads(out.read_text()))


def _row(scene: str, size: tuple[int, int], samples: int, found: dict[str, Any]) -> Row:
    if "seconds" not in found:
        raise RuntimeError(f"'{scene}' showed nothing before its end: {found.get('outcome')}")
    ready = (found.get("pace") or [0.0])[0]
    names = ("seconds", "draft_seconds", "capture_seconds", "measured", "line")
    names = (*names, "cpu_seconds", "capture_cpu")
    about = {"scene": scene, "width": size[0], "height": size[1], "samples": samples}
    return about | {n: found.get(n) for n in names} | {"prepared": ready, "limit": 10 + ready}


def table(rows: list[Row]) -> str:
    """Markdown."""
    head = ["scene", "size", "samples", "first picture, s", "of threads", "draft, s"]
    head += ["capture, s", "of threads", "limit, s"]
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for r in rows:
        told = "" if r["measured"] else " (told)"
        draft = f"{r['draft_seconds']:.1f}" if r["draft_seconds"] else ""
        cells = [r["scene"], f"{r['width']}x{r['height']}", str(r["samples"])]
        cells += [f"{r['seconds']:.1f}", f"{r['cpu_seconds']:.1f}", draft]
        cells += [f"{r['capture_seconds']:.0f}{told}", f"{r['capture_cpu']:.0f}" * r["measured"]]
        cells.append(f"{r['limit']:.1f}")
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _first(options: argparse.Namespace) -> None:
    sizes = [(int(w), int(h)) for w, h in (size.split("x") for size in options.sizes)]
    rows: list[Row] = []
    of = options.scenes, sizes, options.samples, options.share, options.whole
    for row in first(*of):
        rows.append(row)
        write_rows(options.json, rows)
    print(table(rows))


def add(commands: Any) -> None:
    """Add the command to the parser of `python -m bench`."""
    c = commands.add_parser("first", help="from the click to the first live picture")
    c.add_argument("--json", type=Path, default=Path("out/first.json"))
    c.add_argument("--scenes", nargs="+", default=["product", "6 M triangles"])
    c.add_argument("--sizes", nargs="+", default=["1920x1080"])
    c.add_argument("--samples", type=int, default=64)
    c.add_argument("--share", type=float, default=1.0, help="of a heavy scene's triangles")
    c.add_argument("--whole", action="store_true", help="wait for the plate; else what it tells")
    c.set_defaults(run=_first)
