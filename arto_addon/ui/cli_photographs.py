"""The verb `photographs` of the command line: a folder of photographs as a shot of the .blend."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import bpy

from ...core.errors import SceneError
from ..blender.front import to_front
from ..photographs.opening import open_scene
from ..photographs.read import read_photographs
from ..shot import home
from ..shot.shot import layer_of
from ..work import Batch, Progress, Steps, run, strictly
from ..world.check import world_of
from .report import OptionError, Report


def add(one: argparse.ArgumentParser, path: Any) -> None:
    """Add the options. path: what makes a path of a text."""
    one.add_argument("photographs", type=path, metavar="FOLDER", help="that has the photographs")
    one.add_argument(
        "--save", action="store_true", help="save the .blend with the scene of the photographs"
    )


def work(options: dict[str, Any], report: Report, batch: Batch) -> None:
    """Open photographs, or those of a scene again, and read them. Raises ArtoError, OptionError."""
    folder: Path = options["photographs"].resolve()
    if not folder.is_dir():
        raise OptionError(f"there is no folder {folder}: choose one with photographs")
    if options["save"] and not home.file():
        raise SceneError("this .blend was never saved, so --save has no place for it: save it")
    run(strictly(_steps(folder, options)) if batch.strict else _steps(folder, options), report)
    if options["save"]:
        try:
            bpy.ops.wm.save_mainfile()
        except RuntimeError as e:
            raise SceneError(f"{home.file()} cannot be saved ({e}): see who may write there") from e


def _steps(folder: Path, options: dict[str, Any]) -> Steps[Path]:
    named = options["scene"]
    if named and named not in bpy.data.scenes:
        raise OptionError(f"there is no scene '{named}'")
    there = (bpy.data.scenes[named],) if named else tuple(bpy.data.scenes)
    scene = next((s for s in there if _is_of(s, folder)), None)
    if scene is None:
        yield Progress(0.0, f"opening the photographs in {folder}")
        scene, _ = open_scene(folder, world_of(there[0] if named else bpy.context.scene))
    if options["folder"]:
        given = options["folder"]
        scene.arto.folder = given if given.startswith("//") else str(Path(given).resolve())
    to_front(scene)
    return (yield from read_photographs(scene, layer_of(scene)))


def _is_of(scene: bpy.types.Scene, folder: Path) -> bool:
    said = scene.arto.photographs
    return bool(said) and home.absolute(said).resolve() == folder
