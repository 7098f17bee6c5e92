"""The light kit from and to others: suns of an HDRI as lights, the kit as an HDRI and as lamps."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...core import exr
from ...core.errors import ExrError, KitError, SceneError
from ...core.file_names import is_text
from ...core.kit.found import lights_of
from ...core.kit.light import Blend, Kind, Light
from ...core.kit.model import Base, BaseKind, Kit, free_name
from ...core.kit.shine import frame
from ..blender.colour import working_space
from ..kit import base as of_base
from ..kit import kit as kits
from ..kit.lamps import shade
from ..plate.names import relit_file
from ..plate.plate import world_file
from ..shot.home import check_outside
from ..shot.shot import layer_of
from ..stage.bounds import scene_bounds
from ..stage.stage import stage
from ..world.bake import bake
from ..world.check import check_world
from ..world.detail import FINEST, detail
from .inputs import inputs

# The widths of maps that are written.
NARROWEST, WIDEST = 1024, 8192
# What says in a header that ARTO wrote the file, and of which world.
EXPORTED = "arto.light of"
# Lamps stand so many radii of the scene away, where each point of the scene sees them alike.
FAR = 1000.0


def width_of(world: bpy.types.World) -> int:
    """The width of a map with all detail of a world: a power of two."""
    found = detail(world)
    wanted = 4096 if found >= FINEST else found
    return int(np.clip(2 ** math.ceil(math.log2(max(wanted, 2))), NARROWEST, WIDEST))


def to_hdri(scene: bpy.types.Scene, path: Path, overwrite: bool = False) -> tuple[int, int]:
    """Write the light of the scene's world as an HDRI -> (width, height).

    Any world will do, with a kit or without. overwrite: whether a file is written over that is no
    such HDRI. Raises SceneError, CancelledError.
    """
    world = check_world(scene, layer_of(scene))
    _check(scene, path, overwrite or scene.arto.overwrite)
    image = bake(scene, width_of(world), None, world).image
    exr.write(path, {"": image}, {EXPORTED: world.name}, working_space())
    return image.shape[1], image.shape[0]


def _check(scene: bpy.types.Scene, path: Path, overwrite: bool) -> None:
    """Raise SceneError where an HDRI would be written over another file, or where it is removed."""
    check_outside(path, "an HDRI")
    if not is_text(path):
        raise SceneError(f"the name {str(path)!a} is not written in UTF-8: choose another")
    if found := inputs(scene).over(path):
        raise SceneError(f"{path} is {found.what}, and is not written over: choose another file")
    if os.path.lexists(path) and not path.is_file():
        raise SceneError(f"{path} is no file that could be written over: choose another name")
    if overwrite or not path.exists():
        return
    try:
        own = path.is_file() and EXPORTED in exr.header(path)
    except ExrError:
        own = False
    if not own:
        raise SceneError(
            f"{path} is there, and is no HDRI that ARTO wrote of a light: choose another file, or "
            "move it away"
        )


def suns_to_lights(scene: bpy.types.Scene) -> list[str]:
    """Make lights of a kit of the suns and lamps of a world's base -> their names.

    What is left of the base is written as an HDRI beside the plate. Raises KitError, SceneError.
    """
    world = check_world(scene, layer_of(scene))
    kit = kits.put_in(world)
    if kit.base.kind in (BaseKind.BLACK, BaseKind.GRADIENT):
        return []
    # The base alone, as it stands under a turn and a strength of 1.
    plain = replace(kit, lights=(), backdrop=None, turn=0.0, strength=1.0, tint=(1.0, 1.0, 1.0))
    copy = world.copy()
    try:
        kits.write(copy, plain)
        environment = bake(scene, min(width_of(copy), 4096), None, copy)
    finally:
        bpy.data.worlds.remove(copy)
    rest, found = lights_of(environment)
    if not found:
        return []
    names = {light.name for light in kit.lights}
    lights = []
    for light in found:
        name = free_name(light.name, names)
        names.add(name)
        lights.append(replace(light, name=name))
    path = _rest_file(scene)
    exr.write(path, {"": rest.image}, None, working_space())
    image = bpy.data.images.load(str(path), check_existing=True)
    image.reload()
    image.colorspace_settings.name = working_space()
    base = Base(BaseKind.HDRI, of_base.text_of(image))
    kits.write(world, replace(kit, lights=(*lights, *kit.lights), base=base))
    return [light.name for light in lights]


def _rest_file(scene: bpy.types.Scene) -> Path:
    """A path beside the plate, of a file that is not there yet: an HDRI may be in use."""
    like = world_file(relit_file(scene))
    number = 1
    while True:
        path = like.with_name(f"{like.stem}_rest{number}.exr")
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            return path
        number += 1


def portable(kit: Kit) -> Kit:
    """A kit whose images are named by whole paths, so that another file finds them."""

    def whole(text: str) -> str:
        return bpy.path.abspath(text) if text.startswith("//") else text

    def of(base: Base) -> Base:
        return replace(base, image=whole(base.image))

    return replace(
        kit,
        lights=tuple(replace(light, image=whole(light.image)) for light in kit.lights),
        base=of(kit.base),
        backdrop=None if kit.backdrop is None else of(kit.backdrop),
    )


def to_lamps(scene: bpy.types.Scene, distance: float = 0.0) -> list[str]:
    """Put the kit's lights into the scene as area lamps and suns -> the names of the objects.

    The lights go out of the world; base and backdrop stay. distance: in the scene's units, from its
    middle; 0 for `FAR` times its radius, where every place sees a lamp as it saw the light. Raises
    KitError for lights that no lamp can be: pictures, and those that filter or hide what is behind.
    """
    layer = layer_of(scene)
    world = check_world(scene, layer)
    kit = kits.read(world)
    for light in kit.lit:
        if light.kind is Kind.PICTURE or light.blend is not Blend.ADD:
            raise KitError(
                f"'{light.name}' cannot be a lamp: lamps only add light of one colour. Switch it "
                "off, set its blend to Add, or write the kit as an HDRI"
            )
    with stage(scene, layer) as on:
        middle, radius = scene_bounds(on)
    distance = distance or FAR * radius
    made = []
    for light in kit.lit:
        turned = replace(light, azimuth=light.azimuth - kit.turn)
        colour = np.array(light.radiance) * light.amount * kit.strength * np.array(kit.tint)
        made.append(_lamp(scene, turned, colour, Vector(middle), distance))
    left = tuple(light for light in kit.lights if light not in kit.lit)
    kits.write(world, replace(kit, lights=left))
    return made


def _lamp(
    scene: bpy.types.Scene, light: Light, colour: np.ndarray, middle: Vector, distance: float
) -> str:
    """Put one lamp into the scene. colour: its radiance (3,)."""
    most = float(colour.max())
    hue = colour / most if most > 0 else np.ones(3)
    sun = light.kind is Kind.SUN
    data = bpy.data.lights.new(light.name, "SUN" if sun else "AREA")
    data.color = hue
    if sun:
        half = math.radians(light.width / 2)
        data.angle = 2 * half
        data.energy = most * math.pi * math.sin(half) ** 2
    else:
        half_x, half_y = light.sides
        data.shape = "ELLIPSE" if light.kind in (Kind.ROUND, Kind.RING) else "RECTANGLE"
        data.size, data.size_y = 2 * half_x * distance, 2 * half_y * distance
        area = data.size * data.size_y * (math.pi / 4 if data.shape == "ELLIPSE" else 1)
        # An area lamp of a power P has the radiance P / (pi A) on its one side.
        data.energy = most * math.pi * area
        if light.softness or light.gradient or light.slope or light.kind in (Kind.RING, Kind.STRIP):
            shade(data, light)
    lamp = bpy.data.objects.new(light.name, data)
    right, up, ahead = frame(light)
    # A lamp shines along its -Z. Seen from the scene, its +X is to the left.
    turn = Matrix((-right, up, ahead)).transposed().to_4x4()
    turn.col[0] = Vector((*np.cross(up, ahead), 0.0))
    lamp.matrix_world = Matrix.Translation(middle + Vector(ahead) * distance) @ turn
    scene.collection.objects.link(lamp)
    return lamp.name
