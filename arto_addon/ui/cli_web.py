"""The verb `web` of the command line: a page in which anyone turns the light of the shot."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import bpy

from ..web.make import make
from ..work import Steps


def add(one: argparse.ArgumentParser, path: Any) -> None:
    """Add the options. path: what makes a path of a text."""
    one.add_argument("out", type=path, metavar="FOLDER", help="gets the page")
    one.add_argument(
        "--worlds", nargs="+", type=path, help="environment maps, in place of the looks' worlds"
    )


def work_of(scene: bpy.types.Scene, layer: str, options: dict[str, Any]) -> Steps[object]:
    """The work of the verb; takes its options out of `options`."""
    files: list[Path] = [file.resolve() for file in options.pop("worlds") or ()]
    return make(scene, layer, options.pop("out").resolve(), files)
