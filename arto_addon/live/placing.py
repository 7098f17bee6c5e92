"""Put it there: a light of the kit placed by a pixel of the shot, by what is to shine there."""

from __future__ import annotations

import math
from dataclasses import replace

import bpy
import numpy as np

from ...core.errors import KitError, SceneError
from ...core.kit.light import Blend, Kind, Light
from ...core.kit.shine import aimed
from ...core.light.environment import Environment
from ...core.place.lobes import lobes_at
from ...core.place.place import Placed, What, facing, grazing, normal_at, reflected, shading
from ..blender.markers import camera_of
from ..kit import kit as kits
from ..kit.former import Former
from ..relight.shown import Shown, newest
from ..shot.shot import layer_of
from ..world import dials, kept
from ..world.check import check_world, world_of
from .image import view_of
from .quick import Quick

# The cosine up to which a shaded normal is that of the surface itself.
_ALIKE = 0.9
# The name that a new light gets, by what it is to do.
NAMES = {What.REFLECT: "Reflection", What.LIGHT: "Light", What.RIM: "Rim", What.SHADE: "Flag"}


class Placer:
    """The opened field of a shot, asked pixel by pixel where a light is to stand.

    Raises SceneError, FieldError and what else opening the field raises.
    """

    def __init__(self, scene: bpy.types.Scene) -> None:
        self.scene = scene
        layer = layer_of(scene)
        shown = Shown(scene, layer, newest(scene, layer))
        self.shown = shown
        self.field = shown.takes[-1].field if len(shown.takes) > 1 else shown.field
        # of the picture that is clicked into
        self.shape = shown.size
        self._view = view_of(scene, self.field.shape, self.field.region)
        there = self.field.has_layer("position")
        self._position = self.field.layer("position") if there else None
        self._normal = self.field.layer("normal") if self.field.has_layer("normal") else None
        self._light: Environment | None = None

    def at(self, x: int, y: int, what: What, without: str = "") -> Placed:
        """Where a light is to stand for a pixel, from the left and the top.

        without: the light that is put there. Raises FieldError.
        """
        x, y = self.shown.pixel(x, y)
        lobes = lobes_at(self.field, x, y)
        eye = self._view[y, x] if self._view is not None else None
        normal = self._normal_at(x, y, eye)
        if what is What.REFLECT:
            return reflected(lobes, normal, eye)
        if what is What.LIGHT:
            return facing(lobes, normal)
        if what is What.SHADE:
            # The light without the flag, which must not hide what it is to hide.
            self._light = self._light or light_of(self.scene, without)
            return shading(lobes, self._light)
        if eye is None:
            raise SceneError("a rim light needs the camera's view: a panorama has none")
        return grazing(lobes, normal, eye)

    def _normal_at(self, x: int, y: int, eye: np.ndarray | None) -> np.ndarray | None:
        """The normal of a pixel: the shaded one of the guides where the surface has one.

        On mirrors and glass the guide is that of what they show. The places of the neighbours tell
        such a guide.
        """
        if eye is None:
            return None
        flat = None if self._position is None else normal_at(self._position, x, y, eye)
        camera = camera_of(self.scene)
        if self._normal is None or camera is None:
            return flat
        # The guide is in the camera's space, with its third axis ahead.
        given = self._normal[y, x].astype(np.float64)
        size = float(np.linalg.norm(given))
        if size < 0.5:
            return flat
        turned = np.array(camera.matrix_world.to_3x3().normalized())
        shaded = turned @ (given * (1, 1, -1)) / size
        return shaded if flat is None or float(shaded @ flat) > _ALIKE else flat

    def close(self) -> None:
        """Let go of the field's files."""
        self.field.close()


def light_of(scene: bpy.types.Scene, without: str) -> Environment:
    """The light of a scene's world, as coarse as a flag needs. Raises SceneError.

    without: the name of a light that is left out, where the world is all a kit.
    """
    layer = layer_of(scene)
    world = check_world(scene, layer)
    image = Quick().map_of(world, without)
    if image is None:
        return kept.environment(scene, 512, layer)
    strength, turn, _ = dials.read(world)
    return Environment(image * np.float32(strength), turn)


def new_light(scene: bpy.types.Scene, what: What, placed: Placed) -> str:
    """Add a light to the kit that is to be put somewhere -> its name. Raises KitError.

    A flag is as large as what it is to hide.
    """
    world = check_world(scene, layer_of(scene))
    kit = kits.put_in(world)
    name = kit.free_name(NAMES[what])
    hides = float(np.clip(5 * placed.spread, 6.0, 90.0))
    light = {
        What.REFLECT: Light(name, width=14.0, height=14.0, softness=0.2, stops=3.0),
        What.LIGHT: Light(name, width=45.0, height=45.0, softness=0.3, stops=2.0),
        What.RIM: Light(name, width=30.0, height=30.0, softness=0.3, stops=4.0),
        What.SHADE: Light(name, Kind.FLAG, Blend.MULTIPLY, width=hides, height=hides,
                          softness=0.2, strength=0.0),
    }[what]  # fmt: skip
    kits.write(world, kit.with_light(light))
    return name


class Gesture:
    """One use of the tool: a light that is put somewhere, sized, turned and dimmed, or put back.

    light: the name of the light that is moved; empty for a new one, made by the first `move`.
    Raises SceneError, FieldError and what else opening the field raises; KitError for a world that
    can have no kit.
    """

    def __init__(self, scene: bpy.types.Scene, what: What, light: str = "") -> None:
        self.scene, self.what, self.light = scene, what, light
        world = check_world(scene, layer_of(scene))
        if why := kits.why_not(world):
            raise KitError(why)
        self.before = kits.read(world) if kits.has(world) else None
        if light and (self.before is None or self.before.light(light).lock):
            raise KitError(f"'{light}' is locked: unlock it in the list")
        self.placer = Placer(scene)
        self._former = Former(world) if self.before is None else None

    def move(self, x: int, y: int) -> Light:
        """Put the light where it shines at a pixel. Raises FieldError, KitError."""
        placed = self.placer.at(x, y, self.what, self.light)
        if not self.light:
            self.light = new_light(self.scene, self.what, placed)
        return change(self.scene, self.light, placed=placed)

    def change(self, size: float = 1.0, roll: float = 0.0, stops: float = 0.0) -> Light | None:
        """Change the light, once there is one; see `change`."""
        if not self.light:
            return None
        return change(self.scene, self.light, size=size, roll=roll, stops=stops)

    def back(self) -> None:
        """Put the kit, or the world that had none, back as it was."""
        world = check_world(self.scene, layer_of(self.scene))
        if self.before is not None:
            kits.write(world, self.before)
        elif self._former is not None and kits.has(world):
            self._former.put_back(world)

    def close(self) -> None:
        """Let go of the field's files, and of the world as it was."""
        self.placer.close()
        if self._former is not None:
            self._former.let_go()


def put_there(scene: bpy.types.Scene, name: str, placed: Placed) -> None:
    """Aim a light of the kit. Raises KitError where it is locked."""
    change(scene, name, placed=placed)


def _world(scene: bpy.types.Scene) -> bpy.types.World:
    world = world_of(scene, layer_of(scene))
    if world is None:
        raise SceneError("the scene has no world any more: add one")
    return world


def change(
    scene: bpy.types.Scene,
    name: str,
    placed: Placed | None = None,
    size: float = 1.0,
    roll: float = 0.0,
    stops: float = 0.0,
) -> Light:
    """Change a light of the kit -> the light.

    placed: where it is aimed; size: a factor on width and height; roll: degrees that are added;
    stops: that are added; of a flag the amount instead. Raises KitError where it is locked.
    """
    world = _world(scene)
    kit = kits.read(world)
    light = kit.light(name)
    if light.lock:
        raise KitError(f"'{name}' is locked: unlock it in the list")
    if placed is not None:
        azimuth, elevation = aimed(placed.direction)
        # The kit may be turned as a whole.
        light = replace(light, azimuth=azimuth + kit.turn, elevation=elevation)
    if size != 1.0:
        width, height = (
            2 * math.degrees(math.atan(min(side * size, math.tan(math.radians(80.0)))))
            for side in light.sides
        )
        light = replace(light, width=max(width, 0.05), height=max(height, 0.05))
    if roll:
        light = replace(light, roll=light.roll + roll)
    if stops and light.kind is Kind.FLAG:
        light = replace(light, amount=float(np.clip(light.amount + stops / 4, 0.0, 1.0)))
    elif stops:
        light = replace(light, stops=float(np.clip(light.stops + stops, -20.0, 20.0)))
    kits.write(world, kit.with_light(light))
    return light
