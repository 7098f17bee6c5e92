"""The verb `sheet` of the command line: plates by lights, cameras and frames in one picture."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import bpy

from ..sheet.make import make
from ..work import Batch, Steps


def add(one: argparse.ArgumentParser, path: Any, text: Any, frames: Any) -> None:
    """Add the options. path, text, frames: what makes these of a text."""
    one.add_argument("out", type=path, metavar="FILE", help="the sheet, a PNG file")
    one.add_argument(
        "--worlds", nargs="+", type=path, help="environment maps, in place of the looks' worlds"
    )
    one.add_argument("--frames", type=frames, help="first and last frame, and a step: 1-100:10")
    one.add_argument(
        "--cameras", nargs="+", type=text, help="cameras by name (default: the scene's)"
    )


def work_of(
    scene: bpy.types.Scene, layer: str, options: dict[str, Any], batch: Batch
) -> Steps[object]:
    """The work of the verb; takes its options out of `options`."""
    out: Path = options.pop("out").resolve()
    files = [file.resolve() for file in options.pop("worlds") or ()]
    frames, cameras = options.pop("frames") or (), options.pop("cameras") or ()
    return make(scene, layer, out, files, frames, cameras, batch)
