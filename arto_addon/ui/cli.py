"""The command line: `blender scene.blend --command arto VERB`.

The verbs do what the buttons do, with settings as options. Others do the parts of a farm's job.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from pathlib import Path

import bpy

from ...core.errors import ArtoError, CancelledError
from ..capture.capture import capture, estimate
from ..capture.sequence import capture_frames
from ..farm.gather import gather
from ..farm.part import render_part, save_part
from ..farm.plan import plan
from ..fit.fit import fit
from ..job import run as job
from ..live import maps
from ..relight.many import relight_frames, relight_many
from ..relight.relight import relight
from ..settings import table
from ..settings.setting import Setting
from ..shot import paths
from ..work import Progress, ProgressLines, Render, Steps, run

_commands: list[object] = []


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="blender SCENE.blend --command arto",
        description="Capture how the scene answers light, fit it, and relight it with its world.",
        epilog="Exit codes: 0 done, 1 failed, 2 wrong options, 130 cancelled.",
    )
    jobs = parser.add_subparsers(dest="verb", required=True)
    files = argparse.ArgumentParser(add_help=False)
    files.add_argument("--scene", help="name of the scene (default: the .blend's)")
    files.add_argument("--view-layer", help="name of the view layer (default: the scene's)")
    files.add_argument("--folder", help="where capture set and field are kept (default: //arto/)")
    for name, text, settings in (
        ("capture", "render the basis images", table.options("hemicube", "capture")),
        ("fit", "fit the reflectance field", table.options("fit")),
        ("relight", "relight with the scene's world", table.options("relight")),
        ("adopt", "use what was captured for another file or scene", ()),
        (
            "plan",
            "plan a capture by many machines",
            table.options("hemicube", "capture", "fit"),
        ),
    ):
        one = jobs.add_parser(name, parents=[files], help=text)
        for setting in settings:
            _add_option(one, setting)
        if name in ("capture", "relight", "plan"):
            one.add_argument(
                "--frames",
                type=_frames,
                default=None,
                help="first and last frame, and a step: 1-24, 1-100:5 (a field for each, "
                "or a picture)",
            )
        if name == "capture":
            one.add_argument(
                "--estimate",
                action="store_true",
                help="say what it takes, as JSON in the last line, and render nothing long",
            )
        if name == "relight":
            one.add_argument(
                "--worlds", nargs="+", type=Path, help="environment maps, in the world's place"
            )
            one.add_argument(
                "--turntable", type=int, default=1, help="so many pictures, turned once around"
            )
        if name == "plan":
            one.add_argument("--job", type=Path, required=True, help="the folder to plan into")
            one.add_argument("--tiles", type=int, help="tiles a frame (default: by the memory)")
            one.add_argument(
                "--seeds", type=int, default=1, help="renders of each, whose light is averaged"
            )
    for name, text in (("part", "render a part of a job"), ("gather", "join a job's parts")):
        one = jobs.add_parser(name, help=text)
        if name == "part":
            one.add_argument("number", type=int, help="of the part, from 0")
            one.add_argument(
                "--save-blend",
                action="store_true",
                help="save it for a Blender without ARTO to render, and render nothing",
            )
        one.add_argument("--job", type=Path, required=True, help="the folder of the job")
        one.add_argument(
            "--openjd", action="store_true", help="say the progress as Open Job Description has it"
        )
    # these two are started by the window
    jobs.add_parser("job").add_argument("task", type=Path)
    jobs.add_parser("maps")
    return parser


def _frames(text: str) -> range:
    """The frames that a text names, as in `1-24`, `1-100:5` or `7`."""
    match = re.fullmatch(r"(-?\d+)(?:-(-?\d+))?(?::(\d+))?", text)
    first, last, step = match.groups() if match else ("0", "-1", "1")
    found = range(int(first), int(last or first) + 1, int(step or 1) or 1)
    if not found:
        raise argparse.ArgumentTypeError(f"'{text}' is no frame range: write 1-24, or 1-100:5")
    return found


def _add_option(parser: argparse.ArgumentParser, setting: Setting) -> None:
    """Add an option for a setting, with the setting's kind, choices and description."""
    flag, words = f"--{setting.name.replace('_', '-')}", setting.words.replace("%", "%%")
    if setting.kind in ("choice", "choices"):
        items = [identifier for identifier, _, _ in setting.items]
        several = "+" if setting.kind == "choices" else None
        parser.add_argument(flag, help=words, choices=items, nargs=several)
    elif setting.kind == "switch":
        parser.add_argument(flag, help=words, action=argparse.BooleanOptionalAction)
    else:
        kind = {"whole": int, "number": float, "text": str}[setting.kind]
        parser.add_argument(flag, help=words, type=kind)


def main(arguments: list[str]) -> int:
    """Run the verb that the arguments name; returns the exit code."""
    try:
        options = vars(_parser().parse_args(arguments))
    except SystemExit as e:
        return int(e.code or 0)
    verb = options.pop("verb")
    if verb == "job":
        return job.main(options["task"])
    if verb == "maps":
        return maps.serve()
    if verb in ("part", "gather"):
        return _of_a_farm(
            options["job"].resolve(),
            None if verb == "gather" else options["number"],
            openjd=options["openjd"],
            save_blend=verb == "part" and options["save_blend"],
        )
    name, layer = options.pop("scene"), options.pop("view_layer")
    scene = bpy.data.scenes.get(name) if name else bpy.context.scene
    if scene is None:
        print(f"ARTO: there is no scene '{name}'", file=sys.stderr)
        return 2
    if layer is None:
        layer = scene.view_layers[0].name
        if scene == bpy.context.scene:
            layer = bpy.context.view_layer.name
    elif layer not in scene.view_layers:
        print(f"ARTO: the scene has no view layer '{layer}'", file=sys.stderr)
        return 2
    for path in ("folder", "output"):
        given = options.get(path)
        if given and not given.startswith("//"):
            options[path] = str(Path(given).resolve())
    if options.get("faces"):
        options["faces"] = set(options["faces"])
        options["preset"] = "custom"
    frames, only_estimate = options.pop("frames", None), options.pop("estimate", False)
    planned = {name: options.pop(name, None) for name in ("job", "tiles", "seeds")}
    worlds, turns = options.pop("worlds", None), options.pop("turntable", 1)
    for key, value in options.items():
        if value is not None:
            setattr(scene.arto, key, value)
            taken = getattr(scene.arto, key)
            if isinstance(value, int | float) and abs(taken - value) > 1e-6 * abs(value):
                option = key.replace("_", "-")
                print(f"ARTO: --{option} {value} is out of range", file=sys.stderr)
                return 2
    try:
        if verb == "adopt":
            place = paths.place(scene, layer)
            if not place.owner:
                print("ARTO: there is nothing of another file or scene to use", file=sys.stderr)
                return 1
            print(f"ARTO adopt: {paths.adopt(scene, layer, place.source)}")
            return 0
        if verb == "capture" and only_estimate:
            found = run(estimate(scene, layer), ProgressLines(verb))
            print(json.dumps(found.to_json()), flush=True)
            return 0
        work: Steps[object]
        if verb == "plan":
            tiles, seeds = planned["tiles"], planned["seeds"]
            if (tiles is not None and tiles < 1) or seeds < 1:
                print("ARTO: --tiles and --seeds are at least 1", file=sys.stderr)
                return 2
            work = plan(scene, layer, planned["job"].resolve(), frames, tiles, seeds)
        elif verb == "capture" and frames:
            work = capture_frames(scene, layer, frames)
        elif verb == "relight" and frames and not worlds and turns == 1:
            work = relight_frames(scene, layer, frames)
        elif verb == "relight" and (worlds or frames or turns > 1):
            files = [w.resolve() for w in worlds or ()]
            work = relight_many(scene, layer, files, turns, frames or ())
        else:
            work = {"capture": capture, "fit": fit, "relight": relight}[verb](scene, layer)
        run(work, ProgressLines(verb))
    except ArtoError as e:
        return _failed(e)
    return 0


def _failed(error: ArtoError) -> int:
    """Print an error; returns the exit code."""
    print(f"ARTO: {error}", file=sys.stderr)
    return 130 if isinstance(error, CancelledError) else 1


def _of_a_farm(folder: Path, number: int | None, *, openjd: bool, save_blend: bool) -> int:
    """Render a part of a farm's job, or gather the parts; returns the exit code.

    The settings are those of the job. number: the part's, None to gather.
    """
    work: Steps[Path | list[Path]]
    try:
        if number is None:
            work = gather(folder)
        else:
            work = (save_part if save_blend else render_part)(folder, number)
        name = "gather" if number is None else "part"
        made = run(work, OpenJDLines() if openjd else ProgressLines(name))
    except ArtoError as e:
        if openjd:
            print(f"openjd_fail: {e}", flush=True)
        return _failed(e)
    for path in made if isinstance(made, list) else [made]:
        # render managers look for this line
        print(f"Saved: '{path}'", flush=True)
    return 0


class OpenJDLines:
    """Prints progress in the lines that an Open Job Description session reads."""

    def __call__(self, step: Progress | Render) -> None:
        print(f"openjd_progress: {100 * step.share:.1f}\nopenjd_status: {step.text}", flush=True)


def register() -> None:
    _commands.append(bpy.utils.register_cli_command("arto", main))


def unregister() -> None:
    while _commands:
        bpy.utils.unregister_cli_command(_commands.pop())
