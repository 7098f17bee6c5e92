"""Speed: every stage beside what it cannot be faster than, by size, with memory and disk.

Each stage runs in a process of its own: its peak is of that process alone. `where` says in which
Python: that of the module, or once that of the real program, whose numpy is another build.
"""

from __future__ import annotations

import math
import os
import shlex
import sys
import tempfile
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from .apart import ROOT, rows_of, tell
from .machine import write_rows
from .speed_stages import PATCHES, STAGES, Row, Size

LIMITS = {
    "capture and fit": "a plain render of the same samples",
    "fit": "reading its images",
    "synthetic fit": "making its images",
    "field write": "writing as many bytes",
    "relight sum": "reading the field",
    "denoise": "one pass of the denoiser",
    "relight": "one pass of the denoiser",
    "turntable": "as many relights, none denoised",
    "snapshot": "saving the file",
}
CYCLES = ("plain", "plain_denoised", "snapshot", "probe", "capture_and_fit", "relights")
# In the real program: what it runs is text, since it has no way in for a module.
IN_PROGRAM = """
import importlib.util, json, sys
from pathlib import Path
root = Path({root!r})
for name, folder in (("arto", root), ("bench", root / "bench")):
    spec = importlib.util.spec_from_file_location(
        name, folder / "__init__.py", submodule_search_locations=[str(folder)]
    )
    sys.modules[name] = importlib.util.module_from_spec(spec)
from bench import speed
speed.child({name!r}, {size!r}, {folder!r})
"""


def child(name: str, size: dict[str, Any], folder: str) -> None:
    """Run a stage here, and print its rows as a line of JSON."""
    tell(STAGES[name](Size(**size), Path(folder)))


def _run(name: str, size: Size, folder: Path, program: str = "") -> list[Row]:
    """The rows of a stage, run in a process of its own; program: the command of the real one."""
    values = {"root": str(ROOT), "name": name, "size": asdict(size), "folder": str(folder)}
    if program:
        line = [*shlex.split(program), "-b", "--python-exit-code", "1"]
        line += ["--python-expr", IN_PROGRAM.format(**values)]
    else:
        text = f"from bench.speed import child; child({name!r}, {asdict(size)!r}, {str(folder)!r})"
        line = [sys.executable, "-c", text]
    rows, peak = rows_of(line, f"{name} at {size}")
    where = "program" if program else "module"
    about = {"width": size.width, "height": size.height, "samples": size.samples, "where": where}
    # of the process: the program's may be of what sets it up
    about["peak_bytes"] = peak
    return [about | row for row in rows]


def speed(
    out: Path, quick: bool, samples: int, only: list[tuple[int, int]] | None = None
) -> list[Row]:
    """All rows, written after every stage. only: of these sizes."""
    sizes = [(480, 270)] if quick else [(480, 270), (960, 540), (1920, 1080)]
    made = [(240, 135), (480, 270)] if quick else [*sizes, (3840, 2160)]
    if only:
        sizes, made = ([s for s in some if s in only] for some in (sizes, made))
    turns = 12 if quick else 72
    rows: list[Row] = []

    def take(name: str, size: Size, folder: Path, program: str = "") -> None:
        rows.extend(_run(name, size, folder, program))
        for row in rows:
            if row.get("limit_seconds"):
                row["ratio"] = row["seconds"] / row["limit_seconds"]
        write_rows(out, rows)
        print(f"{name} {size.width}x{size.height} {size.patches} patches done", flush=True)

    with tempfile.TemporaryDirectory() as temporary:
        root = Path(temporary)
        for width, height in sizes:
            size = Size(width, height, samples, turns=turns if height < 1000 else turns // 3)
            folder = root / f"{width}"
            folder.mkdir()
            for name in CYCLES:
                take(name, size, folder)
                if name == "capture_and_fit":
                    before = next(r for r in reversed(rows) if r["stage"] == "plain render")
                    rows[-1]["limit_seconds"] = before["seconds"]
                    rows[-1]["over_blender_bytes"] = rows[-1]["peak_bytes"] - before["peak_bytes"]
            rows += _break_even(rows, width)
            if height < 1000:  # its images would be a hundred gigabytes of reading
                take("fits", size, folder)
        for i, (width, height) in enumerate(made):
            take("synthetic", Size(width, height, samples), _new(root / f"made_{i}"))
        for patches in () if only else (PATCHES // 4, PATCHES // 2):
            size = replace(Size(*made[0], samples), patches=patches)
            take("synthetic", size, _new(root / f"patches_{patches}"))
        if not only and (program := os.environ.get("BLENDER")):
            take("synthetic", Size(*made[0], samples), _new(root / "program"), program)
    rows += slopes(rows)
    write_rows(out, rows)
    return rows


def _new(folder: Path) -> Path:
    folder.mkdir()
    return folder


def _break_even(rows: list[Row], width: int) -> list[Row]:
    """After how many relights capturing was the quicker way, at equal samples."""
    seconds = {r["stage"]: r["seconds"] for r in rows if r["width"] == width}
    saved = seconds["plain render, denoised"] - seconds["relight with lamps"]
    count = math.ceil(seconds["capture and fit"] / saved) if saved > 0 else None
    row = {"stage": "break-even", "relights": count, "width": width, "where": "module"}
    return [row | {"height": next(r["height"] for r in rows if r["width"] == width)}]


def slopes(rows: list[Row]) -> list[Row]:
    """How a stage's seconds grow: the exponent of pixels and of patches, the gain of threads."""
    found = []
    plain = [r for r in rows if r["where"] == "module" and "seconds" in r]
    for stage in dict.fromkeys(r["stage"] for r in plain):
        mine = [r for r in plain if r["stage"] == stage and "threads" not in r]
        full = [r for r in mine if r.get("patches", PATCHES) >= 0.9 * PATCHES]
        found += _slope(stage, "pixels", [(r["width"] * r["height"], r["seconds"]) for r in full])
        few = [r for r in mine if "patches" in r and r["width"] == min(r["width"] for r in mine)]
        found += _slope(stage, "patches", [(r["patches"], r["seconds"]) for r in few])
    threads = [r for r in plain if "threads" in r]
    for one, two in zip(threads[::2], threads[1::2], strict=True):
        gain = one["seconds"] / two["seconds"]
        found.append({"stage": "relight sum", "grows_with": "threads", "width": one["width"],
                      "height": one["height"], "slope": math.log2(gain)})  # fmt: skip
    return found


def _slope(stage: str, of: str, points: list[tuple[float, float]]) -> list[Row]:
    points = sorted(set(points))
    if len({x for x, _ in points}) < 2:
        return []
    (x0, y0), (x1, y1) = points[0], points[-1]
    return [{"stage": stage, "grows_with": of, "slope": math.log(y1 / y0) / math.log(x1 / x0)}]


def table(rows: list[Row]) -> str:
    """Markdown."""
    lines = ["| stage | size | where | seconds | limit | ratio | peak | disk |", "|---" * 8 + "|"]
    for r in rows:
        if "seconds" not in r:
            continue
        limit = f"{r['limit_seconds']:.2f}" if "limit_seconds" in r else ""
        ratio = f"{r['ratio']:.2f}" if "ratio" in r else ""
        disk = f"{r['disk_bytes'] / 1e6:.0f} MB" if "disk_bytes" in r else ""
        what = r["stage"] + (f", {r['patches']} patches" if "patches" in r else "")
        what += f", {r['threads']} threads" if "threads" in r else ""
        cells = [what, f"{r['width']}x{r['height']}", r["where"], f"{r['seconds']:.2f}", limit]
        peak = f"{r['peak_bytes'] / 1e9:.2f} GB"
        lines.append(f"| {' | '.join([*cells, ratio, peak, disk])} |")
    for r in rows:
        if "slope" in r:
            at = f" at {r['width']}x{r['height']}" if "width" in r else ""
            lines.append(f"\n{r['stage']} grows with {r['grows_with']}{at} by {r['slope']:.2f}")
        elif r["stage"] == "break-even":
            lines.append(f"\nbreak-even at {r['width']}x{r['height']}: {r['relights']} relights")
    lines += ["", *(f"- the limit of {stage}: {what}" for stage, what in LIMITS.items())]
    return "\n".join(lines)
