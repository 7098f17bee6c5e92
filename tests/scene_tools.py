"""Small scenes for tests in Blender as a module, and ways to look at them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from arto.arto_addon import work
from arto.arto_addon.blender.compositing import add_output, new_compositor
from arto.arto_addon.blender.nodes import new_material, new_world
from arto.arto_addon.capture import capture as capture_module
from arto.arto_addon.shot import scene_id
from arto.core.capture.capture_set import CaptureSet

WIDTH, HEIGHT = 24, 18


def material(name: str, **inputs: Any) -> bpy.types.Material:
    out = new_material(name)
    shader = out.node_tree.nodes["Principled BSDF"]
    for key, value in inputs.items():
        shader.inputs[key.replace("_", " ")].default_value = value
    return out


def add_mesh(scene: bpy.types.Scene, name: str, corners: list, faces: list, mat: Any = None) -> Any:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    if mat:
        mesh.materials.append(mat)
    thing = bpy.data.objects.new(name, mesh)
    scene.collection.objects.link(thing)
    return thing


BOX = (
    [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)],
    [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)],
)


def small_scene(folder: Path, lamp: bool = False) -> bpy.types.Scene:
    """A diffuse floor, a diffuse and a half-glossy box; far too small to be pretty."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.render.resolution_percentage = 100
    floor = [(-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0)]
    add_mesh(scene, "Floor", floor, [(0, 1, 2, 3)], material("Floor", Roughness=1.0))
    add_mesh(scene, "Matt", *BOX, material("Matt", Base_Color=(0.8, 0.3, 0.1, 1), Roughness=1.0))
    scene.objects["Matt"].location = (-1.3, 0, 1)
    add_mesh(scene, "Glossy", *BOX, material("Glossy", Metallic=1.0, Roughness=0.3))
    scene.objects["Glossy"].location = (1.3, 0.3, 1)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    camera.location, camera.rotation_euler = (0, -9, 4), (math.radians(70), 0, 0)
    scene.camera = camera
    scene.world = new_world("World")
    if lamp:
        light = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
        light.data.energy = 2.0
        light.rotation_euler = (0.6, 0.3, 0)
        scene.collection.objects.link(light)
    settings = scene.arto
    settings.folder = str(folder / "arto")
    settings.output = str(folder / "relit.exr")
    settings.depth = "FLOAT"  # so that pictures can be compared closely
    settings.samples, settings.patches, settings.keep = 64, 1, "always"
    settings.patterns, settings.grain, settings.adaptive = "moments", True, False
    # the one thing of the artist's that a capture adds to is the scene's ID
    scene_id.give(scene)
    # the physics is looked at as it is
    settings.denoise = settings.lamps = False
    return scene


def set_colour(scene: bpy.types.Scene, colour: tuple[float, float, float], strength: float = 1.0):
    background = scene.world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*colour, 1)
    background.inputs["Strength"].default_value = strength


def hdri(scene, pixels, rotation=0.0):
    """A world with an equirectangular image (rows top-down), turned about the vertical."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("Sky", width, height, float_buffer=True)
    image.colorspace_settings.name = "Linear Rec.709"
    rgba = np.dstack([pixels, np.ones((height, width))]).astype(np.float32)
    image.pixels.foreach_set(rgba[::-1].ravel())
    image.pack()
    tree = scene.world.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value = (0, 0, rotation)
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs[0])
    tree.links.new(mapping.outputs[0], texture.inputs[0])
    tree.links.new(texture.outputs[0], tree.nodes["Background"].inputs["Color"])
    return texture


def smooth(height=64):
    v, u = np.mgrid[:height, : 2 * height] / height
    return np.dstack([1 + np.sin(np.pi * u), v, 0.5 + 0.5 * np.cos(2 * np.pi * u) * v])


@contextmanager
def world_volume(scene: bpy.types.Scene) -> Iterator[None]:
    """The scene's world filled with fog for a while."""
    tree = scene.world.node_tree
    fog = tree.nodes.new("ShaderNodeVolumeScatter")
    tree.links.new(fog.outputs[0], tree.get_output_node("CYCLES").inputs["Volume"])
    yield
    tree.nodes.remove(fog)


def captured(scene: bpy.types.Scene) -> CaptureSet:
    """Capture the scene as a batch run does."""
    return CaptureSet(work.run(capture_module.capture(scene, scene.view_layers[0].name)))


def cycles(scene: bpy.types.Scene, samples: int, seed: int, folder: Path) -> np.ndarray:
    """What Cycles renders of the scene itself -> (H, W, 4), top-down."""
    from arto.arto_addon.blender.output import float_exr
    from arto.arto_addon.stage.stage import stage
    from arto.core import exr

    with stage(scene, scene.view_layers[0].name) as on:
        float_exr(on.scene.render, multilayer=False)
        settings = on.scene.cycles
        settings.samples, settings.seed = samples, seed
        settings.use_adaptive_sampling = settings.use_denoising = False
        settings.sample_clamp_indirect = 0
        on.scene.render.film_transparent = True
        on.scene.render.filepath = str(folder / "cycles.exr")
        request = work.Render(on.scene.name, 0, "")
        work.blocking_render(request)
        request.check()
    return next(iter(exr.read(folder / "cycles.exr").values()))


def instance_of(collection, into):
    empty = bpy.data.objects.new("Instance", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    into.objects.link(empty)
    return empty


def made_by_nodes(thing: bpy.types.Object, maker: bpy.types.Object) -> None:
    """Let an object's geometry nodes make an instance of a thing, and nothing else."""
    tree = bpy.data.node_groups.new("Made", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    info = tree.nodes.new("GeometryNodeObjectInfo")
    info.inputs["Object"].default_value = thing
    info.inputs["As Instance"].default_value = True
    out = tree.nodes.new("NodeGroupOutput")
    tree.links.new(info.outputs["Geometry"], out.inputs[0])
    maker.modifiers.new("Made", "NODES").node_group = tree


def in_compositor(scene: bpy.types.Scene, group: Any, output: str) -> Any:
    """A node group's node in a compositor of the scene that puts out one of its outputs."""
    tree = new_compositor(scene, "Comp")
    node, out = tree.nodes.new("CompositorNodeGroup"), add_output(tree)
    node.node_tree = group
    tree.links.new(node.outputs[output], out.inputs[0])
    return node


def composited(scene: bpy.types.Scene, folder: Path) -> np.ndarray:
    """What Blender's compositor puts out of a scene -> (H, W, 4)."""
    from arto.arto_addon.blender.output import float_exr
    from arto.core import exr

    scene.render.use_compositing, scene.cycles.samples = True, 1
    float_exr(scene.render, multilayer=False)
    scene.render.filepath = str(folder / "composited.exr")
    bpy.ops.render.render(write_still=True)
    return next(iter(exr.read(folder / "composited.exr").values()))


def assert_as_cycles(picture: np.ndarray, scene: Any, samples: int, folder: Path) -> None:
    """A plate (H, W, 4) is what Cycles renders: off by less than two of its renders are from each
    other, twice over, and as bright to a hundredth."""
    one, two = (cycles(scene, samples, seed, folder) for seed in (1, 2))
    seen = one[..., 3] > 0.999
    noise = np.abs(one - two)[seen].mean()
    assert np.abs(picture - one)[seen].mean() < 2 * noise
    assert abs(picture[seen].mean() / one[seen].mean() - 1) < 0.01


_SKIP = {"rna_type", "original", "session_uid", "users", "tag", "is_evaluated", "bl_rna"}


def snapshot(value: Any = None, depth: int = 0, seen: frozenset[int] = frozenset()) -> Any:
    """Every property of the file's scenes, worlds, collections, objects, cameras, materials and
    node trees, as plain values to be compared."""
    if value is None:
        # what Blender works out lazily (matrices, bounds, normals) is worked out on both sides
        bpy.context.view_layer.update()
        kinds = (
            "scenes",
            "worlds",
            "collections",
            "objects",
            "cameras",
            "materials",
            "meshes",
            "node_groups",
            "lights",
            "images",
        )

        def look() -> Any:
            return {
                kind: {
                    block.name: snapshot(block)
                    for block in getattr(bpy.data, kind)
                    # Blender's own, of whatever was rendered last
                    if block.name != "Render Result"
                }
                for kind in kinds
            }

        # looking at a mesh's vertices gives it attributes: look once for that
        look()
        return look()
    if isinstance(value, bpy.types.bpy_struct):
        embedded = isinstance(value, bpy.types.NodeTree) and value.is_embedded_data
        if depth and isinstance(value, bpy.types.ID) and not embedded:
            return value.name_full
        if depth > 8 or value.as_pointer() in seen:
            return None
        seen = seen | {value.as_pointer()}
        out = {}
        for prop in value.bl_rna.properties:
            if prop.identifier in _SKIP or prop.identifier in {"depsgraph", "preview"}:
                continue
            try:
                item = getattr(value, prop.identifier)
            except (AttributeError, RuntimeError):
                continue
            out[prop.identifier] = snapshot(item, depth + 1, seen) if item is not None else None
        return out
    if isinstance(value, bpy.types.bpy_prop_collection):
        return [snapshot(item, depth + 1, seen) for item in value if item is not None]
    if isinstance(value, (str, int, float, bool, bytes)):
        return value
    if isinstance(value, (set, frozenset)):
        return sorted(map(str, value))
    try:
        return [snapshot(item, depth + 1, seen) for item in value]
    except TypeError:
        return repr(type(value))


def differences(before: Any, after: Any, path: str = "") -> list[str]:
    """Where two snapshots differ, in words."""
    if isinstance(before, dict) and isinstance(after, dict):
        keys = sorted(before.keys() | after.keys())
        return [
            d for key in keys for d in differences(before.get(key), after.get(key), f"{path}.{key}")
        ]
    return [] if before == after else [f"{path}: {before!s:.80} -> {after!s:.80}"]


def holding_out(scene, how):
    """Let the one box hold out, wholly or (`mixed`) half."""
    matt = scene.objects["Matt"]
    if how == "object":
        matt.is_holdout = True
    elif how == "collection":
        held = bpy.data.collections.new("Held")
        scene.collection.children.link(held)
        scene.collection.objects.unlink(matt)
        held.objects.link(matt)
        scene.view_layers[0].layer_collection.children["Held"].holdout = True
    else:
        tree = matt.data.materials[0].node_tree
        out = tree.get_output_node("CYCLES")
        hole, mix = tree.nodes.new("ShaderNodeHoldout"), tree.nodes.new("ShaderNodeMixShader")
        mix.inputs[0].default_value = 0.5 if how == "mixed" else 1.0
        tree.links.new(tree.nodes["Principled BSDF"].outputs[0], mix.inputs[1])
        tree.links.new(hole.outputs[0], mix.inputs[2])
        tree.links.new(mix.outputs[0], out.inputs["Surface"])
