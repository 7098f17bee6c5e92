"""What artists' files have, one thing at a time: ways to change a small scene or its world."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bmesh
import bpy
import numpy as np
from arto.core import exr
from mathutils import Matrix

from .building import add_aimed, noded

Change = Callable[[bpy.types.Scene], None]
CASES: dict[str, tuple[str, Change]] = {}


def case(base: str = "four_spheres") -> Callable[[Change], Change]:
    """Name a change of one of `scenes.SCENES` after its function."""

    def note(change: Change) -> Change:
        CASES[change.__name__.replace("_", " ").strip()] = base, change
        return change

    return note


def _everything(scene: bpy.types.Scene, matrix: Matrix) -> None:
    for thing in scene.objects:
        if thing.parent is None:
            thing.matrix_world = matrix @ thing.matrix_world


def _mesh(name: str, corners: list, faces: list, material: Any) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    mesh.materials.append(material)
    thing = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(thing)
    return thing


@case()
def as_it_is(scene):
    pass


@case()
def ten_kilometres_from_the_origin(scene):
    _everything(scene, Matrix.Translation((10000, -3000, 200)))


@case()
def of_millimetres(scene):
    _everything(scene, Matrix.Scale(0.001, 4))
    scene.camera.data.clip_start = 1e-5


@case()
def orthographic(scene):
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 8


@case()
def panoramic(scene):
    scene.camera.data.type = "PANO"
    scene.camera.data.panorama_type = "EQUIRECTANGULAR"
    # a sun is far smaller than a pixel of a smaller one
    scene.render.resolution_x, scene.render.resolution_y = 256, 128


@case()
def shifted(scene):
    scene.camera.data.shift_x, scene.camera.data.shift_y = 0.2, -0.1


@case()
def depth_of_field(scene):
    dof = scene.camera.data.dof
    dof.use_dof, dof.aperture_fstop, dof.focus_distance = True, 0.3, 6


@case()
def motion_blur(scene):
    scene.render.use_motion_blur = True
    thing = scene.objects["mirror"]
    for frame, x in ((1, 0.0), (3, 1.5)):
        thing.location.x += x
        thing.keyframe_insert("location", frame=frame)
    scene.frame_set(2)


@case("soft")
def fur_wax_and_fog(scene):
    pass


@case("window")
def a_room_by_its_window(scene):
    pass


@case()
def alpha_cards(scene):
    """Forty leaves one behind the other, half of each clear."""
    material = noded(bpy.data.materials.new("leaf"))
    material.node_tree.nodes["Principled BSDF"].inputs["Alpha"].default_value = 0.1
    for i in range(40):
        y = -1.5 - 0.02 * i
        corners = [(-1, y, 0.2), (0, y, 0.2), (0, y, 1.4), (-1, y, 1.4)]
        _mesh(f"leaf{i}", corners, [(0, 1, 2, 3)], material)
    scene.cycles.transparent_max_bounces = 48


@case()
def instances(scene):
    part = bpy.data.collections.new("part")
    thing = scene.objects["glossy"]
    part.objects.link(thing)
    scene.collection.objects.unlink(thing)
    for i in range(3):
        empty = bpy.data.objects.new(f"instance{i}", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", part
        empty.location = (0.6 * i - 1, 0.4 * i, 0)
        scene.collection.objects.link(empty)


@case()
def geometry_nodes(scene):
    tree = bpy.data.node_groups.new("lift", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    start, end = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    move = tree.nodes.new("GeometryNodeTransform")
    move.inputs["Translation"].default_value = (0.2, -0.3, 0.2)
    tree.links.new(start.outputs[0], move.inputs[0])
    tree.links.new(move.outputs[0], end.inputs[0])
    scene.objects["diffuse"].modifiers.new("lift", "NODES").node_group = tree


@case()
def light_linking(scene):
    lamp = bpy.data.lights.new("spot", "AREA")
    lamp.energy, lamp.size = 300, 1
    item = add_aimed(scene, lamp, place=(2, -3, 4), target=(0, 0, 0.5))
    item.light_linking.receiver_collection = bpy.data.collections.new("lit")
    item.light_linking.receiver_collection.objects.link(scene.objects["diffuse"])


@case()
def own_light_groups(scene):
    for group in ("key", "ARTO_0000_white"):
        scene.view_layers[0].lightgroups.add(name=group)
    for i, group in enumerate(("key", "ARTO_0000_white")):
        lamp = bpy.data.lights.new(group, "AREA")
        lamp.energy, lamp.size = 200, 1
        item = add_aimed(scene, lamp, place=(3 - 6 * i, -3, 4), target=(0, 0, 0.5))
        item.lightgroup = group


@case()
def own_sun(scene):
    lamp = bpy.data.lights.new("sun", "SUN")
    lamp.energy, lamp.angle = 2, math.radians(0.5)
    add_aimed(scene, lamp, place=(2, -3, 4), target=(0, 0, 0))


@case()
def render_region(scene):
    r = scene.render
    r.use_border = True
    r.border_min_x, r.border_max_x, r.border_min_y, r.border_max_y = 0.2, 0.8, 0.1, 0.9


@case()
def half_percentage(scene):
    r = scene.render
    r.resolution_x, r.resolution_y, r.resolution_percentage = 128, 96, 50


@case()
def pixels_that_are_not_square(scene):
    scene.render.pixel_aspect_x = 2.0


@case()
def acescg(scene):
    bpy.ops.wm.set_working_color_space(working_space="ACEScg", convert_colors=True)


@case()
def eevee(scene):
    scene.render.engine = "BLENDER_EEVEE"


@case()
def a_dome_around_all(scene):
    mesh = bpy.data.meshes.new("dome")
    ball = bmesh.new()
    bmesh.ops.create_uvsphere(ball, u_segments=24, v_segments=12, radius=400)
    ball.to_mesh(mesh)
    ball.free()
    scene.collection.objects.link(bpy.data.objects.new("dome", mesh))


def _mapped(scene: bpy.types.Scene, rotation: tuple, scale: tuple = (1, 1, 1)) -> None:
    tree = scene.world.node_tree
    mapping = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value = rotation
    mapping.inputs["Scale"].default_value = scale


@case()
def world_turned_on_all_axes(scene):
    _mapped(scene, (0.5, -0.8, 1.9))


@case()
def world_mirrored(scene):
    _mapped(scene, (0, 0, 0.4), (-1, 1, 1))


@case()
def mirror_ball(scene):
    texture = next(n for n in scene.world.node_tree.nodes if "Environment" in n.bl_idname)
    texture.projection = "MIRROR_BALL"


def _sky(scene: bpy.types.Scene, kind: str, disc: bool) -> None:
    tree = scene.world.node_tree
    tree.nodes.clear()
    sky = tree.nodes.new("ShaderNodeTexSky")
    sky.sky_type = kind
    if hasattr(sky, "sun_disc"):
        sky.sun_disc = disc
        sky.sun_elevation = math.radians(35)
    background = tree.nodes.new("ShaderNodeBackground")
    background.inputs["Strength"].default_value = 0.05
    out = tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(sky.outputs[0], background.inputs[0])
    tree.links.new(background.outputs[0], out.inputs["Surface"])


def _skies() -> None:
    kinds = bpy.types.ShaderNodeTexSky.bl_rna.properties["sky_type"].enum_items
    for item in kinds:
        for disc in (True, False):
            name = f"sky {item.identifier.lower()}{'' if disc else ', no disc'}"

            def change(scene, kind=item.identifier, disc=disc):
                _sky(scene, kind, disc)

            CASES[name] = "four_spheres", change


_skies()


@case()
def light_path_mix(scene):
    """Another world to the camera than to the scene."""
    tree = scene.world.node_tree
    lit = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBackground")
    shown = tree.nodes.new("ShaderNodeBackground")
    shown.inputs["Color"].default_value = (0.1, 0.4, 0.8, 1)
    path, mix = tree.nodes.new("ShaderNodeLightPath"), tree.nodes.new("ShaderNodeMixShader")
    tree.links.new(path.outputs["Is Camera Ray"], mix.inputs[0])
    tree.links.new(lit.outputs[0], mix.inputs[1])
    tree.links.new(shown.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])


def _with_pixel(scene: bpy.types.Scene, value: float) -> None:
    texture = next(n for n in scene.world.node_tree.nodes if "Environment" in n.bl_idname)
    old = texture.image
    width, height = old.size
    pixels = np.empty(width * height * 4, np.float32)
    old.pixels.foreach_get(pixels)
    pixels.reshape(height, width, 4)[height * 2 // 3, width // 3, :3] = value
    new = bpy.data.images.new("with a pixel", width, height, float_buffer=True)
    new.colorspace_settings.name = old.colorspace_settings.name
    new.pixels.foreach_set(pixels)
    new.pack()
    texture.image = new


@case()
def a_pixel_that_is_infinite(scene):
    _with_pixel(scene, math.inf)


@case()
def a_pixel_that_is_no_number(scene):
    _with_pixel(scene, math.nan)


@case()
def a_pixel_that_is_negative(scene):
    _with_pixel(scene, -3.0)


def _as_file(scene: bpy.types.Scene, name: str, write: Callable[[Path, np.ndarray], None]) -> None:
    """The world's picture from a file of another kind; write: (path, (H, W, 3) top-down)."""
    texture = next(n for n in scene.world.node_tree.nodes if "Environment" in n.bl_idname)
    width, height = texture.image.size
    pixels = np.empty(width * height * 4, np.float32)
    texture.image.pixels.foreach_get(pixels)
    path = Path(tempfile.mkdtemp()) / name
    write(path, pixels.reshape(height, width, 4)[::-1, :, :3])
    texture.image = bpy.data.images.load(str(path))
    texture.image.colorspace_settings.name = "Linear Rec.709"


@case()
def a_map_of_the_kind_hdr(scene):
    def write(path: Path, pixels: np.ndarray) -> None:
        height, width = pixels.shape[:2]
        image = bpy.data.images.new("hdr", width, height, float_buffer=True)
        rgba = np.ones((height, width, 4), np.float32)
        rgba[..., :3] = pixels[::-1]
        image.pixels.foreach_set(rgba.ravel())
        image.filepath_raw, image.file_format = str(path), "HDR"
        image.save()

    _as_file(scene, "map.hdr", write)


@case()
def a_map_of_half_floats(scene):
    _as_file(scene, "map.exr", lambda path, p: exr.write(path, {"": p.astype(np.float16)}))


@case()
def a_map_of_16k(scene):
    def write(path: Path, pixels: np.ndarray) -> None:
        large = pixels.astype(np.float16).repeat(16, axis=0).repeat(16, axis=1)
        exr.write(path, {"": large})

    _as_file(scene, "map.exr", write)


@case()
def a_linked_library(scene):
    path = Path(tempfile.mkdtemp()) / "library.blend"
    thing = scene.objects["glossy"]
    bpy.data.libraries.write(str(path), {thing})
    bpy.data.objects.remove(thing)
    with bpy.data.libraries.load(str(path), link=True) as (_, wanted):
        wanted.objects = ["glossy"]
    scene.collection.objects.link(wanted.objects[0])
