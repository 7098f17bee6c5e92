"""Heavy scenes: how long a capture takes beside a plain render, with preparation in both.

Each stage runs in a process of its own, which renders a tiny scene, builds the real one, and is
then timed. How often Cycles prepared the scene is counted from what Cycles says (`Counted`).
"""

from __future__ import annotations

import re
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from .apart import rows_of, tell
from .machine import write_rows

Row = dict[str, Any]


@dataclass(frozen=True)
class Size:
    """Of a picture. megabytes: what a capture may take, which decides the number of its tiles."""

    width: int
    height: int
    samples: int
    megabytes: int
    share: float = 1.0


@dataclass
class Counted:
    """What Cycles said while it was listened to.

    renders: how often it began to sample; prepared_times: how often it built the tree of all
    triangles, which is done anew where any object was added, removed or changed; synchronized: how
    many objects it read from Blender, each time that it did.
    """

    renders: int = 0
    prepared_times: int = 0
    synchronized: int = 0

    def told(self, *arguments: object) -> None:
        """Hear a line of Cycles' status; a handler of `render_stats`."""
        says = str(arguments[0]) if arguments else ""
        self.prepared_times += says.endswith("Updating Scene BVH | Building")
        self.synchronized += "Synchronizing object |" in says
        self.renders += "Sample 0/" in says


@contextmanager
def counted() -> Iterator[Counted]:
    """Count how often Cycles prepares a scene while this is open."""
    import bpy

    found = Counted()

    @bpy.app.handlers.persistent  # a file that is opened meanwhile removes the others
    def told(*arguments: object) -> None:
        found.told(*arguments)

    handlers = bpy.app.handlers.render_stats
    handlers.append(told)
    try:
        yield found
    finally:
        handlers.remove(told)


def _measured(stage: str, work: Callable[[], Any]) -> Row:
    """Do a stage's work -> its row. cpu_seconds: of all threads, which other programs on the
    machine change less than seconds."""
    with counted() as count:
        begun, worked = time.perf_counter(), time.process_time()
        work()
        seconds, cpu = time.perf_counter() - begun, time.process_time() - worked
    return {"stage": stage, "seconds": seconds, "cpu_seconds": cpu, **asdict(count)}


TOLD = re.compile(r"this capture: about ([^,]+),")


def seconds_in(text: str) -> float:
    """Seconds in words, as `core.units.clock` says them."""
    units = {"s": 1, "min": 60, "h": 3600}
    found = re.findall(r"([\d.]+) (s|min|h)", text)
    return sum(float(number) * units[unit] for number, unit in found)


class Parts:
    """Where the seconds of a piece of work go, by what it says that it does."""

    def __init__(self) -> None:
        self._now = "begin", time.perf_counter(), time.process_time()
        self._found: dict[str, list[float]] = {}
        # What an estimate said, in words and when; and the seconds after it.
        self.told: float | None = None
        self.after = 0.0

    def __call__(self, step: Any) -> None:
        text, begun, worked = self._now
        if said := TOLD.search(step.text):
            self.told, self.after = seconds_in(said[1]), 0.0
        elif self.told is not None:
            self.after += time.perf_counter() - begun
        now = time.perf_counter(), time.process_time()
        part = self._found.setdefault(text, [0.0, 0.0])
        part[0] += now[0] - begun
        part[1] += now[1] - worked
        self._now = step.text, *now

    def ended(self) -> dict[str, list[float]]:
        """Seconds, and seconds of all threads, by what was done."""
        self(self)
        return {text: [round(s, 2) for s in part] for text, part in self._found.items()}

    text = ""


def _settings(scene: Any, size: Size, folder: Path) -> None:
    settings = scene.arto
    settings.folder, settings.output = str(folder / "arto"), str(folder / "relit.exr")
    settings.quality, settings.samples = "CUSTOM", size.samples
    settings.keep, settings.memory = "never", size.megabytes


def plain(scene: Any, size: Size, folder: Path) -> list[Row]:
    """The artist's own render, without denoising."""
    import bpy

    scene.cycles.samples = size.samples
    scene.render.filepath = str(folder / "plain")
    return [
        _measured("plain render", lambda: bpy.ops.render.render(scene=scene.name, write_still=True))
    ]


def capture(scene: Any, size: Size, folder: Path) -> list[Row]:
    """A capture that is fitted as it comes, and another of the same scene with one setting changed.

    told_seconds: what the capture said before its first tile that its tiles would take.
    """
    first = _captured(scene, "capture")
    # decides the capture, and nothing that a look at the scene finds
    scene.arto.samples = size.samples + 1
    return [first, _captured(scene, "capture again, one setting changed")]


def _captured(scene: Any, stage: str) -> Row:
    from arto.arto_addon import work
    from arto.arto_addon.capture.capture import capture as steps
    from arto.core.field.field import Field

    made: list[Path] = []
    parts = Parts()

    def do() -> None:
        made.append(work.run(steps(scene, scene.view_layers[0].name), parts))

    row = _measured(stage, do) | {"parts": parts.ended(), "told_seconds": parts.told}
    row["after_told_seconds"] = parts.after
    field = Field(made[0].with_name("field"))
    return row | {"tiles": len(field.tiles), "patches": len(field.hemicube)}


def probe(scene: Any, size: Size, folder: Path) -> list[Row]:
    """All that a capture does before its first tile, and the seconds that it then tells."""
    from arto.arto_addon import work
    from arto.arto_addon.capture.capture import estimate

    found: list[Any] = []
    steps = estimate(scene, scene.view_layers[0].name)
    parts = Parts()
    row = _measured("before the first tile", lambda: found.append(work.run(steps, parts)))
    return [row | {"told_seconds": found[0].seconds, "parts": parts.ended()}]


STAGES: dict[str, Callable[[Any, Size, Path], list[Row]]] = {
    "plain": plain,
    "probe": probe,
    "capture": capture,
}


def child(stage: str, name: str, size: dict[str, Any], folder: str) -> None:
    """Build a scene, run a stage of it, and print its rows as a line of JSON."""
    import bpy

    from .heavy_scenes import SCENES
    from .reference import registered

    # the first render of a process pays for loading Cycles
    SCENES["0.5 M triangles"](8, 8, 0.001).cycles.samples = 1
    bpy.ops.render.render()
    of = Size(**size)
    scene = SCENES[name](of.width, of.height, of.share)
    registered()
    _settings(scene, of, Path(folder))
    bpy.ops.wm.save_as_mainfile(filepath=str(Path(folder) / "scene.blend"))
    tell(STAGES[stage](bpy.context.scene, of, Path(folder)))


def _run(stage: str, name: str, size: Size) -> list[Row]:
    """The rows of a stage, run in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        text = f"from bench.heavy import child; child({stage!r}, {name!r}, {asdict(size)!r}, "
        line = [sys.executable, "-c", f"{text}{folder!r})"]
        rows, peak = rows_of(line, f"{stage} of '{name}'")
    about = {"scene": name, "width": size.width, "height": size.height, "samples": size.samples}
    return [about | row | {"peak_bytes": peak} for row in rows]


def heavy(
    out: Path, scenes: list[str], sizes: list[tuple[int, int]], samples: int, share: float,
    stages: list[str],
) -> list[Row]:  # fmt: skip
    """All rows, written after every stage. share: of each scene's triangles, texels and hairs."""
    rows: list[Row] = []
    for name in scenes:
        for width, height in sizes:
            # about four tiles of 200 patches under three patterns
            megabytes = max(64, width * height * 1024 // (480 * 270))
            size = Size(width, height, samples, megabytes, share)
            plain_row: Row | None = None
            for stage in stages:
                for row in _run(stage, name, size):
                    if row["stage"] == "plain render":
                        plain_row = row
                    elif row["stage"].startswith("capture") and plain_row:
                        row["limit_seconds"] = plain_row["seconds"]
                        row["ratio"] = row["seconds"] / plain_row["seconds"]
                        row["cpu_ratio"] = row["cpu_seconds"] / plain_row["cpu_seconds"]
                    rows.append(row)
                    write_rows(out, rows)
                    print(table([row]).splitlines()[-1], flush=True)
    return rows


def table(rows: list[Row]) -> str:
    """Markdown."""
    head = ["scene", "size", "samples", "stage", "seconds", "limit", "ratio", "of threads"]
    head += ["ratio of these", "prepared", "objects read", "tiles", "peak"]
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for r in rows:
        told = f", told {r['told_seconds']:.0f}" if r.get("told_seconds") else ""
        told += f" for {r['after_told_seconds']:.0f}" if r.get("after_told_seconds") else ""
        cells = [r["scene"], f"{r['width']}x{r['height']}", str(r["samples"]), r["stage"] + told]
        cells += [
            f"{r['seconds']:.1f}",
            f"{r['limit_seconds']:.1f}" if "limit_seconds" in r else "",
        ]
        cells += [f"{r['ratio']:.2f}" if "ratio" in r else "", f"{r['cpu_seconds']:.1f}"]
        cells += [f"{r['cpu_ratio']:.2f}" if "cpu_ratio" in r else "", str(r["prepared_times"])]
        cells += [
            str(r["synchronized"]),
            str(r.get("tiles", "")),
            f"{r['peak_bytes'] / 1e9:.2f} GB",
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)
