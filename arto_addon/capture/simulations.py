"""Simulations that were played but not baked: only the open scene has their state.

A copy of the scene, or another Blender, simulates anew at a frame and may put things elsewhere. A
baked cache is used by both.
"""

from __future__ import annotations

from collections.abc import Iterator

import bpy


def unbaked(scene: bpy.types.Scene, view_layer: str) -> str:
    """The first simulation that a capture would show in another state, in words; empty for none."""
    for words, cache in _caches(scene, view_layer):
        baked = cache.is_baked or cache.use_external
        if not baked and scene.frame_current > cache.frame_start:
            return words
    return ""


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
            if modifier.show_render and modifier.type in {"CLOTH", "SOFT_BODY"}:
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
