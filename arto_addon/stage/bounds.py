"""How large the scene is: the bounds of exactly what a render would show.

Blender tells a render engine, and nobody else, what is rendered: with render visibility, instances,
linked data and modifiers at their render settings. So a render engine is what asks.
"""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from ...core.errors import SceneError
from ..work import last_properties_kept
from .stage import Stage

_found: list[tuple[NDArray, NDArray]] = []


def _local_corners(data: bpy.types.Object) -> list[Vector] | None:
    """The corners of an evaluated object's bounding box, None where it has no shape."""
    if data.type not in {
        "MESH",
        "CURVE",
        "SURFACE",
        "META",
        "FONT",
        "CURVES",
        "POINTCLOUD",
        "VOLUME",
        "GREASEPENCIL",
    }:
        return None
    if data.type == "MESH" and len(data.data.vertices) == 0:
        return None
    corners = [Vector(c) for c in data.bound_box]
    low, high = (Vector(f(c[i] for c in corners) for i in range(3)) for f in (min, max))
    # an object without geometry has the unit box of -1, or one turned inside out
    if data.type not in {"MESH"} and (low == Vector((-1, -1, -1)) and high == Vector((1, 1, 1))):
        return corners if data.type == "VOLUME" else None
    return corners


class _BoundsEngine(bpy.types.RenderEngine):
    bl_idname = "ARTO_BOUNDS"
    bl_label = "ARTO Bounds"
    bl_use_preview = False

    def render(self, depsgraph: bpy.types.Depsgraph) -> None:
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for instance in depsgraph.object_instances:
            if not (instance.show_self or instance.show_particles):
                continue
            corners = _local_corners(instance.object)
            if corners is None:
                continue
            world = np.array([instance.matrix_world @ c for c in corners])
            if np.isfinite(world).all():
                low, high = np.minimum(low, world.min(axis=0)), np.maximum(high, world.max(axis=0))
        _found.append((low, high))


def scene_bounds(stage: Stage) -> tuple[tuple[float, float, float], float]:
    """Centre and radius of what the stage's scene renders; without the hemicube, which is not on
    the stage yet. Raises SceneError where there is nothing to see."""
    scene = stage.scene
    render = scene.render
    settings = {
        "engine": "ARTO_BOUNDS",
        "resolution_x": 4,
        "resolution_y": 4,
        "resolution_percentage": 100,
        "use_border": False,
    }
    before = {name: getattr(render, name) for name in settings}
    _found.clear()
    bpy.utils.register_class(_BoundsEngine)
    try:
        for name, value in settings.items():
            setattr(render, name, value)
        with last_properties_kept():
            bpy.ops.render.render(scene=scene.name)
        for name, value in before.items():
            setattr(render, name, value)
    finally:
        bpy.utils.unregister_class(_BoundsEngine)
    if not _found or not np.isfinite(_found[-1][0]).all():
        raise SceneError("the scene shows nothing: unhide what should be captured")
    low, high = _found[-1]
    centre = (low + high) / 2
    return tuple(float(x) for x in centre), max(float(np.linalg.norm(high - low)) / 2, 1e-6)
