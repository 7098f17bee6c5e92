"""`python -m bench mirrors`: its options, and what it does with them."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any


def _mirrors(options: argparse.Namespace) -> None:
    from . import mirrors

    cases = mirrors.QUICK if options.quick else mirrors.CASES
    if options.scenes:
        every = {**dict.fromkeys(options.scenes, ("courtyard", "interior")), **cases}
        cases = {s: every[s] for s in options.scenes}
    if options.worlds:
        cases = {s: tuple(options.worlds) for s in cases}
    settings = {}
    for text in options.set:
        name, value = text.split("=", 1)
        given = {"true": True, "false": False}.get(value.lower(), value)
        settings[name] = int(value) if value.isdigit() else given
    rows = []
    for width in options.widths or ([480] if options.quick else [480, 960]):
        size = (width, width * 3 // 4 if width == 480 else width * 9 // 16)
        out = options.json.with_stem(f"{options.json.stem}_{width}") if rows else options.json
        rows += mirrors.mirrors(
            out, cases, size, options.samples, options.many, settings, options.sheet, options.label
        )
    print(mirrors.table(rows))


def add(commands: Any) -> None:
    """Add the command to the parser of `python -m bench`."""
    c = commands.add_parser("mirrors", help="mirrors, glass and coat at the size of a shot")
    c.add_argument("--json", type=Path, default=Path("out/mirrors.json"))
    c.add_argument("--quick", action="store_true", help="one size, a world or two a scene")
    c.add_argument("--sheet", type=Path, help="a PNG of crops, to write")
    c.add_argument("--scenes", nargs="+")
    c.add_argument("--worlds", nargs="+")
    c.add_argument("--widths", nargs="+", type=int)
    c.add_argument("--samples", nargs="+", type=int, default=[64])
    c.add_argument("--many", type=int, default=256, help="samples of each of two references")
    c.add_argument("--set", nargs="*", default=[], help="the add-on's settings: patterns=moments")
    c.add_argument("--label", default="arto", help="what ARTO is called in the rows")
    c.set_defaults(run=_mirrors)
