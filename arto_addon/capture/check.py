"""What a scene must have before it can be captured."""

from __future__ import annotations

import os
from pathlib import Path

import bpy

from ...core import marked
from ...core.capture.kinds import Keep
from ...core.errors import BusyError, SceneError
from ...core.file_names import is_text
from ...core.files import OLD, Lock, is_writable
from ...core.fit.choice import check as check_choice
from ..blender import sequences
from ..blender.markers import camera_of
from ..shot import external, paths
from ..shot.fingerprint import Fingerprint, images_of
from ..shot.home import check_outside
from ..shot.shot import layer_of
from ..stage.stage import picture_size
from ..stage.takes import TAKES
from ..world.check import check_light_of, world_of
from .drawn import check_drawn
from .patterns import patterns_of
from .simulations import unbaked

# The fewest pixels on a side that Blender renders, with denoising and the world behind.
LEAST_PIXELS = 4


def check_patterns(scene: bpy.types.Scene) -> None:
    """Raise PatternError where a capture whose images do not stay cannot be fitted as asked."""
    settings = scene.arto
    if settings.keep == Keep.NEVER:
        check_choice(settings.support, patterns_of(settings), settings.separate)


def check_place(scene: bpy.types.Scene, view_layer: str) -> None:
    """Look at the shot's folder, and write nothing.

    Raises SceneError where nothing can be written there; BusyError where another process works on
    the shot.
    """
    folder = paths.place(scene, view_layer).folder
    if holder := Lock.holder(folder):
        raise BusyError(f"{folder} is in use: {holder}; wait until it is done, or end it there")
    if not is_writable(folder):
        raise SceneError(
            f"nothing can be written into {folder}: see who may write there, or choose another "
            "folder in ARTO's settings"
        )
    check_room_of(folder)


def check_room_of(folder: Path) -> None:
    """Look at where a shot's capture sets and fields will be put.

    Raises SceneError where they would lie in a folder of ARTO's that is removed as a whole, or have
    a name that is no text; FilesError where a folder of others has the name of one of them.
    """
    if not is_text(folder):
        raise SceneError(
            f"the path {str(folder)!a} is not written in UTF-8, so nothing can be rendered there: "
            "rename its folder, or choose another in ARTO's settings"
        )
    check_outside(folder.parent, "captures")
    for take in ("", *TAKES):
        for name in ("capture", "field"):
            for there in (folder / take / name, folder / take / (name + OLD)):
                if os.path.lexists(there):
                    marked.check(there, None, folder)


def incomplete_images(found: Fingerprint, frame: int) -> list[str]:
    """Say which images of what is captured are missing or cut off, for which Blender shows others.

    found: the scene's fingerprint.
    """
    images = [image for image in images_of(found) if image.filepath and not image.is_dirty]
    files = [path for image in images for path in external.of_image(image, frame)]
    told = [sequences.incomplete(path) for path in dict.fromkeys(files)]
    return [f"{text}, and is captured as Blender shows it" for text in told if text]


def check_scene(scene: bpy.types.Scene, view_layer: str | None = None) -> None:
    """Raise SceneError for settings that cannot be captured.

    Objects are checked later, on the stage (`stage.bounds.Rendered.check`).
    """
    if scene.arto.photographs:
        raise SceneError(
            f"the scene '{scene.name}' is of photographs, which cannot be captured: Open "
            "Photographs reads them"
        )
    if scene.render.engine != "CYCLES":
        raise SceneError(
            f"the render engine is {scene.render.engine}: ARTO captures with Cycles; choose it in "
            "the render properties"
        )
    if camera_of(scene) is None:
        raise SceneError("the scene has no camera: add one, or make one the scene's camera")
    if world := world_of(scene, view_layer):
        check_light_of(scene, world)
    check_drawn(scene, view_layer or layer_of(scene))
    width, height = picture_size(scene)
    if min(width, height) < LEAST_PIXELS:
        raise SceneError(
            f"the picture has only {width}x{height} pixels: raise the resolution or its percentage"
        )
    if moving := unbaked(scene, view_layer or scene.view_layers[0].name):
        one = moving.startswith(("the cloth", "the soft", "the hair", "the dynamic"))
        raise SceneError(
            f"{moving} {'was' if one else 'were'} played and not baked, and a capture would show "
            "them elsewhere: bake them (Physics properties, Cache or Simulation Nodes), or go to "
            "their first frame"
        )
    if not scene.arto.faces:
        raise SceneError("the hemicube has no faces: choose at least one")
