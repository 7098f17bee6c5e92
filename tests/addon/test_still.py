"""Worlds that depend on the scene around them: their light is what the artist's scene shows."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from arto.arto_addon.blender.nodes import new_world
from arto.arto_addon.blender.output import float_exr
from arto.arto_addon.blender.reached import reached
from arto.arto_addon.capture.check import check_scene
from arto.arto_addon.resident import sent
from arto.arto_addon.stage.settings import prepare
from arto.arto_addon.stage.stage import stage
from arto.arto_addon.world import images, kept
from arto.arto_addon.world.check import check_given, check_world
from arto.arto_addon.world.still import still
from arto.arto_addon.world.studio import render
from arto.core import exr
from arto.core.errors import SceneError
from scene_tools import hdri, smooth


def _show(world, socket):
    """Let the world's light be what a socket gives, and 2: light is not negative."""
    tree = world.node_tree
    add = tree.nodes.new("ShaderNodeVectorMath")
    add.inputs[1].default_value = (2, 2, 2)
    tree.links.new(socket, add.inputs[0])
    tree.links.new(add.outputs[0], tree.nodes["Background"].inputs["Color"])


def _coordinates(output, kind="ShaderNodeTexCoord"):
    return lambda scene, tree: tree.nodes.new(kind).outputs[output]


def _transform(scene, tree):
    node = tree.nodes.new("ShaderNodeVectorTransform")
    node.vector_type, node.convert_from, node.convert_to = "POINT", "WORLD", "CAMERA"
    direction = tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"]
    tree.links.new(direction, node.inputs[0])
    return node.outputs[0]


def _attribute(name, output="Color"):
    def add(scene, tree):
        scene["three"], scene["list"], scene.world["of world"] = [0.1, 0.2, 0.3], [0.4], 0.7
        scene.view_layers[0]["both"], scene["both"] = 0.8, 0.9
        node = tree.nodes.new("ShaderNodeAttribute")
        node.attribute_type, node.attribute_name = "VIEW_LAYER", name
        return node.outputs[output]

    return add


def _keyed(block, path, first, last):
    for frame, value in ((1, first), (21, last)):
        setattr(block, path, value)
        block.keyframe_insert(path, frame=frame)


def _keyed_empty(scene, tree):
    empty = bpy.data.objects.new("Empty", None)
    scene.collection.objects.link(empty)
    empty.location, empty.scale = (0.3, 0.2, 0.1), (1, 2, 0.5)
    _keyed(empty, "rotation_euler", (0.1, 0, 0), (0.1, 0.4, 2))
    node = tree.nodes.new("ShaderNodeTexCoord")
    node.object = empty
    return node.outputs["Object"]


def _keyed_group(scene, tree):
    group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    group.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketFloat")
    value, out = group.nodes.new("ShaderNodeValue"), group.nodes.new("NodeGroupOutput")
    group.links.new(value.outputs[0], out.inputs[0])
    _keyed(value.outputs[0], "default_value", 0.0, 1.0)
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    return node.outputs[0]


def _driven(scene, tree):
    scene["here"] = 0.25
    value = tree.nodes.new("ShaderNodeValue").outputs[0]
    driver = value.driver_add("default_value").driver
    driver.type = "SUM"
    variable = driver.variables.new()
    variable.type = "CONTEXT_PROP"
    variable.targets[0].context_property = "ACTIVE_SCENE"
    variable.targets[0].data_path = '["here"]'
    return value


_OF_CAMERA = (
    _coordinates("Camera"),
    _coordinates("Window"),
    _coordinates("View Vector", "ShaderNodeCameraData"),
    _coordinates("View Z Depth", "ShaderNodeCameraData"),
    _coordinates("View Distance", "ShaderNodeCameraData"),
    _transform,
)
_OF_SCENE = (
    _attribute("three"),
    _attribute("list", "Fac"),
    _attribute("of world"),
    _attribute("both"),
    _attribute("render.resolution_x"),
    _keyed_empty,
    _keyed_group,
    _driven,
)


def _all_of(wires):
    """The sum of what several wires give, each with a weight of its own."""

    def add(scene, tree):
        total = None
        for i, wire in enumerate(wires):
            node = tree.nodes.new("ShaderNodeVectorMath")
            node.operation = "MULTIPLY_ADD"
            node.inputs[1].default_value = (1.37**i,) * 3
            tree.links.new(wire(scene, tree), node.inputs[0])
            if total:
                tree.links.new(total, node.inputs[2])
            total = node.outputs[0]
        return total

    return add


@pytest.mark.parametrize("wires", [_OF_CAMERA, _OF_SCENE])
def test_a_still_world_is_what_the_scene_shows(scene, wires):
    """Shown in a scene without properties, with another clock and another camera's place."""
    camera = scene.camera
    camera.data.shift_x, camera.scale = 0.1, (2, 1, 3)
    for thing in [thing for thing in scene.objects if thing != camera]:
        bpy.data.objects.remove(thing)
    _show(scene.world, _all_of(wires)(scene, scene.world.node_tree))
    scene.render.frame_map_new = 50
    other = bpy.data.scenes.new("Other")
    for place in (scene, other):
        place.render.engine, place.render.use_compositing = "CYCLES", False
        place.render.resolution_x, place.render.resolution_y = 8, 6
        place.render.resolution_percentage = 100
        place.cycles.samples, place.cycles.use_denoising = 1, False
        place.cycles.pixel_filter_type = "BOX"
        float_exr(place.render, multilayer=False)
    # Blender evaluates the data of a scene that is in no window for that scene alone.
    scene.frame_set(5)
    shown = render(scene)[..., :3] - 2
    elsewhere = camera.copy()
    elsewhere.location = (5, 6, 7)
    other.collection.objects.link(elsewhere)
    other.camera = elsewhere
    with still(scene, scene.view_layers[0].name, scene.world) as held:
        other.world = held
        found = render(other)[..., :3] - 2
    assert np.abs(shown).max() > 0.01
    np.testing.assert_allclose(found, shown, atol=1e-5 * max(1, np.abs(shown).max()))
    assert [w.name for w in bpy.data.worlds] == ["World"]
    assert len(bpy.data.node_groups) == (_keyed_group in wires)


def test_a_world_drawn_by_the_pixel_of_a_panorama_is_refused(scene):
    scene.camera.data.type = "PANO"
    _show(scene.world, _coordinates("Window")(scene, scene.world.node_tree))
    with pytest.raises(SceneError, match="Window coordinates"):
        check_world(scene)


def test_a_world_whose_light_ends_is_refused(scene):
    scene.world.cycles.max_bounces = scene.cycles.max_bounces - 1
    check_world(scene)  # an even colour is not sampled as a light
    hdri(scene, smooth(8))
    with pytest.raises(SceneError, match="ends after 11 bounces"):
        check_world(scene)
    with pytest.raises(SceneError, match="ends after 11 bounces"):
        check_scene(scene)
    scene.world.cycles.max_bounces += 1
    check_scene(scene)


def test_a_look_is_checked_as_the_scenes_world(scene):
    look = new_world("Look")
    look.cycles.max_bounces = 0
    scene.world, own = look, scene.world
    hdri(scene, smooth(8))
    scene.world = own
    with pytest.raises(SceneError, match="ends after 0 bounces"):
        check_given(scene, look)


def test_materials_find_the_worlds_properties_on_the_stage(scene):
    """An Attribute node and a driver find them by the scene, whose world is black there."""
    scene.world["warmth"] = 0.5
    scene.world.keyframe_insert('["warmth"]', frame=1)
    scene.world["warmth"] = 0.9
    scene.world.keyframe_insert('["warmth"]', frame=11)
    scene.frame_set(6)
    with stage(scene, scene.view_layers[0].name) as on:
        prepare(on, layers=0)
        assert not len(on.scene.world.node_tree.nodes)
        on.scene.frame_set(6)
        layer = on.scene.view_layers[0]
        layer.update()
        shown = on.scene.world.evaluated_get(layer.depsgraph)
        np.testing.assert_allclose(shown["warmth"], 0.7, atol=1e-6)
    assert scene.world.name == "World" and len(bpy.data.worlds) == 1


def test_what_is_around_a_world_is_in_its_key(scene):
    """A plate is out of date when the camera that its world asks has moved."""
    scene.view_layers[0].update()
    before = kept.shows(scene, scene.world)
    scene.camera.location.x += 1
    scene.view_layers[0].update()
    assert kept.shows(scene, scene.world) == before
    _show(scene.world, _coordinates("Camera")(scene, scene.world.node_tree))
    scene.camera.rotation_euler.x += 0.1
    scene.view_layers[0].update()
    before = kept.shows(scene, scene.world)
    scene.camera.rotation_euler.x += 0.1
    scene.view_layers[0].update()
    assert kept.shows(scene, scene.world) != before


def test_only_what_is_shown_is_asked_for(scene):
    """An HDRI whose file is gone does no harm where it leads nowhere."""
    tree = scene.world.node_tree
    light = tree.nodes["Background"]
    gone = tree.nodes.new("ShaderNodeTexEnvironment")
    gone.image = bpy.data.images.new("Gone", 4, 4)
    gone.image.source, gone.image.filepath = "FILE", "/nowhere/gone.exr"
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type = "RGBA"
    one, two = (s for s in mix.inputs if s.enabled and s.type == "RGBA")
    tree.links.new(gone.outputs[0], one)
    out = next(s for s in mix.outputs if s.enabled)
    assert gone not in reached(scene.world)
    tree.links.new(out, light.inputs["Color"])
    mix.inputs[0].default_value = 1.0
    assert check_world(scene)
    factor = tree.nodes.new("ShaderNodeValue")
    factor.outputs[0].default_value = 1.0
    tree.links.new(factor.outputs[0], mix.inputs[0])
    assert check_world(scene)
    factor.outputs[0].default_value = 0.5
    with pytest.raises(SceneError, match=r"gone\.exr"):
        check_world(scene)
    gone.mute = True
    assert check_world(scene)
    gone.mute = False
    tree.links.new(gone.outputs[0], two)  # the factor of 1 shows the other
    one.links and tree.links.remove(one.links[0])
    factor.outputs[0].default_value = 0.0
    assert check_world(scene)
    light.inputs["Strength"].default_value = 0.0
    factor.outputs[0].default_value = 1.0
    assert check_world(scene)


def test_a_sequence_shows_the_image_of_its_frame(scene, tmp_path):
    for number in range(1, 5):
        exr.write(
            tmp_path / f"map_{number:03d}.exr", {"": np.full((4, 8, 3), number / 10, np.float32)}
        )
    tree = scene.world.node_tree
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = bpy.data.images.load(str(tmp_path / "map_003.exr"))
    node.image.source, node.image.colorspace_settings.name = "SEQUENCE", "Linear Rec.709"
    tree.links.new(node.outputs[0], tree.nodes["Background"].inputs["Color"])
    user = node.image_user
    user.frame_duration, user.frame_start, user.frame_offset = 3, 2, 1
    found = []
    for frame in (2, 4):
        scene.frame_set(frame)
        found.append(kept.environment(scene, 64).image.mean())
    np.testing.assert_allclose(found, [0.2, 0.4], rtol=1e-3)
    plane = tree.nodes.new("ShaderNodeTexImage")
    plane.image, plane.image_user.frame_duration = node.image, 4
    tree.links.new(plane.outputs[0], tree.nodes["Background"].inputs["Color"])
    before = kept.shows(scene, scene.world)
    scene.frame_set(1)
    assert kept.shows(scene, scene.world) != before
    tree.links.new(node.outputs[0], tree.nodes["Background"].inputs["Color"])
    user.use_cyclic = True
    assert images.number_at(user, 1) == 4 and images.number_at(user, -1) == 2
    assert images.number_at(user, 5) == 2
    user.frame_offset = 2
    with pytest.raises(SceneError, match="without a file for frame 1"):
        check_world(scene)


def test_live_writes_a_world_that_stands_still(scene, tmp_path):
    """Another Blender makes its map, and has neither the scene nor its properties."""
    scene["sky"] = 0.6
    node = scene.world.node_tree.nodes.new("ShaderNodeAttribute")
    node.attribute_type, node.attribute_name = "VIEW_LAYER", "sky"
    background = scene.world.node_tree.nodes["Background"]
    scene.world.node_tree.links.new(node.outputs["Fac"], background.inputs["Strength"])
    blend, name, _ = sent.Sent(tmp_path).world(scene, scene.view_layers[0].name, scene.world)
    with bpy.data.libraries.load(str(blend)) as (there, into):
        assert not there.scenes and not there.objects
        into.worlds = [name]
    strength = into.worlds[0].node_tree.nodes["Background"].inputs["Strength"]
    assert strength.links[0].from_node.outputs[0].default_value == pytest.approx(0.6)
