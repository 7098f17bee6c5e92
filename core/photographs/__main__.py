"""`python -m core.photographs`: what a laboratory does without Blender (paper 4.2).

`patterns` writes the pictures that monitors show, and the list of the photographs to take.
`calibrate` writes the curve and the fall-off of the monitor, by photographs of its greys, into the
description of a folder.

Examples
--------
>>> sides("left,top")
('top', 'left')
>>> size("1920x1080")
(1920, 1080)
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from ..errors import ArtoError, ExrError, PhotographsError
from ..exr.open_image_io import imported
from ..faces import FACE_NAMES
from . import description_file
from .description import Description, Kind, Monitors
from .monitor_set import calibrated
from .opened import Photographs
from .reader import by_openimageio
from .screens import hemicube_of, hole
from .shown import write


def sides(text: str) -> tuple[str, ...]:
    """Read names of sides, as in `left,right`.

    Parameters
    ----------
    text : str

    Returns
    -------
    tuple of str
        In the order of `faces.FACE_NAMES`.

    Raises
    ------
    argparse.ArgumentTypeError
        There is no such side.
    """
    names = [name.strip() for name in text.split(",")]
    if unknown := [name for name in names if name not in FACE_NAMES]:
        raise argparse.ArgumentTypeError(
            f"there is no side '{unknown[0]}': choose from {', '.join(FACE_NAMES)}"
        )
    return tuple(name for name in FACE_NAMES if name in names)


def size(text: str) -> tuple[int, int]:
    """Read the size of a monitor, as in `1920x1080`.

    Parameters
    ----------
    text : str

    Returns
    -------
    tuple of int
        Width and height in pixels.

    Raises
    ------
    argparse.ArgumentTypeError
        The text is no size.
    """
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal() and 8 <= int(width) <= 16384):
        raise argparse.ArgumentTypeError(f"'{text}' is no size: write 1920x1080")
    if not 8 <= int(height) <= 16384:
        raise argparse.ArgumentTypeError(f"'{text}' is no size: write 1920x1080")
    return int(width), int(height)


def seconds(text: str) -> tuple[float, ...]:
    """Read exposures, as in `1/250,1/30,0.5`.

    Parameters
    ----------
    text : str

    Returns
    -------
    tuple of float
        Seconds.

    Raises
    ------
    argparse.ArgumentTypeError
        One is no time.
    """
    out = []
    for part in text.split(","):
        over, _, under = part.strip().partition("/")
        try:
            out.append(float(over) / float(under or 1))
        except (ValueError, ZeroDivisionError):
            out.append(0.0)
        if not 0 < out[-1] < 1e6:
            raise argparse.ArgumentTypeError(f"'{part}' is no exposure: write 1/30 or 0.5")
    return tuple(out)


def parser() -> argparse.ArgumentParser:
    """Make the parser of the command line.

    Returns
    -------
    argparse.ArgumentParser
    """
    out = argparse.ArgumentParser(prog="python -m core.photographs", description=__doc__)
    verbs = out.add_subparsers(dest="verb", required=True)
    one = verbs.add_parser("patterns", help="write what monitors show, and what to photograph")
    one.add_argument("folder", type=Path, help="gets the folder show, and photographs.json")
    one.add_argument("--monitor", type=size, default=(1920, 1080), help="its pixels")
    one.add_argument("--sides", type=sides, default=("top", "left", "right", "back"))
    one.add_argument("--patches", type=int, default=4, help="along a side of a monitor")
    one.add_argument(
        "--patterns", default="moments_uv", help="paper, moments_uv, moments, linear, packed, white"
    )
    one.add_argument(
        "--exposures", type=seconds, default=(1.0,), help="seconds, as in 1/250,1/30,1/4"
    )
    one.add_argument("--ending", default="jpg", help="of the camera's files")
    one.add_argument(
        "--like",
        type=Path,
        metavar="JSON",
        help="a photographs.json with the monitors: their corners, their measured curve, and how "
        "they fall off",
    )
    one = verbs.add_parser("calibrate", help="measure the monitor by photographs of its greys")
    one.add_argument("folder", type=Path, help="has photographs.json and the photographs of greys")
    return out


def main(arguments: Sequence[str]) -> int:
    """Do what a command line asks for.

    Parameters
    ----------
    arguments : sequence of str

    Returns
    -------
    int
        The exit code.
    """
    options = parser().parse_args(arguments)
    try:
        print({"patterns": _patterns, "calibrate": _calibrate}[options.verb](options))
    except ArtoError as e:
        print(f"ARTO: {e}", file=sys.stderr)
        return 1
    return 0


def _patterns(options: argparse.Namespace) -> str:
    width, height = options.monitor
    monitors = Monitors(options.sides, options.patches, options.patterns, width, height)
    said = Description((), monitors=monitors)
    if options.like:
        said = description_file.read(options.like)
        monitors = said.monitors or monitors
    shown = write(options.folder, monitors, options.exposures, options.ending, said.view)
    cube = hemicube_of(monitors, said.view)
    count = len(description_file.read(options.folder / description_file.FILE).photographs)
    curve = "their measured curve" if monitors.curve else "an assumed curve, a power of 2.2"
    return (
        f"{shown} pictures to show in {options.folder / 'show'}, by {curve}. {count} photographs "
        f"to take are in {options.folder / description_file.FILE}. {len(cube)} patches light "
        f"{1 - hole(cube):.0%} of all directions; from the others no light will come."
    )


def _calibrate(options: argparse.Namespace) -> str:
    try:
        library = imported(())
    except ExrError as e:
        raise PhotographsError(
            "photographs are read by a library that is missing: install ARTO's extra 'photographs'"
        ) from e
    path = options.folder / description_file.FILE
    said = description_file.read(path)
    greys = tuple(p for p in said.of(Kind.STEP) if (options.folder / p.file).is_file())
    if not greys:
        raise PhotographsError(f"{options.folder} has no photographs of greys: see {path}")
    some = Photographs(options.folder, replace(said, photographs=greys), by_openimageio(library))
    measured = calibrated(some.said, some.light)
    description_file.write(options.folder, replace(said, monitors=measured.monitors))
    return (
        f"{path} has the monitor's curve now, by {len(greys)} photographs: black is "
        f"{measured.black:.2%} of white, and light falls off as the cosine to the power of "
        f"{measured.monitors.falls:.2f}. Write the patterns again: patterns FOLDER --like {path}"
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
