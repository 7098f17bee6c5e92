"""The scene that Blender works on: the one in its window."""

from __future__ import annotations

import bpy


def set_on_world(world: bpy.types.World, scene: bpy.types.Scene, **values: object) -> None:
    """Set properties of Cycles on a world.

    At each such change Cycles asks the scene in front for its world, and fails where that scene has
    none. So for the time of the change a scene that has one stands in front. scene: one that has.
    """
    with bpy.context.temp_override(scene=scene):
        for name, value in values.items():
            setattr(world.cycles, name, value)


def to_front(scene: bpy.types.Scene) -> None:
    """Put a scene into the window of a Blender that nobody looks at.

    Blender writes what keys and drivers give into the data of that scene alone. Of another scene, a
    keyed camera would be read where it was last.
    """
    window = bpy.context.window
    if window is not None and window.scene != scene:
        window.scene = scene
        scene.frame_set(scene.frame_current, subframe=scene.frame_subframe)
        for thing in scene.objects:
            thing.update_tag()  # Blender 4.5 has worked the places out, and not written them down.
        for layer in scene.view_layers:
            layer.update()
