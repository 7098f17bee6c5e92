"""The overlay: the patches that the light comes from, drawn around the scene in the 3D viewport.

Nothing of it is in the scene. The patches are drawn at twice the scene's radius: the captured ones
are a thousand radii away, where nobody sees them.
"""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from mathutils import Vector

from ...core.environment import Environment
from ...core.errors import ArtoError
from ...core.hemicube import Hemicube
from ...core.light import PatchLight
from ..capture import planes
from ..live import live
from ..shot import paths, status
from ..shot.shot import layer_of
from ..world import kept
from ..world.check import world_of

# Of the scene's radius: how far away the patches are drawn.
FAR = 2.0
_handle: list[Any] = []
_drawn: dict[str, Any] = {}


def shown() -> bool:
    return bool(_handle)


def switch(on: bool) -> None:
    """Draw it, or not."""
    if on and not _handle and not bpy.app.background:
        _handle.append(bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW"))
    elif not on and _handle:
        bpy.types.SpaceView3D.draw_handler_remove(_handle.pop(), "WINDOW")
        _drawn.clear()
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


def hemicube_of(scene: bpy.types.Scene) -> Hemicube | None:
    """The captured patches of a scene's shot, else those that its settings ask for."""
    try:
        field = status.field_of(paths.place(scene, layer_of(scene), fresh=False).source)
        if field is not None:
            return field.hemicube
        return planes.wanted(scene, (0.0, 0.0, 0.0), 1.0)
    except (ArtoError, OSError):
        return None


def middle_of(scene: bpy.types.Scene) -> tuple[np.ndarray, float]:
    """The middle and the radius of what the viewport has of the scene."""
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
    """Of each patch two triangles, and its four edges -> (6 K, 3), (8 K, 3) in the world."""
    faces, edges = [], []
    for k in range(len(hemicube)):
        a, b, c, d = hemicube.corners(k) * size + middle
        faces += [a, b, c, a, c, d]
        edges += [a, b, b, c, c, d, d, a]
    return np.array(faces, np.float32), np.array(edges, np.float32)


def colours(scene: bpy.types.Scene, hemicube: Hemicube) -> np.ndarray | None:
    """Each patch's light as a display shows it, (K, 3); None where no map of the world is there."""
    world = world_of(scene)
    if world is None:
        return None
    key, strength, turn = kept.shows(scene, world)
    image = None
    if live.current is not None:
        image = live.current.maps.get(key, True)
        if image is None:
            image = live.current.maps.get(key, False)
    if image is None:
        return None
    light = PatchLight(Environment(image * np.float32(strength), turn), hemicube).whole
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
    size = FAR * radius
    faces, edges = triangles(hemicube, middle, size)
    found = colours(scene, hemicube)
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.blend_set("ALPHA")
    # seen from inside and outside: what is behind is drawn faintly over the scene
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
        bpy.types.SpaceView3D.draw_handler_remove(_handle.pop(), "WINDOW")


def register() -> None:
    """Nothing is drawn until it is switched on."""
