"""The verb `sheet` of the command line: plates in one picture, or as a turntable's movie."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import bpy

from ..sheet.make import make
from ..sheet.movie import ENDING, movie
from ..work import Batch, Steps
from .report import OptionError


def add(one: argparse.ArgumentParser, path: Any, text: Any, frames: Any, number: Any) -> None:
    """Add the options. path, text, frames, number: what makes these of a text."""
    one.add_argument("out", type=path, metavar="FILE", help="the sheet (.png) or movie (.mp4)")
    one.add_argument(
        "--worlds", nargs="+", type=path, help="environment maps, in place of the looks' worlds"
    )
    one.add_argument("--frames", type=frames, help="first and last frame, and a step: 1-100:10")
    one.add_argument("--turntable", type=number, help="a movie of so many pictures, turned around")
    one.add_argument(
        "--cameras", nargs="+", type=text, help="cameras by name (default: the scene's)"
    )


def work_of(
    scene: bpy.types.Scene, layer: str, options: dict[str, Any], batch: Batch
) -> Steps[object]:
    """The work of the verb; takes its options out of `options`. Raises OptionError."""
    out: Path = options.pop("out").resolve()
    files = [file.resolve() for file in options.pop("worlds") or ()]
    frames, cameras = options.pop("frames") or (), options.pop("cameras") or ()
    turns = options.pop("turntable")
    if turns is None and out.suffix.lower() == ENDING:
        raise OptionError(f"{out.name} is a movie, and a movie is of a turntable: add --turntable")
    if turns is not None:
        if out.suffix.lower() != ENDING:
            raise OptionError(f"a turntable is a movie: name a file that ends with {ENDING}")
        if frames or cameras:
            raise OptionError("a turntable is of one frame and camera: leave the others out")
        return movie(scene, layer, out, turns, files, batch)
    return make(scene, layer, out, files, frames, cameras, batch)
