"""`blender scene.blend --command arto capture|fit|relight`: the same work, with options."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import bpy

from ...core.choice import CHOICES
from ...core.errors import ArtoError, CancelledError
from ...core.hemicube import FACE_NAMES, PRESETS
from ...core.patterns import PATTERN_SETS
from ..capture.capture import capture
from ..fit import fit
from ..relight.relight import relight
from ..work import ProgressLines, run

_commands: list[Any] = []


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="blender SCENE.blend --command arto",
        description="Capture how the scene answers light, fit it, and relight it with its world.",
        epilog="Exit codes: 0 done, 1 failed, 2 wrong options, 130 cancelled.",
    )
    jobs = parser.add_subparsers(dest="job", required=True)
    files = argparse.ArgumentParser(add_help=False)
    files.add_argument("--scene", help="name of the scene (default: the .blend's)")
    files.add_argument("--folder", help="where capture set and field are kept (default: //arto/)")

    job = jobs.add_parser("capture", parents=[files], help="render the basis images")
    job.add_argument("--preset", choices=sorted(PRESETS))
    job.add_argument("--faces", nargs="+", choices=FACE_NAMES)
    job.add_argument("--patches", type=int, help="patches a side, 1 to 16")
    adaptive = "patches of the size that the scene needs"
    job.add_argument(
        "--adaptive", action=argparse.BooleanOptionalAction, default=None, help=adaptive
    )
    job.add_argument("--patterns", choices=sorted(PATTERN_SETS))
    job.add_argument("--route", choices=("all", "pattern", "single"), help="how many renders")
    job.add_argument("--samples", type=int)
    job.add_argument("--seed", type=int)
    job.add_argument("--memory", type=int, help="megabytes for the passes of one render")

    job = jobs.add_parser("fit", parents=[files], help="fit the reflectance field")
    job.add_argument("--support", choices=CHOICES)
    separate = "a support for each channel"
    job.add_argument(
        "--separate", action=argparse.BooleanOptionalAction, default=None, help=separate
    )

    job = jobs.add_parser("relight", parents=[files], help="relight with the scene's world")
    job.add_argument("--own-lamps", type=float, help="how much of the scene's own lamps to add")
    lamps = "a render of their own for the suns and lamps of the world"
    job.add_argument("--lamps", action=argparse.BooleanOptionalAction, default=None, help=lamps)
    job.add_argument("--lamp-samples", type=int)
    job.add_argument("--environment-width", type=int)
    job.add_argument("--denoise", action=argparse.BooleanOptionalAction, default=None)
    job.add_argument("--output", help="the EXR to write (default: beside the .blend)")
    return parser


def main(arguments: list[str]) -> int:
    """Run one job; the exit code."""
    try:
        options = vars(_parser().parse_args(arguments))
    except SystemExit as e:
        return int(e.code or 0)
    job, name = options.pop("job"), options.pop("scene")
    scene = bpy.data.scenes.get(name) if name else bpy.context.scene
    if scene is None:
        print(f"ARTO: there is no scene '{name}'", file=sys.stderr)
        return 2
    layer = scene.view_layers[0].name
    if scene == bpy.context.scene:
        layer = bpy.context.view_layer.name
    for path in ("folder", "output"):
        given = options.get(path)
        if given and not given.startswith("//"):
            options[path] = str(Path(given).resolve())
    if options.get("faces"):
        options["faces"] = set(options["faces"])
        options["preset"] = "custom"
    for key, value in options.items():
        if value is not None:
            setattr(scene.arto, key, value)
            taken = getattr(scene.arto, key)
            if isinstance(value, int | float) and abs(taken - value) > 1e-6 * abs(value):
                option = key.replace("_", "-")
                print(f"ARTO: --{option} {value} is out of range", file=sys.stderr)
                return 2
    steps = {
        "capture": lambda: capture(scene, layer),
        "fit": lambda: fit(scene),
        "relight": lambda: relight(scene),
    }[job]
    try:
        run(steps(), ProgressLines(job))
    except CancelledError as e:
        print(f"ARTO: {e}", file=sys.stderr)
        return 130
    except ArtoError as e:
        print(f"ARTO: {e}", file=sys.stderr)
        return 1
    return 0


def register() -> None:
    _commands.append(bpy.utils.register_cli_command("arto", main))


def unregister() -> None:
    while _commands:
        bpy.utils.unregister_cli_command(_commands.pop())
