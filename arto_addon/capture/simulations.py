"""Simulations that were played but not baked: only the open scene has their state.

A copy of the scene, or another Blender, simulates anew at a frame and may put things elsewhere. A
baked cache is used by both. Whether the simulation zones of geometry nodes are baked, Blender does
not say: there a copy of the object, which has what was baked and nothing else, is held against it.
"""

from __future__ import annotations

from collections.abc import Iterator

import bpy

from ..shot import walk
from ..world.still import bare


def unbaked(scene: bpy.types.Scene, view_layer: str) -> str:
    """The first simulation that a capture would show in another state, in words; empty for none."""
    for words, cache in _caches(scene, view_layer):
        baked = cache.is_baked or cache.use_external
        if not baked and scene.frame_current > cache.frame_start:
            return words
    custom = scene.use_custom_simulation_range
    first = scene.simulation_frame_start if custom else scene.frame_start
    for thing in scene.view_layers[view_layer].objects if scene.frame_current > first else ():
        seen = thing and not thing.hide_render and _has_zone(thing)
        if seen and _stands_elsewhere(scene, view_layer, thing):
            return f"the simulation zones of '{thing.name}'"
    return ""


def _has_zone(thing: bpy.types.Object) -> bool:
    """Whether geometry nodes of an object simulate."""
    seen: set[int] = set()
    todo = [m.node_group for m in thing.modifiers if m.type == "NODES" and m.show_render]
    while todo:
        tree = todo.pop()
        if tree is None or tree.as_pointer() in seen:
            continue
        seen.add(tree.as_pointer())
        if any(n.bl_idname == "GeometryNodeSimulationOutput" and not n.mute for n in tree.nodes):
            return True
        todo += [n.node_tree for n in tree.nodes if getattr(n, "node_tree", None)]
    return False


def _stands_elsewhere(scene: bpy.types.Scene, view_layer: str, thing: bpy.types.Object) -> bool:
    """Whether an object as it is now has another shape than a copy of it at the same frame."""
    layer = scene.view_layers[view_layer]
    layer.update()
    shown = _shapes(layer.depsgraph, thing)
    if not shown:
        return False  # What the window hides was not played there.
    with bare(scene, view_layer, None) as place:
        copy = thing.copy()
        try:
            place.collection.objects.link(copy)
            place.frame_set(scene.frame_current, subframe=scene.frame_subframe)
            return _shapes(place.view_layers[0].depsgraph, copy) != shown
        finally:
            bpy.data.objects.remove(copy)


def _shapes(
    depsgraph: bpy.types.Depsgraph, thing: bpy.types.Object
) -> list[tuple[tuple[float, ...], str]]:
    """What an object shows, its instances included, as values to compare."""
    found = []
    for instance in depsgraph.object_instances:
        maker = instance.parent or instance.object
        if maker.original != thing:
            continue
        data = instance.object.data
        arrays = isinstance(data, bpy.types.Mesh | bpy.types.Curves | bpy.types.PointCloud)
        matrix = tuple(round(x, 4) for row in instance.matrix_world for x in row)
        found.append((matrix, walk.arrays(data) if arrays else ""))
    return sorted(found)


def _caches(scene: bpy.types.Scene, view_layer: str) -> Iterator[tuple[str, bpy.types.PointCache]]:
    """Each simulation of what is rendered: its name and its cache."""
    bodies = scene.rigidbody_world
    if bodies and bodies.enabled and bodies.collection:
        moved = [
            thing
            for thing in bodies.collection.all_objects
            if thing.rigid_body and thing.rigid_body.type == "ACTIVE" and thing.rigid_body.enabled
        ]
        if moved:
            yield "the rigid bodies", bodies.point_cache
    for thing in scene.view_layers[view_layer].objects:
        if thing is None or thing.hide_render:
            continue
        for modifier in thing.modifiers:
            if not modifier.show_render:
                continue
            if modifier.type == "DYNAMIC_PAINT" and modifier.canvas_settings:
                for surface in modifier.canvas_settings.canvas_surfaces:
                    # A surface of images is shown by the images that were baked.
                    if surface.is_active and surface.surface_format == "VERTEX":
                        yield f"the dynamic paint of '{thing.name}'", surface.point_cache
            elif modifier.type in {"CLOTH", "SOFT_BODY"}:
                yield (
                    f"the {modifier.type.replace('_', ' ').lower()} '{thing.name}'",
                    (modifier.point_cache),
                )
        for system in thing.particle_systems:
            settings = system.settings
            shown = settings.count and settings.render_type != "NONE"
            if shown and (settings.type == "EMITTER" and settings.physics_type != "NO"):
                yield f"the particles of '{thing.name}'", system.point_cache
            elif shown and settings.type == "HAIR" and system.use_hair_dynamics:
                yield f"the hair of '{thing.name}'", system.point_cache
