"""The command line: `blender scene.blend --command arto VERB`.

The verbs do what the buttons do, with settings as options. Others do the parts of a farm's job, or
say what there is of a shot.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import sys
import traceback
from pathlib import Path
from typing import Any, TypeVar

import bpy

from ...core.errors import ArtoError, SceneError
from ...core.files import write_text
from ..blender.front import to_front
from ..blender.saving import save
from ..capture.capture import capture, estimate
from ..capture.more import more_of_frames, more_samples
from ..capture.sequence import capture_frames
from ..farm.gather import gather
from ..farm.part import render_part, save_part
from ..farm.plan import plan
from ..fit.fit import fit
from ..job import run as job
from ..match.apply import match_and_apply
from ..relight.finished import finish_plate
from ..relight.many import relight_frames, relight_many
from ..relight.relight import relight
from ..resident import serve as resident
from ..shot import home, paths, scene_id
from ..shot.adopting import adopt, adopt_from
from ..work import Batch, ProgressLines, Steps, run, strictly
from . import cli_photograph, cli_photographs, cli_sheet, cli_web
from .cli_light import give, light
from .inventory import FORMAT, Inventory, inventory
from .options import EVERY_FRAME, parser
from .report import CODES, OpenJDLines, OptionError, Report, check_file

_commands: list[object] = []
_Made = TypeVar("_Made")


def command(arguments: list[str]) -> int:
    """What Blender calls for `--command arto`; returns the exit code.

    Blender says more on standard output after this, and what it has kept back comes then too. It
    goes to the standard error, so that the last line is ARTO's.
    """
    code = main(arguments)
    sys.stdout.flush()
    if bpy.app.background and bpy.app.binary_path:
        with contextlib.suppress(OSError):  # on Windows there may be no standard error
            os.dup2(2, 1)
    return code


def main(arguments: list[str]) -> int:
    """Run the verb that the arguments name; returns the exit code."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # names of files may be no text
            stream.reconfigure(errors="backslashreplace")
    try:
        options = vars(parser().parse_args(arguments))
    except SystemExit as e:
        return int(e.code or 0)
    verb = options.pop("verb")
    if verb == "job":
        return job.main(options["task"])
    if verb == "resident":
        return resident.serve()
    try:
        if verb == "status":
            return _status(options)
        if verb == "light":
            scene, layer = _scene(options)
            light(scene, layer, options)
            return 0
        lines = OpenJDLines() if options.get("openjd") else ProgressLines(verb)
        file = options.pop("json", None)
        report = Report(verb, file.resolve() if file else None, lines, options.get("job"))
    except (ArtoError, OptionError) as e:
        print(f"ARTO: {e}", file=sys.stderr)
        return CODES["wrong options" if isinstance(e, OptionError) else "failed"]
    try:
        _do(verb, options, report)
    except (ArtoError, OptionError) as e:
        if options.get("openjd"):
            print(f"openjd_fail: {e}", flush=True)
        return report.ended(e)
    except UnicodeEncodeError as e:  # a description, or a name, with what is no text
        return report.ended(SceneError(f"{e.object!a} is no text that can be written: rename it"))
    except Exception as e:
        traceback.print_exc()
        return report.ended(e)
    return report.ended()


def _do(verb: str, options: dict[str, Any], report: Report) -> None:
    """Do a verb's work. Raises ArtoError, OptionError."""
    batch = Batch(options.pop("keep_going", False), options.pop("strict", False))
    if verb in ("part", "gather"):
        _of_a_farm(verb, options, report, batch)
        return
    if verb == "photographs":
        cli_photographs.work(options, report, batch)
        return
    scene, layer = _scene(options)
    if verb == "match":
        _match(scene, layer, options, report, batch)
        return
    if verb == "web":
        page = cli_web.work_of(scene, layer, options)
        _set(scene, options)
        run(_as_asked(page, batch, False), report)
        return
    if verb == "sheet":
        sheet = cli_sheet.work_of(scene, layer, options, batch)
        _set(scene, options)
        run(_as_asked(sheet, batch, True), report)
        return
    if verb == "photograph":
        photos = cli_photograph.work_of(scene, layer, options)
        _set(scene, options)
        run(_as_asked(photos, batch, False), report)
        return
    source, saves = options.pop("source", None), options.pop("save", False)
    if saves:
        _save(scene, layer, options.get("folder"))
    named = scene_id.of(scene)
    frames, only_estimate = options.pop("frames", None), options.pop("estimate", False)
    planned = {name: options.pop(name, None) for name in ("job", "tiles", "seeds")}
    worlds, turns = options.pop("worlds", None), options.pop("turntable", 1)
    kit = options.pop("kit", None)
    more = options.pop("more_samples", None)
    _set(scene, options)
    if kit is not None:
        give(scene, layer, kit.resolve())
    if verb == "adopt":
        _adopt(scene, layer, source)
        return
    if verb == "capture" and only_estimate:
        found = run(estimate(scene, layer), report)
        print(json.dumps(found.to_json()), flush=True)
        return
    work: Steps[object]
    many = bool(frames or worlds or turns > 1) and verb != "plan"
    if verb == "plan":
        folder = planned["job"].resolve()
        work = plan(scene, layer, folder, frames, planned["tiles"], planned["seeds"])
    elif verb == "capture" and more and frames:
        work = more_of_frames(scene, layer, more, frames, batch)
    elif verb == "capture" and more:
        work = more_samples(scene, layer, more)
    elif verb == "capture" and frames:
        work = capture_frames(scene, layer, frames, batch)
    elif verb == "relight" and frames and not worlds and turns == 1:
        work = relight_frames(scene, layer, frames, batch)
    elif verb == "relight" and (worlds or frames or turns > 1):
        files = [w.resolve() for w in worlds or ()]
        work = relight_many(scene, layer, files, turns, frames or (), batch)
    else:
        work = {"capture": capture, "fit": fit, "relight": relight, "finish": finish_plate}[verb](
            scene, layer
        )
    run(_as_asked(work, batch, many), report)
    if verb == "capture" and named is None:
        _say_unsaved(verb, paths.place(scene, layer).folder)


def _match(
    scene: bpy.types.Scene, layer: str, options: dict[str, Any], report: Report, batch: Batch
) -> None:
    """Find the light of a picture, and make a look of it. Raises ArtoError, OptionError."""
    options["match_target"] = str(options.pop("target").resolve())
    images = {"match_mask": options.pop("mask"), "match_keep": options.pop("keep")}
    saves = options.pop("save")
    if saves and not home.file():
        raise SceneError("this .blend was never saved, so --save has no place for it: save it")
    _set(scene, options)
    for name, path in images.items():
        if path is None:
            continue
        if not path.is_file():
            raise OptionError(f"there is no file {path}: choose another mask")
        try:
            image = bpy.data.images.load(str(path.resolve()), check_existing=True)
        except RuntimeError as e:
            raise OptionError(f"{path} cannot be read ({e})") from e
        setattr(scene.arto, name, image)
    work: Steps[object] = match_and_apply(scene, layer)
    run(_as_asked(work, batch, False), report)
    if saves:
        save()


def _say_unsaved(verb: str, folder: Path) -> None:
    """Say that the .blend on disk does not have the ID of what was captured. folder: the shot's."""
    save = "capture with --save, " if verb == "capture" else ""
    print(
        f"ARTO {verb}: the .blend was saved without the ID by which this capture is found when the "
        f"file has another name: {save}save it in Blender, or use the capture in the other file by "
        f"--command arto adopt --from '{folder}'",
        flush=True,
    )


def _as_asked(work: Steps[_Made], batch: Batch, many: bool) -> Steps[_Made]:
    """The work, with warnings as errors where that is asked for.

    many: whether it is a work of many pieces. With `--keep-going` these are strict each by itself.
    """
    return strictly(work) if batch.strict and not (many and batch.keep_going) else work


def _scene(options: dict[str, Any]) -> tuple[bpy.types.Scene, str]:
    """The scene and the view layer that the options name. Raises OptionError."""
    name, layer = options.pop("scene"), options.pop("view_layer")
    scene = bpy.data.scenes.get(name) if name else bpy.context.scene
    if scene is None:
        raise OptionError(f"there is no scene '{name}'")
    if layer is None:
        layer = scene.view_layers[0].name
        if scene == bpy.context.scene:
            layer = bpy.context.view_layer.name
    elif layer not in scene.view_layers:
        raise OptionError(f"the scene has no view layer '{layer}'")
    to_front(scene)
    for path in ("folder", "output", "cryptomatte"):
        given = options.get(path)
        if given and not given.startswith("//"):
            # a slash at the end says that the output is a folder
            whole = str(Path(given).resolve())
            end = "/" if given.endswith(("/", "\\")) and not whole.endswith("/") else ""
            options[path] = whole + end
    if options.get("faces"):
        options["faces"] = set(options["faces"])
        options["preset"] = "custom"
    return scene, layer


def _set(scene: bpy.types.Scene, options: dict[str, Any]) -> None:
    """Give the scene the settings of the options. Raises OptionError where one is out of range."""
    for key, value in options.items():
        if value is None:
            continue
        flag = f"--{key.replace('_', '-')}"
        try:
            setattr(scene.arto, key, value)
        except (OverflowError, ValueError) as e:
            raise OptionError(f"{flag} {value} is out of range") from e
        taken = getattr(scene.arto, key)
        if isinstance(value, int | float) and abs(taken - value) > 1e-6 * abs(value):
            raise OptionError(f"{flag} {value} is out of range")
        if isinstance(value, str) and taken != value:
            raise OptionError(f"{flag} is longer than Blender keeps it: shorten it")


def _save(scene: bpy.types.Scene, layer: str, folder: str | None) -> None:
    """Save the .blend with the scene's ID, and without the settings of the options.

    Raises SceneError.
    """
    if not home.file():
        raise SceneError("this .blend was never saved, so --save has no place for it: save it")
    if scene_id.of(scene):
        return
    before = scene.arto.folder
    if folder:
        scene.arto.folder = folder
    try:
        paths.claim(scene, layer)
    finally:
        scene.arto.folder = before
    save()


def _adopt(scene: bpy.types.Scene, layer: str, source: Path | None) -> None:
    """Use what was captured for another file or scene. Raises SceneError."""
    if source is not None:
        for frame, folder in adopt_from(scene, layer, source.resolve()):
            print(f"ARTO adopt: frame {frame}: {folder}", flush=True)
        return
    place = paths.place(scene, layer)
    if not place.owner:
        other = paths.alike(scene, layer)
        raise SceneError(
            "there is nothing of another file or scene to use"
            + (f": name it, as in --from '{other}'" if other else "")
        )
    print(f"ARTO adopt: {adopt(scene, layer, place.source)}", flush=True)


def _of_a_farm(verb: str, options: dict[str, Any], report: Report, batch: Batch) -> None:
    """Render a part of a farm's job, or gather the parts. The settings are those of the job."""
    folder = options["job"].resolve()
    work: Steps[Path | list[Path]]
    unnamed = {scene.name for scene in bpy.data.scenes if scene_id.of(scene) is None}
    if verb == "gather":
        work = gather(folder, batch)
    else:
        number = options["number"]
        saves = options["save_blend"]
        work = (
            save_part(folder, number) if saves else render_part(folder, number, options["device"])
        )
    made = run(_as_asked(work, batch, verb == "gather"), report)
    for path in made if isinstance(made, list) else [made]:
        # render managers look for this line
        print(f"Saved: '{path}'", flush=True)
    named = {scene.name for scene in bpy.data.scenes if scene_id.of(scene)}
    if verb == "gather" and isinstance(made, list) and unnamed & named:
        _say_unsaved(verb, made[0].parent)


def _status(options: dict[str, Any]) -> int:
    """Say what there is of a shot; returns the exit code: 0 where all is whole, else 3."""
    file, frames = options.pop("json"), options.pop("frames")
    scene, layer = _scene(options)
    _set(scene, options)
    found: Inventory = inventory(scene, layer, "all" if frames == EVERY_FRAME else frames)
    text = json.dumps(found.to_json())
    if file is None:
        print("\n".join(found.lines), flush=True)
    elif str(file) == "-":
        print(text, flush=True)
    else:
        check_file(file.resolve(), FORMAT)
        try:
            write_text(file.resolve(), text + "\n")
        except OSError as e:
            raise OptionError(f"--json {file} cannot be written ({e})") from e
    return CODES["done" if found.whole else "some failed"]


def register() -> None:
    _commands.append(bpy.utils.register_cli_command("arto", command))


def unregister() -> None:
    while _commands:
        bpy.utils.unregister_cli_command(_commands.pop())
