"""`python -m bench heavy`, and `first` and `kills`: what an artist waits for, and may lose."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from . import first, kills


def _heavy(options: argparse.Namespace) -> None:
    from . import heavy, heavy_scenes

    names = list(heavy_scenes.SCENES)
    wanted = [
        n for n in names if not options.scenes or any(n.startswith(w) for w in options.scenes)
    ]
    sizes = [(int(w), int(h)) for w, h in (size.split("x") for size in options.sizes)]
    rows = heavy.heavy(options.json, wanted, sizes, options.samples, options.share, options.stages)
    print(heavy.table(rows))


def add(commands: Any) -> None:
    """Add the commands to the parser of `python -m bench`."""
    first.add(commands)
    kills.add(commands)
    c = commands.add_parser("heavy", help="heavy scenes: a capture beside a plain render")
    c.add_argument("--json", type=Path, default=Path("out/heavy.json"))
    c.add_argument("--scenes", nargs="+", help="scenes that begin so: '6 M' hair")
    c.add_argument("--sizes", nargs="+", default=["480x270", "960x540"])
    c.add_argument("--samples", type=int, default=16)
    c.add_argument("--share", type=float, default=1.0, help="of triangles, texels and hairs")
    c.add_argument(
        "--stages", nargs="+", default=["plain", "probe", "capture"], help="plain probe capture"
    )
    c.set_defaults(run=_heavy)
