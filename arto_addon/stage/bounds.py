"""What the scene renders: its bounds, its shadow catchers and its other things.

Only a render engine learns from Blender what is rendered, with render visibility, instances, linked
data and modifiers at their render settings. So a small render engine of ARTO's own asks.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from ...core.errors import SceneError
from ..work import last_properties_kept
from .stage import Stage

# An object's name, and the path of the library that the object is linked from, or "".
Name = tuple[str, str]


@dataclass
class Rendered:
    """What a scene renders.

    low, high: the corners (3,) of the box around all that a render shows; catchers: the names of
    the objects that are rendered as shadow catchers; flagged: the objects that have the flag Shadow
    Catcher, by which they or their instances are catchers; things: all other rendered objects;
    materials: of all rendered objects.
    """

    low: NDArray[np.float64] = field(default_factory=lambda: np.full(3, np.inf))
    high: NDArray[np.float64] = field(default_factory=lambda: np.full(3, -np.inf))
    catchers: list[str] = field(default_factory=list)
    flagged: set[Name] = field(default_factory=set)
    things: set[Name] = field(default_factory=set)
    materials: set[Name] = field(default_factory=set)
    # makers: objects that make instances of catchers. made: objects that are a catcher only because
    # a catcher makes instances of them.
    makers: set[Name] = field(default_factory=set)
    made: set[Name] = field(default_factory=set)
    # drawn: objects that Blender draws over the render of an engine.
    drawn: list[str] = field(default_factory=list)

    def bounds(self) -> tuple[tuple[float, float, float], float]:
        """The centre and radius of all that is seen. Raises SceneError where nothing is."""
        if not np.isfinite(self.low).all():
            raise SceneError("the scene shows nothing: unhide what should be captured")
        centre = (self.low + self.high) / 2
        radius = float(np.linalg.norm(self.high - self.low)) / 2
        x, y, z = (float(along) for along in centre)
        return (x, y, z), max(radius, 1e-6)

    def check(self) -> None:
        """Raise SceneError where shadow catchers cannot be told from the things on them."""
        for name, _ in sorted(self.things & (self.flagged | self.makers | self.made)):
            raise SceneError(
                f"'{name}' is in the picture both as a shadow catcher and as a thing, or makes "
                "instances of one: make the catcher an object of its own"
            )

    def note(self, instance: bpy.types.DepsgraphObjectInstance) -> None:
        """Note whether an instance is rendered as a catcher or as a thing."""
        one, parent = instance.object, instance.parent
        slots = [slot.material for slot in one.material_slots]
        # those that geometry nodes give have no slot
        for material in (*slots, *getattr(one.data, "materials", ())):
            if material:
                self.materials.add(_name(material))
        if one.is_shadow_catcher:
            self.catchers.append(one.name)
            self.flagged.add(_name(one))
            if parent:
                self.makers.add(_name(parent))
        elif parent and parent.is_shadow_catcher:
            # Cycles renders the instances that a catcher makes as catchers.
            self.catchers.append(one.name)
            self.flagged.add(_name(parent))
            self.made.add(_name(one))
        else:
            self.things.add(_name(one))


def _name(evaluated: bpy.types.ID) -> Name:
    original = evaluated.original
    return original.name, original.library.filepath if original.library else ""


def grease_pencil(name: str) -> str:
    """Say that an object is drawn over the render, and what to do."""
    return (
        f"'{name}' is a drawing of Grease Pencil, which Blender draws over the render: hide it "
        "from the render, or turn Grease Pencil off in this view layer (View Layer properties, "
        "Filter), render the drawing in a layer of its own, and lay it over the picture"
    )


_found: list[Rendered] = []


def _local_corners(data: bpy.types.Object) -> list[Vector] | None:
    """The corners of an evaluated object's bounding box; None where the object has no shape."""
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
    # The bounding box of an object without geometry runs from -1 to 1.
    if data.type not in {"MESH"} and (low == Vector((-1, -1, -1)) and high == Vector((1, 1, 1))):
        return corners if data.type == "VOLUME" else None
    return corners


class _BoundsEngine(bpy.types.RenderEngine):
    bl_idname = "ARTO_BOUNDS"
    bl_label = "ARTO Bounds"
    bl_use_preview = False

    def render(self, depsgraph: bpy.types.Depsgraph) -> None:
        seen = Rendered()
        for instance in depsgraph.object_instances:
            if not (instance.show_self or instance.show_particles):
                continue
            corners = _local_corners(instance.object)
            if corners is None:
                continue
            seen.note(instance)
            if instance.object.type == "GREASEPENCIL":
                seen.drawn.append(instance.object.name)
            world = np.array([instance.matrix_world @ c for c in corners])
            if np.isfinite(world).all():
                seen.low = np.minimum(seen.low, world.min(axis=0))
                seen.high = np.maximum(seen.high, world.max(axis=0))
        _found.append(seen)


def rendered(stage: Stage) -> Rendered:
    """Find out what the stage's scene renders.

    Call this before the hemicube is on the stage, as its planes would count. Raises SceneError
    where Blender renders nothing, or draws over the render.
    """
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
    if not _found:
        raise SceneError("Blender rendered nothing: look for errors in its console")
    if _found[-1].drawn and scene.view_layers[0].use_grease_pencil:
        raise SceneError(grease_pencil(_found[-1].drawn[0]))
    return _found[-1]


def scene_bounds(stage: Stage) -> tuple[tuple[float, float, float], float]:
    """The centre and radius of what the stage's scene renders.

    Raises SceneError where nothing is seen.
    """
    return rendered(stage).bounds()
