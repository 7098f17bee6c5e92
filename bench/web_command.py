"""The command `web`, apart from what it needs Blender for."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any


def add(commands: Any) -> None:
    """Add the command to the parser's commands."""
    c = commands.add_parser("web", help="pages that relight, beside the plates")
    c.add_argument("--json", type=Path, default=Path("out/web.json"))
    c.add_argument("--scenes", nargs="+")
    c.add_argument("--worlds", nargs="+", default=["courtyard", "sunset", "studio"])
    c.add_argument("--width", type=int, default=480)
    c.add_argument("--samples", type=int, default=64)
    c.set_defaults(run=_web)


def _web(options: argparse.Namespace) -> None:
    from . import scenes
    from .web import table, web

    size = (options.width, options.width * 3 // 4)
    names = options.scenes or list(scenes.SCENES)
    print(table(web(options.json, names, options.worlds, size, options.samples)))
