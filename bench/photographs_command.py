"""The command `photographs` of the bench."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any


def add(commands: Any) -> None:
    """Add the command to the parser of `python -m bench`."""
    c = commands.add_parser("photographs", help="a laboratory's capture, simulated, against Cycles")
    c.add_argument("--json", type=Path, default=Path("out/photographs.json"))
    c.add_argument("--scenes", nargs="+", default=["four_spheres"])
    c.add_argument("--worlds", nargs="+", help="Blender's HDRIs")
    c.add_argument("--width", type=int, default=240)
    c.add_argument("--samples", type=int, default=1024, help="of the light without a camera")
    c.add_argument("--many", type=int, default=512, help="samples of a reference")
    c.add_argument("--plan", action="store_true", help="change one thing at a time, for planning")
    c.add_argument("--only", type=int, nargs="+", help="numbers of the captures, from 0")
    c.add_argument("--sheet", type=Path, help="a PNG of the captures, to write")
    c.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> None:
    from .photographs import HDRIS, photographs, shown_cases, sweep, table

    size = (options.width, options.width * 3 // 4)
    cases = sweep() if options.plan else shown_cases()
    rows = photographs(
        options.json,
        options.scenes,
        options.worlds or HDRIS,
        size,
        options.samples,
        options.many,
        [cases[i] for i in options.only] if options.only else cases,
        options.sheet,
    )
    print(table(rows))
