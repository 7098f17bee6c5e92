"""The hemicube in a scene, and how large a scene is."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from arto.arto_addon.blender.nodes import new_material
from arto.arto_addon.capture import planes
from arto.arto_addon.stage.bounds import scene_bounds
from arto.arto_addon.stage.stage import stage
from arto.core.errors import SceneError
from arto.core.patterns import PATTERN_SETS
from scene_tools import BOX, add_mesh, captured, differences, snapshot


def bounds(scene):
    with stage(scene, scene.view_layers[0].name) as on:
        return scene_bounds(on)


def only_a_box(scene):
    for thing in list(scene.objects):
        if thing.type == "MESH":
            bpy.data.objects.remove(thing)
    return add_mesh(scene, "Box", *BOX)


def test_radius_of_a_box(scene):
    only_a_box(scene).location = (5, 0, 0)
    centre, radius = bounds(scene)
    assert centre == pytest.approx((5, 0, 0), abs=1e-5)
    assert radius == pytest.approx(math.sqrt(3), rel=1e-5)


def test_radius_with_modifiers_and_hidden_things(scene):
    box = only_a_box(scene)
    array = box.modifiers.new("Array", "ARRAY")
    array.count, array.relative_offset_displace = 4, (1, 0, 0)
    assert bounds(scene)[0] == pytest.approx((3, 0, 0), abs=1e-4)
    # a modifier that the render does not have
    array.show_render = False
    assert bounds(scene)[0] == pytest.approx((0, 0, 0), abs=1e-4)
    array.show_render, array.show_viewport = True, False
    assert bounds(scene)[0] == pytest.approx((3, 0, 0), abs=1e-4)
    hidden = add_mesh(scene, "Hidden", *BOX)
    hidden.location, hidden.hide_render = (100, 0, 0), True
    assert bounds(scene)[0] == pytest.approx((3, 0, 0), abs=1e-4)
    # hidden in the viewport alone, it is rendered and counts
    hidden.hide_render, hidden.hide_viewport = False, True
    assert bounds(scene)[0] == pytest.approx((50, 0, 0), abs=1e-4)


def test_radius_with_instances_and_empty_meshes(scene):
    only_a_box(scene)
    add_mesh(scene, "Empty Mesh", [], []).location = (0, 500, 0)
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    lamp.location = (0, 0, 900)
    scene.collection.objects.link(lamp)
    assert bounds(scene)[1] == pytest.approx(math.sqrt(3), rel=1e-5)
    kept = bpy.data.collections.new("Kept")
    kept.objects.link(bpy.data.objects.new("Part", bpy.data.meshes["Box"]))
    instance = bpy.data.objects.new("Instance", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", kept
    instance.location = (0, 10, 0)
    scene.collection.objects.link(instance)
    assert bounds(scene)[0] == pytest.approx((0, 5, 0), abs=1e-4)


def test_radius_with_linked_things(scene, tmp_path):
    only_a_box(scene)
    kept = bpy.data.collections.new("Library")
    part = bpy.data.objects.new("Part", bpy.data.meshes["Box"])
    part.location = (0, 0, 30)
    kept.objects.link(part)
    path = str(tmp_path / "library.blend")
    bpy.data.libraries.write(path, {kept})
    bpy.data.collections.remove(kept)
    bpy.data.objects.remove(part)
    with bpy.data.libraries.load(path, link=True) as (_, into):
        into.collections = ["Library"]
    scene.collection.children.link(into.collections[0])
    assert bounds(scene)[0] == pytest.approx((0, 0, 15), abs=1e-4)


def test_build_and_remove(scene):
    before = snapshot()
    scene.arto.patches = 2
    bpy.ops.arto.build_hemicube()
    collection = planes.of_artist(scene)
    assert len(collection.objects) == 24
    assert collection.hide_render
    assert not any(o.visible_camera for o in collection.objects)
    hemicube, radius = planes.built(scene)
    assert hemicube.size == pytest.approx(1000 * radius)
    # the corners of the planes are in the directions of the patches, where they can be seen
    plane = collection.objects[5]
    corners = np.array([v.co for v in plane.data.vertices])
    expected = np.array(hemicube.centre) + planes.VISIBLE * radius * hemicube.corners(5)
    np.testing.assert_allclose(corners, expected, rtol=1e-5)
    # built again it is still one
    bpy.ops.arto.build_hemicube()
    assert len([c for c in bpy.data.collections if "arto_hemicube" in c]) == 1
    bpy.ops.arto.remove_hemicube()
    scene.arto.patches = 1
    assert not differences(before, snapshot())


def test_built_hemicube_does_not_change_the_radius(scene):
    before = bounds(scene)
    bpy.ops.arto.build_hemicube()
    assert bounds(scene) == before


def test_capture_uses_the_built_hemicube_and_says_when_it_is_old(scene):
    bpy.ops.arto.build_hemicube()
    add_mesh(scene, "Late", *BOX).location = (0, 0, 3)
    built, _ = planes.built(scene)
    assert captured(scene).hemicube == built
    scene.arto.patches = 3
    with pytest.raises(SceneError, match="press Build Hemicube again"):
        captured(scene)


def test_presets_and_alignment(scene):
    settings = scene.arto
    settings.preset = "paper"
    wanted = planes.wanted(scene, (0, 0, 0), 1.0)
    assert wanted.faces == ("top", "left", "right", "back")
    assert wanted.half_sides
    settings.align = "camera"
    scene.camera.rotation_euler = (math.radians(70), 0, math.radians(-90))
    bpy.context.view_layer.update()
    # turned so, the camera looks along +X: that is where Back is
    back = planes.wanted(scene, (0, 0, 0), 1.0).frame("back")[0]
    np.testing.assert_allclose(back, (1, 0, 0), atol=1e-6)


def test_patch_shows_its_pattern(scene, tmp_path):
    """A mirror facing a near patch head-on reads the pattern off it, u to the right as seen from
    inside and v up: what the shader shows is what `PatternSet.radiance` says."""
    only = only_a_box(scene)
    bpy.data.objects.remove(only)
    mirror = new_material("Mirror")
    shader = mirror.node_tree.nodes["Principled BSDF"]
    shader.inputs["Metallic"].default_value, shader.inputs["Roughness"].default_value = 1, 0
    shader.inputs["Base Color"].default_value = (1, 1, 1, 1)
    corners = [(-50, 0, -50), (50, 0, -50), (50, 0, 50), (-50, 0, 50)]
    add_mesh(scene, "Mirror", corners, [(0, 1, 2, 3)], mirror)
    scene.camera.location, scene.camera.rotation_euler = (0, -1e-3, 0), (math.pi / 2, 0, 0)
    scene.camera.data.clip_start = 1e-5
    # a view of 90 degrees, square: it sees the whole face behind it
    scene.camera.data.angle = math.pi / 2
    scene.render.resolution_x = scene.render.resolution_y = 16
    scene.arto.samples, scene.arto.patterns = 64, "paper"
    there = captured(scene)
    data = there.read(0)
    front = there.hemicube.face_slice("front").start
    # the camera looks at Back through a mirror, so it sees Front with left and right exchanged;
    # on Front u runs to -x, and so it runs to the left of the picture
    t = (np.arange(16) + 0.5) / 16
    u, v = np.meshgrid(1 - t, t[::-1])
    expected = PATTERN_SETS["paper"].radiance(u, v)
    # the outermost pixels' filter reaches over the face's rim
    found = data.basis[front, :, 1:-1, 1:-1, 1]
    np.testing.assert_allclose(found, expected[:, 1:-1, 1:-1], atol=0.03)
