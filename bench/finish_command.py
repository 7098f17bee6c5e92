"""`python -m bench finish`: its options, and what it does with them."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any


def _finish(options: argparse.Namespace) -> None:
    from .finish import finish_bench

    cases = dict.fromkeys(options.scenes, tuple(options.worlds))
    size = (options.width, options.width * 3 // 4)
    finish_bench(options.json, cases, size, options.captured, options.samples, options.many)


def add(commands: Any) -> None:
    """Add the command to the parser of `python -m bench`."""
    c = commands.add_parser("finish", help="a plate and samples of a render together")
    c.add_argument("--json", type=Path, default=Path("out/finish.json"))
    c.add_argument("--scenes", nargs="+", default=["four_spheres", "product"])
    c.add_argument("--worlds", nargs="+", default=["courtyard", "interior"])
    c.add_argument("--width", type=int, default=480)
    c.add_argument("--captured", type=int, default=64, help="samples of the capture")
    c.add_argument("--samples", nargs="+", type=int, default=[32, 64, 128, 256])
    c.add_argument("--many", type=int, default=256, help="samples of each of two references")
    c.set_defaults(run=_finish)
