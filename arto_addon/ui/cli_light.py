"""The verb `light` of the command line: the light kit from a file and into a file."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import bpy

from ...core.errors import KitError, SceneError
from ...core.kit import kit_file
from ..blender.nodes import new_world
from ..blender.saving import save
from ..kit import kit as kits
from ..relight import kit_out
from ..shot import home
from ..world.check import world_of
from .report import OptionError, check_place


def light(scene: bpy.types.Scene, layer: str, options: dict[str, Any]) -> None:
    """Give the scene's world the kit of a file that is there, else write the world's kit into it.

    Raises KitError, SceneError, FilesError, OptionError.
    """
    file: Path | None = options["json"]
    if file is None and options["hdri"] is None:
        raise OptionError("light: name a kit's file by --json, or an HDRI to write by --hdri")
    said = str(file) == "-"
    if file is not None and not said and os.path.lexists(file) and not file.is_file():
        raise OptionError(f"--json {file} is a folder, or no file that could be read: name another")
    if file is not None and not said and file.is_file() and not options["write"]:
        give(scene, layer, file.resolve())
        if options["save"]:
            _save()
        print(f"ARTO light: the world has the kit of {file.resolve()}", flush=True)
    elif file is not None:
        world = world_of(scene, layer)
        if world is None or not kits.has(world):
            raise KitError("the scene's world has no light kit: add a light, or give a kit's file")
        kit = kit_out.portable(kits.read(world))
        if not said and file.exists():
            kit_file.load(file)  # no file of another kind is written over
        if said:
            print(json.dumps(kit_file.to_json(kit)), flush=True)
        else:
            check_place(file.resolve())
            try:
                kit_file.save(kit, file.resolve())
            except OSError as e:
                raise OptionError(f"--json {file} cannot be written ({e})") from e
            print(f"ARTO light: wrote {file.resolve()}", flush=True)
    if options["hdri"] is not None:
        path = options["hdri"].resolve()
        width, height = kit_out.to_hdri(scene, path, options["write"])
        print(f"ARTO light: wrote {path}, {width} x {height}", flush=True)


def give(scene: bpy.types.Scene, layer: str, file: Path) -> None:
    """Give the scene's world the kit of a file. Raises KitError, FilesError."""
    world = world_of(scene, layer)
    if world is None:
        world = scene.world = new_world("Light Kit")
    kits.write(world, kit_file.load(file))


def _save() -> None:
    if not home.file():
        raise SceneError("this .blend was never saved, so --save has no place for it: save it")
    save()
