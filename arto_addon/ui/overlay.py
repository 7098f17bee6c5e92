"""The overlay: the patches that the light comes from, drawn around the scene in the 3D viewport.

The overlay adds nothing to the scene. Its patches are drawn at twice the scene's radius: the
captured patches are a thousand radii away, too far to be seen.
"""

from __future__ import annotations

import contextlib

import bpy
import numpy as np
from mathutils import Vector

from ...core.errors import ArtoError
from ...core.hemicube import Hemicube
from ...core.light.environment import Environment
from ...core.light.light import PatchLight
from ..capture import planes
from ..live import live
from ..live.maps import Maps
from ..resident import resident
from ..shot import paths, status
from ..shot.shot import layer_of
from ..world import kept
from ..world.check import world_of

_handle: list[object] = []
# The light that was drawn last.
_drawn: list[tuple[str, float, float]] = []
# What makes maps of the world while Live is off: none or one.
_maps: list[Maps] = []
# Seconds between looks at the world.
EVERY = 0.3


def shown() -> bool:
    return bool(_handle)


def switch(on: bool) -> None:
    """Switch the overlay on or off."""
    if on and not _handle and not bpy.app.background:
        _handle.append(bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW"))
        bpy.app.timers.register(_follow, first_interval=0.1)
    elif not on and _handle:
        _put_out()
    _redraw()


def _put_out() -> None:
    bpy.types.SpaceView3D.draw_handler_remove(_handle.pop(), "WINDOW")
    _maps.clear()
    if bpy.app.timers.is_registered(_follow):
        bpy.app.timers.unregister(_follow)


def _redraw() -> None:
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


def _follow() -> float | None:
    """Have a map of the world made while Live makes none; draw again when the light changes."""
    if not _handle:
        return None
    scene = bpy.context.scene
    world = world_of(scene)
    if world is None:
        return EVERY
    key = kept.shows(scene, world)
    if [key] != _drawn and map_of(scene) is not None:
        _drawn[:] = [key]
        _redraw()
    elif live.current is None and map_of(scene) is None:
        if not _maps:
            _maps.append(Maps(resident.current()))
        # relighting reports a world that cannot light the scene; the overlay need not
        with contextlib.suppress(ArtoError):
            _maps[0].ask(scene, layer_of(scene), world, key[0], False)
    return EVERY


def map_of(scene: bpy.types.Scene) -> Environment | None:
    """The light of the scene's world; None where no map of the world is made yet."""
    world = world_of(scene)
    if world is None:
        return None
    key, strength, turn = kept.shows(scene, world)
    for maps in [live.current.maps] if live.current else _maps:
        for full in (True, False):
            image = maps.get(key, full)
            if image is not None:
                return Environment(image * np.float32(strength), turn)
    return None


def hemicube_of(scene: bpy.types.Scene) -> Hemicube | None:
    """The patches that the shot was captured with, else those that the settings ask for."""
    try:
        field = status.field_of(paths.place(scene, layer_of(scene), fresh=False).source)
        if field is not None:
            return field.hemicube
        return planes.wanted(scene, (0.0, 0.0, 0.0), 1.0)
    except (ArtoError, OSError):
        return None


def middle_of(scene: bpy.types.Scene) -> tuple[np.ndarray, float]:
    """The middle and the radius of the scene as the viewport has it."""
    corners = [
        tuple(thing.matrix_world @ Vector(corner))
        for thing in scene.objects
        if thing.type in {"MESH", "CURVE", "SURFACE", "META", "FONT", "CURVES"}
        and not thing.hide_render
        for corner in thing.bound_box
    ]
    if not corners:
        return np.zeros(3), 1.0
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    return (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, 1e-3)


def triangles(hemicube: Hemicube, middle: np.ndarray, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Two triangles and four edges of each of K patches -> (6 K, 3), (8 K, 3), world space."""
    faces, edges = [], []
    for k in range(len(hemicube)):
        a, b, c, d = hemicube.corners(k) * size + middle
        faces += [a, b, c, a, c, d]
        edges += [a, b, b, c, c, d, d, a]
    return np.array(faces, np.float32), np.array(edges, np.float32)


def colours(scene: bpy.types.Scene, hemicube: Hemicube) -> np.ndarray | None:
    """Each patch's light as a display shows it, (K, 3); None without a map of the world."""
    environment = map_of(scene)
    if environment is None:
        return None
    light = PatchLight(environment, hemicube).whole
    light = light / max(float(np.median(light.max(axis=-1))) * 2, 1e-9)
    return np.clip(light / (1 + light), 0, 1)


def _draw() -> None:
    import gpu
    from gpu_extras.batch import batch_for_shader

    scene = bpy.context.scene
    hemicube = hemicube_of(scene)
    if hemicube is None:
        return
    middle, radius = middle_of(scene)
    size = planes.VISIBLE * radius
    faces, edges = triangles(hemicube, middle, size)
    found = colours(scene, hemicube)
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.blend_set("ALPHA")
    # drawn faintly over the scene, since the patches may be between the viewer and the scene
    if found is not None:
        shader = gpu.shader.from_builtin("SMOOTH_COLOR")
        rgba = np.concatenate([found, np.full((len(found), 1), 0.35)], axis=1)
        batch = batch_for_shader(
            shader, "TRIS", {"pos": faces, "color": np.repeat(rgba, 6, 0).astype(np.float32)}
        )
        gpu.state.depth_mask_set(False)
        batch.draw(shader)
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    batch = batch_for_shader(shader, "LINES", {"pos": edges})
    shader.uniform_float("color", (1.0, 0.6, 0.15, 0.5))
    batch.draw(shader)
    gpu.state.blend_set("NONE")
    gpu.state.depth_test_set("NONE")


def unregister() -> None:
    if _handle:
        _put_out()


def register() -> None:
    """Do nothing: the overlay is drawn only once it is switched on."""
