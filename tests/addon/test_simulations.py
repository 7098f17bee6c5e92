"""A simulation that was played and not baked is refused: a copy of the scene has it elsewhere."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from arto.core.errors import SceneError
from scene_tools import BOX, add_mesh, captured, small_scene


def falling(tmp_path):
    """A box that falls beside the others."""
    scene = small_scene(tmp_path)
    scene.arto.samples = 1
    thing = add_mesh(scene, "Falling", *BOX)
    thing.location = (0, 2, 6)
    bpy.context.view_layer.objects.active = thing
    thing.select_set(True)
    bpy.ops.rigidbody.object_add()
    return scene, thing


def play(scene, frame):
    for n in range(scene.frame_current, frame + 1):
        scene.frame_set(n)


def test_what_was_played_and_not_baked_is_refused(tmp_path):
    scene, thing = falling(tmp_path)
    captured(scene)  # at its first frame, where nothing has been simulated
    play(scene, 12)
    seen = thing.matrix_world.translation.z
    copy = scene.copy()
    copy.frame_set(12)
    elsewhere = thing.evaluated_get(copy.view_layers[0].depsgraph).matrix_world.translation.z
    bpy.data.scenes.remove(copy)
    assert abs(seen - elsewhere) > 0.1  # which is why
    with pytest.raises(SceneError, match="the rigid bodies were played and not baked"):
        captured(scene)


def test_what_is_baked_is_captured_where_it_is(tmp_path):
    scene, thing = falling(tmp_path)
    cache = scene.rigidbody_world.point_cache
    scene.frame_end = cache.frame_end = 15
    with bpy.context.temp_override(point_cache=cache):
        bpy.ops.ptcache.bake(bake=True)
    scene.frame_set(12)
    baked = captured(scene).read(0).guides["depth"]
    # the same picture without a simulation
    place = thing.matrix_world.copy()
    bpy.ops.rigidbody.object_remove()
    thing.matrix_world = place
    scene.arto.seed += 1
    still = captured(scene).read(0).guides["depth"]
    assert np.median(np.abs(baked - still)) < 1e-3


def test_cloth_and_particles(tmp_path):
    scene = small_scene(tmp_path)
    scene.arto.samples = 1
    floor = scene.objects["Floor"]
    cloth = floor.modifiers.new("Cloth", "CLOTH")
    scene.frame_set(5)
    with pytest.raises(SceneError, match="the cloth 'Floor' was played and not baked"):
        captured(scene)
    cloth.show_render = False
    captured(scene)
    floor.modifiers.remove(cloth)
    floor.modifiers.new("Particles", "PARTICLE_SYSTEM")
    with pytest.raises(SceneError, match="the particles of 'Floor' were played and not baked"):
        captured(scene)
    floor.hide_render = True
    captured(scene)
