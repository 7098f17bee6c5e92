"""Looks: named lights that a shot is shown in, each with its own world."""

from __future__ import annotations

from pathlib import Path

import bpy

from ...core.errors import SceneError
from ...core.relight import together
from ..plate.names import relit_file
from ..plate.present import present
from ..shot.shot import check_same_shot, layer_of
from ..work import Progress, Steps
from ..world.check import world_of
from . import ahead
from .relight import finish, make_ready
from .shown import Light, Ready, Shown


def add(scene: bpy.types.Scene, name: str = "") -> bpy.types.ArtoLook:
    """Keep the light as it is now as a new look, and show the look.

    The first look takes the scene's world. Later looks take a copy of the world, so that no two
    looks share a world. Raises SceneError without a world.
    """
    settings = scene.arto
    world = world_of(scene)
    if world is None:
        raise SceneError("the scene has no world to make a look of: add one with an HDRI")
    taken = {look.world for look in settings.looks}
    look = settings.looks.add()
    look.name = free_name(scene, name or "Look")
    if world in taken:
        world = world.copy()
    look.world = world
    settings.active_look = len(settings.looks) - 1  # setting this shows the look
    return look


def remove(scene: bpy.types.Scene) -> str:
    """Remove the look that is shown -> its name. The look's world is left in the file."""
    settings = scene.arto
    name = settings.looks[settings.active_look].name
    settings.looks.remove(settings.active_look)
    if settings.looks:
        settings.active_look = max(0, settings.active_look - 1)
    else:
        settings.look = ""
    return name


def show(scene: bpy.types.Scene) -> None:
    """Give the scene the world and the plate's name of the chosen look."""
    settings = scene.arto
    if not 0 <= settings.active_look < len(settings.looks):
        return
    look = settings.looks[settings.active_look]
    settings.look = look.name
    layer = scene.view_layers.get(layer_of(scene))
    if look.world is None:
        return
    if layer is not None and layer.world_override is not None:
        layer.world_override = look.world
    else:
        scene.world = look.world


def named(scene: bpy.types.Scene, look: bpy.types.ArtoLook) -> None:
    """Follow a look's new name: make the name unique, and name the plate if the look is shown."""
    settings = scene.arto
    others = {k.name for k in settings.looks if k != look}
    name = look.name.strip() or "Look"
    if name in others:
        name = free_name(scene, name)
    if name != look.name:
        look.name = name  # setting the name calls this function again
        return
    shown = settings.active_look
    if 0 <= shown < len(settings.looks) and settings.looks[shown] == look:
        settings.look = name


def free_name(scene: bpy.types.Scene, name: str) -> str:
    """The name, with a number after it where another look has the same name."""
    taken, number, found = {look.name for look in scene.arto.looks}, 2, name
    while found in taken:
        found, number = f"{name} {number}", number + 1
    return found


def relight_looks(scene: bpy.types.Scene, view_layer: str) -> Steps[list[Path]]:
    """Relight the shot in each of its looks; returns the paths of the plates.

    Raises what `relight.compute` raises, SceneError where there are no looks.
    """
    looks = [look for look in scene.arto.looks if look.world]
    if not looks:
        raise SceneError("there are no looks to relight: add one")
    scene.view_layers[view_layer].update()
    shown = Shown(scene, view_layer)
    check_same_shot(scene, shown.field.about.shot, "the reflectance field", view_layer)
    ahead.check_looks(shown, {k.name: (relit_file(scene, k.name), k.world) for k in looks})
    most = max(1, together(shown.field) // len(shown.takes))
    done = []
    for first in range(0, len(looks), most):
        ready: list[Ready] = []
        for look in looks[first : first + most]:
            share = (len(done) + len(ready)) / len(looks)
            path = relit_file(scene, look.name)
            yield Progress(share, f"look {len(done) + len(ready) + 1} of {len(looks)}: {look.name}")
            ready.append((yield from make_ready(shown, Light(path, look.name, look.world))))
        pictures = shown.pictures([r.light for r in ready])
        for one, picture in zip(ready, pictures, strict=True):
            one.laps.go_on()
            yield from finish(shown, one, picture)
            done.append(one.lit.path)
    yield Progress(1.0, f"wrote {len(done)} looks, the last one {done[-1].name}")
    return done


def show_looks(scene: bpy.types.Scene, view_layer: str) -> Steps[list[Path]]:
    """Relight the looks as `relight_looks` does, and put each plate into the scene's compositor."""
    done = yield from relight_looks(scene, view_layer)
    for look, path in zip((k for k in scene.arto.looks if k.world), done, strict=True):
        present(scene, path, look.name)
    return done
