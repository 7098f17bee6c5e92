"""Open photographs: a scene whose camera and picture are those of a folder of photographs."""

from __future__ import annotations

import math
from pathlib import Path

import bpy

from ...core.errors import SceneError
from ...core.photographs import folder as folders
from ...core.photographs.opened import Photographs
from ...core.photographs.reader import Reader, by_openimageio
from ..blender import exr_library
from ..blender.colour import working_space
from ..shot import home

# Millimetres of a lens where no photograph says which it was, and of the sensor.
LENS, SENSOR = 85.0, 36.0
# The photographs have these primaries.
SPACE = "Linear Rec.709"
# The width of what is seen, in scene units, where the photographs say none.
SPAN = 2.0


def reader() -> Reader:
    """What reads pictures: Blender's own OpenImageIO. Raises ExrError where it has none."""
    return by_openimageio(exr_library.own())


def opened(folder: Path) -> Photographs:
    """Open the photographs of a folder. Raises PhotographsError."""
    return Photographs(folder, folders.read(folder), reader())


def of_scene(scene: bpy.types.Scene) -> Photographs:
    """Open the photographs that a scene is of. Raises PhotographsError, SceneError."""
    if not scene.arto.photographs:
        raise SceneError(f"the scene '{scene.name}' is of no photographs: open some first")
    return opened(home.absolute(scene.arto.photographs))


def check_rendered(scene: bpy.types.Scene, what: str) -> None:
    """Raise SceneError where a scene is of photographs, of which nothing can be rendered.

    what: cannot be done, for the message.
    """
    if scene.arto.photographs:
        raise SceneError(f"{what}: '{scene.name}' is of photographs, and a thing is not in Blender")


def open_scene(folder: Path, world: bpy.types.World | None) -> tuple[bpy.types.Scene, Photographs]:
    """Make a scene of photographs: the picture's size, a camera, and a world.

    Raises PhotographsError, SceneError. Nothing is made then.
    """
    folder = folder.resolve()
    photos = opened(folder)
    photos.check_light()
    check_space()
    scene = bpy.data.scenes.new(folder.name or "Photographs")
    scene.arto.photographs = home.relative(folder)
    scene.world = world
    render = scene.render
    render.engine = "CYCLES"
    height, width = photos.shape
    render.resolution_x, render.resolution_y = width, height
    render.resolution_percentage = 100
    # what is not the thing shows what is put behind it
    render.film_transparent = True
    # no path tracer made the noise of photographs, and none can render suns on the thing
    scene.arto.denoise = scene.arto.lamps = False
    _add_camera(scene, photos)
    return scene, photos


def check_space() -> None:
    """Raise SceneError where Blender works in another colour space than photographs have."""
    if (space := working_space()) != SPACE:
        raise SceneError(
            f"photographs are read in {SPACE}, and this file works in {space}: change its working "
            "space (Scene properties, Color Management)"
        )


def _add_camera(scene: bpy.types.Scene, photos: Photographs) -> None:
    data = bpy.data.cameras.new("Photographs")
    data.sensor_width, data.sensor_fit = SENSOR, "AUTO"
    data.lens = photos.focal or LENS
    camera = bpy.data.objects.new("Photographs", data)
    scene.collection.objects.link(camera)
    scene.camera = camera
    height, width = photos.shape
    # AUTO gives the longer side the whole sensor
    seen = SENSOR * width / max(width, height)
    away = (photos.said.span or SPAN) * data.lens / seen
    if photos.said.view == "down":
        camera.location = (0.0, 0.0, away)
    else:
        camera.location = (0.0, -away, 0.0)
        camera.rotation_euler = (math.pi / 2, 0.0, 0.0)
