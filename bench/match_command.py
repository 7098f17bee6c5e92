"""The command `match` of the bench."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any


def add(commands: Any) -> None:
    """Add the command to the parser of `python -m bench`."""
    c = commands.add_parser("match", help="a hidden HDRI's look, found from its picture")
    c.add_argument("--json", type=Path, default=Path("out/match.json"))
    c.add_argument("--scenes", nargs="+")
    c.add_argument("--worlds", nargs="+", help="those that are hidden, of Blender's HDRIs")
    c.add_argument("--width", type=int, default=240)
    c.add_argument("--samples", type=int, default=64, help="of the captures")
    c.add_argument("--sheet", type=Path, help="a PNG of all cases, to write")
    c.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> None:
    from . import worlds
    from .match import SCENES, match, table

    size = (options.width, options.width * 3 // 4)
    hdris = options.worlds or worlds.hdri_names()
    rows = match(
        options.json,
        options.scenes or SCENES,
        hdris,
        size,
        options.samples,
        options.sheet,
    )
    print(table(rows))
