"""What a match has found becomes a look: a world, or a copy of the world with other values."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np

from ...core import exr
from ...core.errors import SceneError, TargetError
from ...core.kit.model import Kit
from ..blender.nodes import new_world
from ..blender.pictures import put
from ..kit import kit as kits
from ..relight import looks
from ..relight.back import show_map
from ..work import Steps
from ..world import controls, dials
from ..world.check import check_world
from .found import Found, read
from .lights import BASE, GROUP, OWN, WORLD
from .match import even_out, match_target

# What is shown of what no light makes, and the look that keeps the light as it was.
IMAGE, BEFORE = "ARTO No Light Makes", "Before"


def apply(scene: bpy.types.Scene, path: Path) -> Found:
    """Make a look of what a match has found, and show it. Raises TargetError, SceneError, KitError.

    The light as it was stays as a look of its own: where there is none yet, one is made.
    """
    found = read(path)
    before = check_world(scene)
    world = _world_of(scene, before, found)
    if not scene.arto.looks:
        looks.add(scene, BEFORE)
    _give(scene, world)
    look = looks.add(scene, found.look)
    if look.world != world and not world.users:
        bpy.data.worlds.remove(world)
    _gain_lamps(scene, found)
    show_missing(path)
    return found


def show_missing(path: Path) -> bpy.types.Image:
    """The picture of what no light makes: grey where the light makes all, brighter and darker where
    the target has more and less light."""
    difference = next(iter(exr.read(path).values()))[..., :3]
    size = max(float(np.percentile(np.abs(difference), 99.5)), 1e-9)
    grey = np.clip(0.5 + 0.5 * difference / size, 0, 1)
    return put(IMAGE, np.dstack([grey, np.ones(grey.shape[:2])]).astype(np.float32), display=True)


def _give(scene: bpy.types.Scene, world: bpy.types.World) -> None:
    """Let the scene, or the view layer that has a world of its own, show a world."""
    for layer in scene.view_layers:
        if layer.world_override is not None:
            layer.world_override = world
    scene.world = world


def _world_of(scene: bpy.types.Scene, before: bpy.types.World, found: Found) -> bpy.types.World:
    """The world that shows what was found."""
    if found.what == "LIGHT":
        path = Path(found.world)
        if not path.is_file():
            raise TargetError(f"{path}, the light that was found, is gone: match again")
        world = new_world(found.look)
        show_map(world, path)
        return world
    if before.library:
        raise SceneError("the world is linked from a library: make it local to change it")
    gains = {n: np.array(g) for n, g in found.gains.items()}
    world = before.copy()
    world.name = found.look
    try:
        if kits.has(world):
            kits.write(world, gained(kits.read(world), gains, found.turn))
        elif WORLD in gains:
            gain = gains[WORLD]
            most = float(gain.max())
            controls.set_strength(world, controls.strength(world) * most)
            if most > 0 and np.ptp(gain) > 1e-6 * most:
                tint = np.array(controls.tint(world)) * gain / most
                controls.set_tint(world, [float(x) for x in tint])
            if found.turn:
                why = dials.why_not_turned(world)
                if why:
                    raise SceneError(why)
                controls.set_turn(world, dials.turn(world) + found.turn)
    except BaseException:
        bpy.data.worlds.remove(world)
        raise
    return world


def gained(kit: Kit, gains: dict[str, np.ndarray], turn: float) -> Kit:
    """A kit whose lights and base are multiplied. turn: radians that the base is turned further."""
    lights = []
    for one in kit.lights:
        gain = gains.get(one.name)
        if gain is None:
            lights.append(one)
            continue
        most = float(gain.max())
        colour = one.colour
        if most > 0 and np.ptp(gain) > 1e-6 * most:
            r, g, b = (float(c * x / most) for c, x in zip(colour, gain, strict=True))
            colour = r, g, b
        lights.append(replace(one, strength=one.strength * most, colour=colour))
    base = kit.base
    if BASE in gains:
        base = replace(
            base,
            strength=base.strength * float(gains[BASE].mean()),
            turn=base.turn + float(np.degrees(turn)),
        )
    return replace(kit, lights=tuple(lights), base=base)


def _gain_lamps(scene: bpy.types.Scene, found: Found) -> None:
    """Multiply the settings' gains of the scene's own lamps."""
    settings = scene.arto
    rest = float(np.mean(found.gains.get(OWN, [1.0])))
    settings.own_lamps *= rest
    for group in settings.own_groups:
        gain = found.gains.get(GROUP + group.name)
        if gain is None and rest == 1.0:
            continue
        # the factor for all lamps is in the groups' light as well
        group.gain *= (float(np.mean(gain)) if gain else 1.0) / max(rest, 1e-9)


def match_and_apply(scene: bpy.types.Scene, view_layer: str) -> Steps[Path]:
    """`match.match_target`, and its look. Raises what the two raise."""
    path = yield from match_target(scene, view_layer)
    apply(scene, path)
    return path


def even_out_and_apply(scene: bpy.types.Scene, view_layer: str) -> Steps[Path]:
    """`match.even_out`, and its look. Raises what the two raise."""
    path = yield from even_out(scene, view_layer)
    apply(scene, path)
    return path
