"""The verb `photograph` of the command line: a scene as a laboratory would photograph a thing."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import bpy

from ...core.faces import FACE_NAMES, PRESETS
from ...core.photographs.description import LINEAR, SRGB, Monitors
from ...core.photographs.photographer import Exposing
from ...core.photographs.shown import patterns_of
from ...core.photographs.simulate import Camera
from ..photographer.photograph import Setup, photograph
from ..work import Steps

NAMES = (
    *("out", "rig", "sides", "patches", "patterns", "monitor", "distance", "falls", "black"),
    *("lamps", "above", "samples", "bits", "exposures", "stops", "electrons", "read_noise"),
    *("curve", "jpeg", "seed"),
)


def add(one: argparse.ArgumentParser, path: Any, whole: Any, number: Any) -> None:
    """Add the options. path, whole, number: what makes a path, a number from 1 and a number of a
    text."""
    one.add_argument("out", type=path, metavar="FOLDER", help="gets the photographs and the truth")
    one.add_argument("--rig", choices=("monitors", "dome"), default="monitors")
    one.add_argument(
        "--sides", nargs="+", choices=FACE_NAMES, default=PRESETS["paper"], help="with a monitor"
    )
    one.add_argument("--patches", type=whole, default=4, help="along a side of a monitor")
    one.add_argument("--patterns", default="moments_uv", help="paper, moments_uv, linear, packed")
    one.add_argument("--monitor", type=whole, nargs=2, default=(1920, 1080), help="its pixels")
    one.add_argument(
        "--distance",
        type=number,
        default=0.0,
        help="of the monitors from the middle, in radii of the scene (0: at infinity)",
    )
    one.add_argument(
        "--falls", type=number, default=0.0, help="the power of the cosine by which light falls off"
    )
    one.add_argument(
        "--black", type=number, default=0.002, help="the light of black, as a share of white's"
    )
    one.add_argument("--lamps", type=whole, default=64, help="of a dome")
    one.add_argument("--above", action="store_true", help="no lamps under the ground")
    one.add_argument("--samples", type=whole, default=1024, help="of the render")
    one.add_argument("--bits", type=int, choices=range(8, 17), default=8, help="of the camera")
    one.add_argument("--exposures", type=whole, default=3, help="of each light")
    one.add_argument("--stops", type=number, default=3.0, help="between two exposures")
    one.add_argument(
        "--electrons", type=number, default=20_000.0, help="that fill a pixel (0: no noise)"
    )
    one.add_argument("--read-noise", type=number, default=5.0, help="electrons")
    one.add_argument("--curve", choices=(SRGB, LINEAR), default=SRGB, help="of the camera")
    one.add_argument("--jpeg", action="store_true", help="write JPEG files, not PNG")
    one.add_argument("--seed", type=int, default=0, help="of the camera's noise")


def work_of(scene: bpy.types.Scene, layer: str, options: dict[str, Any]) -> Steps[Path]:
    """The work that the options ask for. Takes its options out. Raises PhotographsError,
    PatternError."""
    given = {name: options.pop(name) for name in NAMES}
    width, height = given["monitor"]
    monitors = Monitors(
        tuple(f for f in FACE_NAMES if f in given["sides"]),
        given["patches"],
        given["patterns"],
        width,
        height,
    )
    patterns_of(monitors)
    electrons = given["electrons"] or float("inf")
    noise = given["read_noise"] if given["electrons"] else 0.0
    setup = Setup(
        rig=given["rig"],
        monitors=monitors,
        distance=given["distance"],
        falls=given["falls"],
        black=given["black"],
        lamps=given["lamps"],
        above=given["above"],
        camera=Camera(given["bits"], electrons, noise, given["curve"]),
        exposing=Exposing(given["exposures"], given["stops"]),
        samples=given["samples"],
        jpeg=given["jpeg"],
        seed=given["seed"],
    )
    return photograph(scene, layer, given["out"].resolve(), setup)
