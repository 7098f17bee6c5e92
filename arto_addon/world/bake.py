"""The scene's world, whatever its nodes, brought to an environment map.

Cycles itself evaluates it, through a panoramic camera. A world may show the camera something else
than it lights the scene with (Light Path nodes, ray visibility); then the camera sits inside a box
that refracts with an index of 1: what comes through is the world as the scene's surfaces see it.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ...core.environment import Environment
from ...core.errors import SceneError
from ...core.region import Region
from .stage import float_exr, picture_size, set_region
from .work import Render, blocking_render

SAMPLES = 4
# A texel that carries more than this share of all the light is a sun or a lamp: its edge is
# rendered again, with this many samples.
HOT = 1e-3
HOT_SAMPLES = 256
BLOCK = 64
# Of the world that is seen behind everything, and the noise at which a pixel has enough.
BACKGROUND_SAMPLES = 64
BACKGROUND_NOISE = 0.002


def check_world(scene: bpy.types.Scene) -> None:
    """Raise SceneError for a scene without a world, or one whose images are missing."""
    world = scene.world
    if world is None:
        raise SceneError(
            "the scene has no world to relight with: add one with an HDRI (World properties)"
        )
    check_no_volume(world)
    for tree in _trees(world.node_tree, set()):
        for node in tree.nodes:
            if node.bl_idname not in {"ShaderNodeTexEnvironment", "ShaderNodeTexImage"}:
                continue
            image = node.image
            if image is None:
                if any(o.is_linked for o in node.outputs):
                    raise SceneError(f"the world's node '{node.name}' has no image: choose an HDRI")
            elif image.source == "FILE" and not image.packed_file:
                path = Path(bpy.path.abspath(image.filepath, library=image.library))
                if not path.is_file():
                    raise SceneError(
                        f"the world's image '{image.name}' is missing on disk ({path}): find it "
                        "again (File, External Data, Find Missing Files), or choose another"
                    )


def check_no_volume(world: bpy.types.World) -> None:
    """Raise SceneError for a world filled with fog: it swallows light from afar, an HDRI's too."""
    out = world.node_tree.get_output_node("CYCLES") if world.node_tree else None
    if out and out.inputs["Volume"].is_linked:
        raise SceneError(
            "the world has a volume, which swallows all light from afar: put the fog into an "
            "object around the scene instead"
        )


def _trees(tree: Any, seen: set[int]) -> Iterator[Any]:
    """A node tree and the groups in it, each once."""
    if tree is None or tree.as_pointer() in seen:
        return
    seen.add(tree.as_pointer())
    yield tree
    for node in tree.nodes:
        if node.bl_idname == "ShaderNodeGroup":
            yield from _trees(node.node_tree, seen)


@contextmanager
def _studio(scene: bpy.types.Scene, name: str) -> Iterator[tuple[Any, list[Any]]]:
    """A new scene with the artist's world and frame and nothing else; removed at the end.

    Yields the scene and the list of data-blocks to remove with it.
    """
    studio = bpy.data.scenes.new(name)
    made: list[Any] = []
    try:
        studio.render.engine = "CYCLES"
        studio.world = scene.world.copy()
        made.append(studio.world)
        # nothing is lit here, so no map of where the light comes from is needed
        studio.world.cycles.sampling_method = "NONE"
        studio.frame_set(scene.frame_current, subframe=scene.frame_subframe)
        studio.cycles.device = scene.cycles.device
        studio.cycles.use_denoising = False
        studio.cycles.use_adaptive_sampling = False
        studio.render.resolution_percentage = 100
        studio.cycles.sample_clamp_direct = 0
        studio.cycles.sample_clamp_indirect = 0
        studio.render.use_compositing = False
        studio.render.use_sequencer = False
        studio.render.use_file_extension = False
        studio.view_layers[0].use_pass_combined = True
        float_exr(studio.render, multilayer=False)
        yield studio, made
    finally:
        bpy.data.batch_remove([*made, studio])


def _render(studio: Any) -> NDArray[np.float32]:
    """Render a studio scene -> (H, W, 4) float32, rows top-down."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.exr"
        studio.render.filepath = str(path)
        request = Render(studio.name, 0, "world")
        blocking_render(request)
        request.check()
        return next(iter(exr.read(path).values()))


def _pass_through(made: list[Any], studio: Any) -> None:
    """The box around the camera: what it lets through is no longer a camera ray."""
    material = bpy.data.materials.new("ARTO Pass Through")
    tree = material.node_tree
    tree.nodes.clear()
    glass = tree.nodes.new("ShaderNodeBsdfRefraction")
    glass.inputs["Roughness"].default_value = 0.0
    glass.inputs["IOR"].default_value = 1.0
    glass.inputs["Color"].default_value = (1, 1, 1, 1)
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(glass.outputs[0], output.inputs["Surface"])
    mesh = bpy.data.meshes.new("ARTO Pass Through")
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh.from_pydata(corners, [], faces)
    mesh.materials.append(material)
    box = bpy.data.objects.new("ARTO Pass Through", mesh)
    studio.collection.objects.link(box)
    made += [box, mesh, material]


def sees_the_camera(world: Any) -> bool:
    """Whether a world may look different to the camera than to the scene."""
    rays = world.cycles_visibility
    hidden = not all(
        getattr(rays, p.identifier)
        for p in rays.bl_rna.properties
        if p.type == "BOOLEAN" and not p.is_readonly
    )
    return hidden or any(
        node.bl_idname == "ShaderNodeLightPath"
        for tree in _trees(world.node_tree, set())
        for node in tree.nodes
    )


def _hot_blocks(image: NDArray[np.float32]) -> list[Region]:
    """Rectangles around the texels that carry much of the light."""
    energy = image.max(axis=-1) * Environment(image).row_solid_angles[:, None]
    hot = np.pad(energy > HOT * energy.sum(), 1)
    hot = sum(
        hot[1 + dy : hot.shape[0] - 1 + dy, 1 + dx : hot.shape[1] - 1 + dx]
        for dy in (-1, 0, 1)
        for dx in (-1, 0, 1)
    ).astype(bool)
    found = []
    for y in range(0, hot.shape[0], BLOCK):
        for x in range(0, hot.shape[1], BLOCK):
            rows, columns = np.nonzero(hot[y : y + BLOCK, x : x + BLOCK])
            if len(rows):
                found.append(Region.around(rows + y, columns + x))
    return found


def bake(scene: bpy.types.Scene, width: int) -> Environment:
    """The world's light as an equirectangular map, width x width/2, in the working space.

    Every texel is the mean over itself. Raises SceneError for a world that is not there or lacks
    an image.
    """
    check_world(scene)
    with _studio(scene, "ARTO World") as (studio, made):
        lens = bpy.data.cameras.new("ARTO Panorama")
        camera = bpy.data.objects.new("ARTO Panorama", lens)
        made += [camera, lens]
        studio.collection.objects.link(camera)
        studio.camera = camera
        lens.type = "PANO"
        lens.panorama_type = "EQUIRECTANGULAR"
        # the middle of the picture looks along +X, as the middle of a world texture does
        camera.rotation_euler = (math.pi / 2, 0, -math.pi / 2)
        lens.clip_start = 1e-3
        if sees_the_camera(scene.world):
            _pass_through(made, studio)
        render = studio.render
        render.resolution_x, render.resolution_y = width, width // 2
        studio.cycles.pixel_filter_type = "BOX"
        studio.cycles.samples = SAMPLES
        image = np.ascontiguousarray(_render(studio)[..., :3])
        studio.cycles.samples = HOT_SAMPLES
        for block in _hot_blocks(image):
            set_region(studio, block)
            image[block.slices] = _render(studio)[..., :3]
    return Environment(image)


def background(scene: bpy.types.Scene, region: Region | None = None) -> NDArray[np.float32]:
    """The world as the artist's camera sees it behind everything -> (H, W, 3).

    region: all that is looked at, 0 outside (default: everything). Pixels get as many samples as
    they need, up to `BACKGROUND_SAMPLES`: next to none in an even sky, all on the rim of a sun.
    """
    check_world(scene)
    with _studio(scene, "ARTO Background") as (studio, _):
        studio.camera = scene.camera
        width, height = picture_size(scene)
        render = studio.render
        render.resolution_x, render.resolution_y = width, height
        render.pixel_aspect_x = scene.render.pixel_aspect_x
        render.pixel_aspect_y = scene.render.pixel_aspect_y
        studio.cycles.pixel_filter_type = scene.cycles.pixel_filter_type
        studio.cycles.filter_width = scene.cycles.filter_width
        studio.cycles.film_exposure = scene.cycles.film_exposure
        studio.cycles.samples = BACKGROUND_SAMPLES
        studio.cycles.use_adaptive_sampling = True
        studio.cycles.adaptive_threshold = BACKGROUND_NOISE
        studio.cycles.adaptive_min_samples = 8
        region = region or Region(0, 0, width, height)
        set_region(studio, region)
        out = np.zeros((height, width, 3), np.float32)
        out[region.slices] = _render(studio)[..., :3]
        return out
