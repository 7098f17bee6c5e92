"""Cases of the field that depend on more than nodes: on cameras, clocks, properties and files."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from arto.core import exr

from .building import noded
from .field_cases import case
from .kit_cases import CASES

__all__ = ["CASES"]


def _background(scene: bpy.types.Scene, empty: bool = True) -> tuple[Any, Any]:
    """The tree of the scene's world and its background node; empty: without its HDRI."""
    tree = scene.world.node_tree
    if empty:
        tree.nodes.clear()
        light = tree.nodes.new("ShaderNodeBackground")
        out = tree.nodes.new("ShaderNodeOutputWorld")
        tree.links.new(light.outputs[0], out.inputs["Surface"])
    return tree, next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBackground")


def _striped(scene: bpy.types.Scene, coordinates: Any, scale: float = 3.0) -> None:
    """A world of soft stripes along coordinates, which is not the same in two places."""
    tree, light = scene.world.node_tree, _background(scene, empty=False)[1]
    waves = tree.nodes.new("ShaderNodeVectorMath")
    waves.operation = "SINE"
    times = tree.nodes.new("ShaderNodeVectorMath")
    times.operation = "SCALE"
    times.inputs["Scale"].default_value = scale
    tree.links.new(coordinates, times.inputs[0])
    tree.links.new(times.outputs[0], waves.inputs[0])
    up = tree.nodes.new("ShaderNodeVectorMath")
    up.inputs[1].default_value = (1.05, 1.05, 1.05)
    tree.links.new(waves.outputs[0], up.inputs[0])
    tree.links.new(up.outputs[0], light.inputs["Color"])


def _coordinates(scene: bpy.types.Scene, output: str, kind: str = "ShaderNodeTexCoord") -> None:
    tree, _ = _background(scene)
    _striped(scene, tree.nodes.new(kind).outputs[output])


@case()
def world_of_camera_coordinates(scene):
    _coordinates(scene, "Camera")


@case()
def world_of_window_coordinates(scene):
    _coordinates(scene, "Window", "ShaderNodeTexCoord")


@case()
def world_of_window_coordinates_orthographic(scene):
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 8
    _coordinates(scene, "Window", "ShaderNodeTexCoord")


@case()
def world_of_window_coordinates_panoramic(scene):
    scene.camera.data.type = "PANO"
    _coordinates(scene, "Window", "ShaderNodeTexCoord")


@case()
def world_of_the_view_vector(scene):
    _coordinates(scene, "View Vector", "ShaderNodeCameraData")


@case()
def world_of_the_view_distance(scene):
    _coordinates(scene, "View Distance", "ShaderNodeCameraData")


@case()
def world_turned_into_the_camera(scene):
    tree, _ = _background(scene)
    node = tree.nodes.new("ShaderNodeVectorTransform")
    node.vector_type, node.convert_from, node.convert_to = "VECTOR", "WORLD", "CAMERA"
    direction = tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"]
    tree.links.new(direction, node.inputs[0])
    _striped(scene, node.outputs[0])


def _attribute(tree: Any, name: str) -> Any:
    node = tree.nodes.new("ShaderNodeAttribute")
    node.attribute_type, node.attribute_name = "VIEW_LAYER", name
    return node.outputs["Color"]


@case()
def world_of_a_scenes_property(scene):
    tree, light = _background(scene)
    scene["sky"] = [0.9, 0.4, 0.2]
    tree.links.new(_attribute(tree, "sky"), light.inputs["Color"])


@case()
def world_of_its_own_property(scene):
    tree, light = _background(scene)
    scene.world["sky"] = [0.2, 0.5, 0.9]
    tree.links.new(_attribute(tree, "sky"), light.inputs["Color"])


@case()
def material_of_a_worlds_property(scene):
    scene.world["paint"] = [0.9, 0.6, 0.1]
    tree = scene.objects["diffuse"].data.materials[0].node_tree
    shader = tree.nodes["Principled BSDF"]
    tree.links.new(_attribute(tree, "paint"), shader.inputs["Base Color"])


@case()
def material_driven_by_the_world(scene):
    scene.world["paint"] = 0.9
    tree = scene.objects["diffuse"].data.materials[0].node_tree
    driver = tree.nodes["Principled BSDF"].inputs["Base Color"].driver_add("default_value", 0)
    _context(driver.driver, 'world["paint"]')


def _context(driver: bpy.types.Driver, path: str) -> None:
    driver.type = "SUM"
    variable = driver.variables.new()
    variable.type = "CONTEXT_PROP"
    variable.targets[0].context_property = "ACTIVE_SCENE"
    variable.targets[0].data_path = path


def _group(name: str) -> tuple[Any, Any]:
    """A group that gives a value, and the value's socket."""
    group = bpy.data.node_groups.new(name, "ShaderNodeTree")
    group.interface.new_socket("Value", in_out="OUTPUT", socket_type="NodeSocketFloat")
    value, out = group.nodes.new("ShaderNodeValue"), group.nodes.new("NodeGroupOutput")
    group.links.new(value.outputs[0], out.inputs[0])
    return group, value.outputs[0]


def _strength_of(scene: bpy.types.Scene, group: Any) -> None:
    tree, light = _background(scene, empty=False)
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    tree.links.new(node.outputs[0], light.inputs["Strength"])


@case()
def world_driven_in_a_group(scene):
    scene["sky"] = 0.6
    group, value = _group("driven")
    _context(value.driver_add("default_value").driver, '["sky"]')
    _strength_of(scene, group)


@case()
def world_keyed_in_a_group_of_stretched_time(scene):
    group, value = _group("keyed")
    for frame, strength in ((1, 0.2), (41, 2.2)):
        value.default_value = strength
        value.keyframe_insert("default_value", frame=frame)
    _strength_of(scene, group)
    scene.render.frame_map_new = 50
    scene.frame_set(8)


@case()
def world_driven_by_the_frame(scene):
    group, value = _group("frame")
    value.driver_add("default_value").driver.expression = "frame / 20"
    _strength_of(scene, group)
    scene.render.frame_map_new = 50
    scene.frame_set(8)


@case()
def world_turned_by_a_keyed_empty(scene):
    empty = bpy.data.objects.new("turns", None)
    scene.collection.objects.link(empty)
    for frame, turn in ((1, 0.0), (41, 4.0)):
        empty.rotation_euler = (0, 0, turn)
        empty.keyframe_insert("rotation_euler", frame=frame)
    tree, _ = _background(scene, empty=False)
    place = tree.nodes.new("ShaderNodeTexCoord")
    place.object = empty
    texture = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeTexEnvironment")
    tree.links.new(place.outputs["Object"], texture.inputs["Vector"])
    scene.render.frame_map_new = 50
    scene.frame_set(8)


def _sequence(scene: bpy.types.Scene, kind: str) -> Any:
    """A node that shows a sequence of six HDRIs, each of another colour, beginning at 1."""
    folder = Path(tempfile.mkdtemp())
    rng = np.random.default_rng(3)
    for number in range(1, 7):
        texels = np.ones((32, 64, 3), np.float32) * rng.uniform(0.1, 1.5, 3)
        texels[:12] *= number
        exr.write(folder / f"sky_{number:04d}.exr", {"": texels.astype(np.float32)})
    tree, light = _background(scene)
    node = tree.nodes.new(kind)
    node.image = bpy.data.images.load(str(folder / "sky_0001.exr"))
    node.image.source, node.image.colorspace_settings.name = "SEQUENCE", "Linear Rec.709"
    node.image_user.frame_duration = 6
    tree.links.new(node.outputs[0], light.inputs["Color"])
    return node


@case()
def a_sequence_that_begins_at_1(scene):
    _sequence(scene, "ShaderNodeTexEnvironment")
    scene.frame_set(4)


@case()
def a_sequence_with_an_offset_that_begins_anew(scene):
    user = _sequence(scene, "ShaderNodeTexEnvironment").image_user
    user.frame_start, user.frame_duration, user.frame_offset, user.use_cyclic = 3, 4, 1, True
    scene.frame_set(11)


@case()
def a_sequence_in_an_image_texture(scene):
    node = _sequence(scene, "ShaderNodeTexImage")
    tree = node.id_data
    tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"], node.inputs[0])
    scene.frame_set(5)


@case()
def a_sequence_that_lacks_its_frame(scene):
    _sequence(scene, "ShaderNodeTexEnvironment").image_user.frame_offset = 40


def _gone(tree: Any) -> Any:
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = bpy.data.images.new("gone", 4, 4)
    node.image.source, node.image.filepath = "FILE", str(Path(tempfile.mkdtemp()) / "gone.exr")
    return node


@case()
def a_lost_map_that_leads_nowhere(scene):
    _gone(scene.world.node_tree)


@case()
def a_lost_map_that_is_not_mixed_in(scene):
    tree, light = _background(scene, empty=False)
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type = "RGBA"
    mix.inputs[0].default_value = 0.0
    one, two = (s for s in mix.inputs if s.enabled and s.type == "RGBA")
    tree.links.new(light.inputs["Color"].links[0].from_socket, one)
    tree.links.new(_gone(tree).outputs[0], two)
    tree.links.new(next(s for s in mix.outputs if s.enabled), light.inputs["Color"])


@case()
def a_zone_that_was_played(scene):
    tree = bpy.data.node_groups.new("rises", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    first, last = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    begin = tree.nodes.new("GeometryNodeSimulationInput")
    end = tree.nodes.new("GeometryNodeSimulationOutput")
    begin.pair_with_output(end)
    move = tree.nodes.new("GeometryNodeSetPosition")
    move.inputs["Offset"].default_value = (0, 0, 0.1)
    tree.links.new(first.outputs[0], begin.inputs["Geometry"])
    tree.links.new(begin.outputs["Geometry"], move.inputs["Geometry"])
    tree.links.new(move.outputs[0], end.inputs["Geometry"])
    tree.links.new(end.outputs["Geometry"], last.inputs[0])
    scene.objects["diffuse"].modifiers.new("rises", "NODES").node_group = tree
    for frame in range(1, 9):
        scene.frame_set(frame)


@case()
def grease_pencil(scene):
    bpy.ops.object.grease_pencil_add(type="STROKE")


@case()
def freestyle(scene):
    scene.render.use_freestyle = True


@case()
def stereo(scene):
    scene.render.use_multiview = True


@case()
def a_marker_with_a_camera(scene):
    other = scene.camera.copy()
    scene.collection.objects.link(other)
    other.location.x += 1.5
    other.location.z += 0.5
    scene.timeline_markers.new("cut", frame=1).camera = other


@case()
def world_whose_light_ends(scene):
    scene.world.cycles.max_bounces = 0


@case()
def leaves_beyond_the_transparent_bounces(scene):
    material = noded(bpy.data.materials.new("leaf"))
    material.node_tree.nodes["Principled BSDF"].inputs["Alpha"].default_value = 0.1
    for i in range(20):
        y = -1.5 - 0.02 * i
        mesh = bpy.data.meshes.new("leaf")
        corners = [(-2, y, 0.0), (2, y, 0.0), (2, y, 2.4), (-2, y, 2.4)]
        mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
        mesh.materials.append(material)
        scene.collection.objects.link(bpy.data.objects.new("leaf", mesh))


@case()
def a_film_of_low_exposure(scene):
    scene.cycles.film_exposure = 1 / 20_000


@case()
def a_background_scene(scene):
    behind = bpy.data.scenes.new("behind")
    mesh = bpy.data.meshes.new("wall")
    mesh.from_pydata([(-9, 5, -1), (9, 5, -1), (9, 5, 3), (-9, 5, 3)], [], [(0, 1, 2, 3)])
    behind.collection.objects.link(bpy.data.objects.new("wall", mesh))
    scene.background_set = behind


@case()
def clouds(scene):
    tree, light = _background(scene)
    noise, ramp = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeValToRGB")
    noise.inputs["Scale"].default_value, noise.inputs["Detail"].default_value = 3, 12
    ramp.color_ramp.elements[0].position, ramp.color_ramp.elements[1].position = 0.45, 0.65
    ramp.color_ramp.elements[0].color = (0.1, 0.25, 0.6, 1)
    tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"], noise.inputs[0])
    tree.links.new(noise.outputs[0], ramp.inputs[0])
    tree.links.new(ramp.outputs[0], light.inputs["Color"])


@case()
def stars(scene):
    tree, light = _background(scene)
    cells, ramp = tree.nodes.new("ShaderNodeTexVoronoi"), tree.nodes.new("ShaderNodeValToRGB")
    cells.inputs["Scale"].default_value = 60
    ramp.color_ramp.elements[0].color = (40, 40, 40, 1)
    ramp.color_ramp.elements[1].color = (0.02, 0.02, 0.04, 1)
    ramp.color_ramp.elements[1].position = 0.08
    tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"], cells.inputs[0])
    tree.links.new(cells.outputs["Distance"], ramp.inputs[0])
    tree.links.new(ramp.outputs[0], light.inputs["Color"])


@case()
def world_of_a_view_layer(scene):
    """A world of the view layer's own, which reads a property of the scene's world."""
    scene.world["sky"] = [0.7, 0.3, 0.1]
    own = noded(bpy.data.worlds.new("own"))
    own["sky"] = [0.0, 0.0, 1.0]
    light = next(n for n in own.node_tree.nodes if n.bl_idname == "ShaderNodeBackground")
    own.node_tree.links.new(_attribute(own.node_tree, "sky"), light.inputs["Color"])
    light.inputs["Strength"].default_value = 1 / math.pi
    scene.view_layers[0].world_override = own
