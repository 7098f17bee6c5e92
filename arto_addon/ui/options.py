"""The options of the command line."""

from __future__ import annotations

import argparse
import math
import re
from pathlib import Path

from ...core.file_names import is_text
from ..blender.devices import KINDS
from ..settings import table
from ..settings.setting import Setting
from . import cli_photograph, cli_photographs, cli_sheet, cli_web

# What stands for all frames that a capture was begun of.
EVERY_FRAME = range(0)
# The largest number of a frame in Blender, on both sides of 0.
_LAST_FRAME = 1_048_574


def parser() -> argparse.ArgumentParser:
    """The parser of the command line, with an option for each setting."""
    out = argparse.ArgumentParser(
        prog="blender SCENE.blend --command arto",
        description="Capture how the scene answers light, fit it, and relight it with its world.",
        epilog="Exit codes: 0 done, 1 failed, 2 wrong options, 3 some failed and the others are "
        "done (--keep-going), 130 cancelled.",
    )
    jobs = out.add_subparsers(dest="verb", required=True)
    files = argparse.ArgumentParser(add_help=False)
    files.add_argument("--scene", help="name of the scene (default: the .blend's)")
    files.add_argument("--view-layer", help="name of the view layer (default: the scene's)")
    files.add_argument(
        "--folder", type=_text, help="where capture set and field are kept (default: //arto/)"
    )
    told = _told()
    for name, text, settings in (
        ("capture", "render the basis images", table.options("hemicube", "capture")),
        ("fit", "fit the reflectance field", table.options("fit")),
        ("relight", "relight with the scene's world", table.options("relight")),
        ("match", "find the light of a picture", table.options("match")),
        ("plan", "plan a capture by many machines", table.options("hemicube", "capture", "fit")),
    ):
        one = jobs.add_parser(name, parents=[files, told], help=text)
        for setting in settings:
            _add_option(one, setting)
        if name == "match":
            _add_match(one)
        elif name != "fit":
            _add_frames(one, "first and last frame, and a step: 1-24, 1-100:5 (a field for each, "
                        "or a picture)")  # fmt: skip
        if name == "capture":
            one.add_argument(
                "--more-samples",
                type=_from_one,
                metavar="N",
                help="add so many samples to the capture that is there, and fit it anew",
            )
            one.add_argument(
                "--estimate",
                action="store_true",
                help="say what it takes, as JSON in the last line, and render nothing long",
            )
            one.add_argument(
                "--save",
                action="store_true",
                help="save the .blend first, with the ID by which its captures are found when the "
                "file has another name",
            )
        if name == "relight":
            one.add_argument(
                "--worlds", nargs="+", type=_path, help="environment maps, in the world's place"
            )
            one.add_argument(
                "--kit", type=_path, metavar="FILE", help="a light kit that the world gets first"
            )
            one.add_argument(
                "--turntable",
                type=_from_one,
                default=1,
                help="so many pictures, turned once around",
            )
        if name == "plan":
            one.add_argument("--job", type=_path, required=True, help="the folder to plan into")
            one.add_argument(
                "--tiles", type=_from_one, help="tiles a frame (default: by the memory)"
            )
            one.add_argument(
                "--seeds",
                type=_from_one,
                default=1,
                help="renders of each, whose light is averaged",
            )
    cli_photographs.add(
        jobs.add_parser("photographs", parents=[files, told], help="open a lab's photographs"),
        _path,
    )
    cli_photograph.add(
        jobs.add_parser("photograph", parents=[files, told], help="photograph the scene as a lab"),
        _path,
        _from_one,
        _number,
    )
    one = jobs.add_parser("finish", parents=[files, told], help="make the plate better by samples")
    one.add_argument(
        "--samples",
        type=_from_one,
        required=True,
        dest="finish_samples",
        help="samples a pixel at which the picture is finished",
    )
    one.add_argument("--output", type=_text, help="the plate (default: beside the .blend)")
    one.add_argument("--look", type=_text, help="the look that the plate is of")
    web = jobs.add_parser("web", parents=[files, told], help="make a page that relights the shot")
    cli_web.add(web, _path)
    sheet = jobs.add_parser("sheet", parents=[files, told], help="put plates onto one sheet")
    cli_sheet.add(sheet, _path, _text, frames, _from_one)
    for setting in table.options("relight"):
        _add_option(sheet, setting)
    _add_light(jobs.add_parser("light", parents=[files], help="read or write the light kit"))
    _add_adopt(jobs.add_parser("adopt", parents=[files], help="use another file's captures"))
    _add_status(jobs.add_parser("status", parents=[files], help="say what there is of a shot"))
    for name, text in (("part", "render a part of a job"), ("gather", "join a job's parts")):
        one = jobs.add_parser(name, parents=[told], help=text)
        if name == "part":
            one.add_argument("number", type=int, help="of the part, from 0")
            one.add_argument(
                "--save-blend",
                action="store_true",
                help="save it for a Blender without ARTO to render, and render nothing",
            )
            one.add_argument(
                "--device",
                choices=("CPU", "GPU", *KINDS),
                default="",
                help="what to render with (default: as the file and the preferences have it)",
            )
        one.add_argument("--job", type=_path, required=True, help="the folder of the job")
        one.add_argument(
            "--openjd", action="store_true", help="say the progress as Open Job Description has it"
        )
    # these two are started by the window
    jobs.add_parser("job").add_argument("task", type=_path)
    jobs.add_parser("resident")
    return out


def _told() -> argparse.ArgumentParser:
    """The options of how failures and warnings count, and where they are told."""
    out = argparse.ArgumentParser(add_help=False)
    out.add_argument(
        "--keep-going",
        action="store_true",
        help="where one of many frames or pictures cannot be made, make the others (exit code 3)",
    )
    out.add_argument("--strict", action="store_true", help="a warning is an error")
    out.add_argument(
        "--json",
        type=_path,
        metavar="FILE",
        help="write down what was written, warned of and failed",
    )
    return out


def _add_light(one: argparse.ArgumentParser) -> None:
    one.add_argument(
        "--json",
        type=_path,
        metavar="FILE",
        help="a file that is there: the world gets its kit; else the world's kit is written there "
        "(-: in the last line)",
    )
    one.add_argument("--write", action="store_true", help="write the file though it is there")
    one.add_argument("--save", action="store_true", help="save the .blend with the kit of the file")
    one.add_argument(
        "--hdri", type=_path, metavar="EXR", help="write the world's light, with a kit or without"
    )


def _add_match(one: argparse.ArgumentParser) -> None:
    one.add_argument("target", type=_path, help="the picture that the shot is to look like")
    one.add_argument("--mask", type=_path, help="a picture that is white where the target counts")
    one.add_argument("--keep", type=_path, help="a picture that is white where the shot stays")
    one.add_argument("--save", action="store_true", help="save the .blend with the light as a look")


def _add_adopt(one: argparse.ArgumentParser) -> None:
    one.add_argument(
        "--from",
        dest="source",
        type=_path,
        metavar="FOLDER",
        help="a shot's folder, or one above several (default: what the scene's ID leads to)",
    )


def _add_status(one: argparse.ArgumentParser) -> None:
    one.add_argument(
        "--frames",
        nargs="?",
        type=frames,
        const=EVERY_FRAME,
        help="frames to look at; without numbers all that a capture was begun of (default: the "
        "scene's frame)",
    )
    one.add_argument(
        "--json",
        nargs="?",
        type=_path,
        const=Path("-"),
        metavar="FILE",
        help="say it as JSON, in the last line or in a file",
    )


def _add_frames(one: argparse.ArgumentParser, text: str) -> None:
    one.add_argument("--frames", type=frames, default=None, help=text)


def frames(text: str) -> range:
    """The frames that a text names, as in `1-24`, `1-100:5` or `7`."""
    match = re.fullmatch(r"(-?\d{1,9})(?:-(-?\d{1,9}))?(?::(\d{1,9}))?", text)
    first, last, step = (match[1], match[2], match[3]) if match else ("0", "-1", None)
    count = 1 if step is None else int(step)
    found = range(int(first), int(last or first) + 1, count) if count else range(0)
    if not found:
        raise argparse.ArgumentTypeError(f"'{text}' is no frame range: write 1-24, or 1-100:5")
    if max(abs(found[0]), abs(found[-1])) > _LAST_FRAME:
        raise argparse.ArgumentTypeError(f"'{text}': Blender counts frames up to {_LAST_FRAME}")
    return found


def _path(text: str) -> Path:
    """A path that is text: no EXR file can have a name of any bytes."""
    if not is_text(Path(text)):
        raise argparse.ArgumentTypeError(f"{text!a} is not written in UTF-8: rename it")
    return Path(text)


def _text(text: str) -> str:
    """A text that can be written."""
    return str(_path(text)) and text


def _from_one(text: str) -> int:
    """A whole number of 1 or more."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"'{text}' cannot be: 1 is the least")
    return int(text)


def _number(text: str) -> float:
    """A number that is finite."""
    value = float(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"'{text}' is no number that can be")
    return value


def _add_option(out: argparse.ArgumentParser, setting: Setting) -> None:
    """Add an option for a setting, with the setting's kind, choices and description."""
    flag, words = f"--{setting.name.replace('_', '-')}", setting.words.replace("%", "%%")
    if setting.kind in ("choice", "choices"):
        items = [identifier for identifier, _, _ in setting.items]
        several = "+" if setting.kind == "choices" else None
        out.add_argument(flag, help=words, choices=items, nargs=several)
    elif setting.kind == "switch":
        out.add_argument(flag, help=words, action=argparse.BooleanOptionalAction)
    else:
        kind = {"whole": int, "number": _number, "text": _text}[setting.kind]
        out.add_argument(flag, help=words, type=kind)
