"""The command `place`, apart from what it needs Blender for."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any


def add(commands: Any) -> None:
    """Add the command to the parser's commands."""
    c = commands.add_parser("place", help="a light put by a click, beside Cycles' picture")
    c.add_argument("--json", type=Path, default=Path("out/place.json"))
    c.add_argument("--width", type=int, default=480)
    c.add_argument("--samples", type=int, default=64)
    c.add_argument("--picture", type=Path, help="of each click and what Cycles shows there")
    c.set_defaults(run=_place)


def _place(options: argparse.Namespace) -> None:
    from .place import place, table

    size = (options.width, options.width * 3 // 4)
    print(table(place(options.json, size, options.samples, options.picture)))
