"""A simulation that was played and not baked is refused: a copy of the scene has it elsewhere."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from arto.arto_addon.capture.check import check_scene
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


def _zone(thing):
    """Let a thing rise by a tenth with every frame that is played."""
    tree = bpy.data.node_groups.new("Rises", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    first, last = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    begin = tree.nodes.new("GeometryNodeSimulationInput")
    end = tree.nodes.new("GeometryNodeSimulationOutput")
    begin.pair_with_output(end)
    move = tree.nodes.new("GeometryNodeSetPosition")
    move.inputs["Offset"].default_value = (0, 0, 0.1)
    for one, other in (
        (first.outputs[0], begin.inputs["Geometry"]),
        (begin.outputs["Geometry"], move.inputs["Geometry"]),
        (move.outputs[0], end.inputs["Geometry"]),
        (end.outputs["Geometry"], last.inputs[0]),
    ):
        tree.links.new(one, other)
    modifier = thing.modifiers.new("Rises", "NODES")
    modifier.node_group = tree
    return modifier


def test_a_zone_that_was_played_and_not_baked_is_refused(tmp_path):
    scene = small_scene(tmp_path)
    thing = scene.objects["Matt"]
    modifier = _zone(thing)
    check_scene(scene)
    for frame in range(1, 9):
        scene.frame_set(frame)
    with pytest.raises(SceneError, match="the simulation zones of 'Matt' were played"):
        check_scene(scene)
    bpy.context.view_layer.objects.active = thing
    bpy.ops.object.geometry_node_bake_single(
        session_uid=thing.session_uid, modifier_name="Rises", bake_id=modifier.bakes[0].bake_id
    )
    check_scene(scene)
    assert not [o for o in bpy.data.objects if o.name.startswith("Matt.")]


def test_dynamic_paint_that_was_played_and_not_baked_is_refused(tmp_path):
    scene = small_scene(tmp_path)
    floor = scene.objects["Floor"]
    paint = floor.modifiers.new("Paint", "DYNAMIC_PAINT")
    bpy.context.view_layer.objects.active = floor
    bpy.ops.dpaint.type_toggle(type="CANVAS")
    scene.frame_set(5)
    with pytest.raises(SceneError, match="the dynamic paint of 'Floor' was played"):
        check_scene(scene)
    paint.canvas_settings.canvas_surfaces[0].is_active = False
    check_scene(scene)
