"""Bake the scene's world, whatever its nodes, to an environment map.

Cycles evaluates the world through a panoramic camera. Light Path nodes and ray visibility may show
the camera another world than lights the scene. Then the camera sits inside a box that refracts with
an index of 1. Through the box, the camera sees the world as the scene's surfaces see it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.light.environment import Environment
from ...core.region import Region
from ..blender.nodes import Nodes, new_material, shader_tree
from ..blender.reached import reached, reached_places
from ..shot.shot import layer_of
from ..stage.stage import set_region
from .brightest import brightest
from .check import check_images, check_world
from .detail import detail
from .still import still
from .studio import render as render_studio
from .studio import studio_scene

# The least samples of a texel. A world that is finer than the map gets more, by the texels of the
# world in a texel of the map.
SAMPLES = 4
# The samples of a texel of a rough map, and those of all its texels with lamps together. While the
# lamps are looked for, the sun of a sky is so many texels wide: a smaller one is missed by so few.
ROUGH_SAMPLES, ROUGH_HOT = 2, 2**18
ROUGH_SUN = 3
# The most blocks with lamps that a rough map has time for.
ROUGH_BLOCKS = 4
# A texel with more than the share HOT of all light is part of a sun or a lamp. Such texels are
# rendered again with their neighbours, FINER times as fine as the world. A lamp as large as two of
# the world's texels then keeps its light to 0.3%. All these renders together take about
# HOT_SAMPLES, which may make them less fine.
HOT = 1e-3
FINER = 20
HOT_SAMPLES = 2**23
# The least samples of such a texel. Of n samples, Cycles puts each too near to the texel's middle,
# by 1 / n.
LEAST_HOT = 256
BLOCK = 32
# A world's brightness may have a bound. Where a texel as bright as that has next to none of all
# light, no texel hides a sun, and few samples tell the light: (a share of the light, samples that
# are enough up to that share).
DIM = ((4e-4, 8), (4e-3, 32))
LEAST_WIDTH = 1024


def _pass_through(made: list[bpy.types.ID], studio: bpy.types.Scene) -> None:
    """Put a clear box around the camera, so that rays behind the box are no camera rays."""
    material = new_material("ARTO Pass Through")
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


def sees_the_camera(world: bpy.types.World) -> bool:
    """Whether a world may look different to the camera than to the scene."""
    rays = world.cycles_visibility
    hidden = not all(
        getattr(rays, p.identifier)
        for p in rays.bl_rna.properties
        if p.type == "BOOLEAN" and not p.is_readonly
    )
    return hidden or any(node.bl_idname == "ShaderNodeLightPath" for node in reached(world))


def _by_area(world: bpy.types.World) -> None:
    """Multiply a world's light by the cosine of the latitude.

    The samples of a texel are spread evenly over the equirectangular map, where solid angle goes by
    that cosine. The weight matters for a texel with a lamp inside, above all beside a pole. An even
    texel does not need the weight, which would only add noise.
    """
    tree = shader_tree(world)
    out = tree.get_output_node("CYCLES") if tree else None
    if tree is None or out is None or not out.inputs["Surface"].is_linked:
        return
    nodes = Nodes(tree)
    direction = tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"]
    split = nodes.add("ShaderNodeSeparateXYZ", direction)
    x, y = split.outputs[0], split.outputs[1]
    # Not by 1 - z^2, which loses all its digits beside a pole.
    square = nodes.math("MULTIPLY_ADD", x, x, nodes.math("MULTIPLY", y, y))
    cosine = nodes.math("SQRT", square)
    mix = tree.nodes.new("ShaderNodeMixShader")
    tree.links.new(cosine, mix.inputs[0])
    tree.links.new(out.inputs["Surface"].links[0].from_socket, mix.inputs[2])
    tree.links.new(mix.outputs[0], out.inputs["Surface"])


def _runs(these: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """The begin and the end (exclusive) of each run of True."""
    edges = np.flatnonzero(np.diff(np.pad(these.astype(np.int8), 1)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _hot_blocks(image: NDArray[np.float32]) -> list[Region]:
    """Find rectangles that cover the texels with much of the light, and the texels' neighbours.

    Neighbours across the map's seam count as well.
    """
    environment = Environment(image)
    # Every row is held to the threshold of the equator. At a pole a lamp is spread over a whole row
    # of small texels.
    solid_angle = environment.row_solid_angles.max()
    hot = image.max(axis=-1) * solid_angle > HOT * environment.irradiance().max()
    hot = np.pad(hot, ((1, 1), (0, 0)))
    hot = hot | np.roll(hot, 1, axis=1) | np.roll(hot, -1, axis=1)
    hot = hot[:-2] | hot[1:-1] | hot[2:]
    found = []
    for y in range(0, hot.shape[0], BLOCK):
        for x in range(0, hot.shape[1], BLOCK):
            block = hot[y : y + BLOCK, x : x + BLOCK]
            for top, bottom in _runs(block.any(axis=1)):
                found += [
                    Region(x + left, y + top, right - left, bottom - top)
                    for left, right in _runs(block[top:bottom].any(axis=0))
                ]
    return found


def _power_of_two(samples: float) -> int:
    """The nearest power of two, for which Cycles' samples are spread evenly; at least `SAMPLES`."""
    return 2 ** round(math.log2(max(SAMPLES, samples)))


@contextmanager
def _panorama(
    scene: bpy.types.Scene, view_layer: str | None, world: bpy.types.World
) -> Iterator[bpy.types.Scene]:
    """Make a studio whose camera sees all of a world, as the scene's surfaces see the world."""
    check_images(world, scene.frame_current)
    with (
        still(scene, view_layer or layer_of(scene), world) as held,
        studio_scene(scene, held, "ARTO World") as (studio, made),
    ):
        lens = bpy.data.cameras.new("ARTO Panorama")
        camera = bpy.data.objects.new("ARTO Panorama", lens)
        made += [camera, lens]
        studio.collection.objects.link(camera)
        studio.camera = camera
        lens.type = "PANO"
        lens.panorama_type = "EQUIRECTANGULAR"
        # The middle of the picture looks along +X, like the middle of a world texture.
        camera.rotation_euler = (math.pi / 2, 0, -math.pi / 2)
        lens.clip_start = 1e-3
        if sees_the_camera(world):
            _pass_through(made, studio)
            rays = studio.world.cycles_visibility
            # Rays through the box are transmission rays. They must see the world wherever any other
            # kind of ray sees it.
            rays.transmission = rays.diffuse or rays.glossy or rays.transmission or rays.scatter
        studio.cycles.pixel_filter_type = "BOX"
        yield studio


def rough(scene: bpy.types.Scene, width: int, world: bpy.types.World) -> Environment:
    """Make a rough map of a world in a moment, for Live while the artist moves a slider.

    A texel has few samples, so detail finer than a texel is noisy. Lamps that the few samples find
    keep their light, as do the suns of skies.
    """
    with _panorama(scene, None, world) as studio:
        height = width // 2
        studio.render.resolution_x, studio.render.resolution_y = width, height
        studio.cycles.samples = ROUGH_SAMPLES
        finest = detail(world)
        if finest <= width // 2 or math.isfinite(brightest(studio.world)):
            return Environment(np.ascontiguousarray(render_studio(studio)[..., :3]))
        studio.render.use_persistent_data = True
        with _wide_suns(studio.world, ROUGH_SUN * 2 * math.pi / width):
            image = np.ascontiguousarray(render_studio(studio)[..., :3])
        energy = image.max(axis=-1) * Environment(image).row_solid_angles[:, None]
        blocks = sorted(_hot_blocks(image), key=lambda b: -float(energy[b.slices].sum()))
        _lamps_again(studio, image, blocks[:ROUGH_BLOCKS], finest / width, ROUGH_HOT)
        studio.render.use_persistent_data = False
        return Environment(image)


@contextmanager
def _wide_suns(world: bpy.types.World, least: float) -> Iterator[None]:
    """Make the suns of a world's skies at least so wide, in radians. Their light stays the same."""
    skies = [n for n, _ in reached_places(world) if n.bl_idname == "ShaderNodeTexSky"]
    were = [(sky, sky.sun_size) for sky in skies]
    try:
        for sky, size in were:
            sky.sun_size = max(size, least)
        yield
    finally:
        for sky, size in were:
            sky.sun_size = size


def _lamps_again(
    studio: bpy.types.Scene,
    image: NDArray[np.float32],
    blocks: list[Region],
    fineness: float,
    budget: int,
) -> None:
    """Render blocks of a map with lamps in them again, with many samples, and put them into it.

    image: the map, (H, W, 3), which is changed; fineness: how many times finer than the map the
    world is; budget: about so many samples for all blocks together. The studio's world is changed.
    """
    height = len(image)
    _by_area(studio.world)
    edges = np.sin(np.linspace(np.pi / 2, -np.pi / 2, height + 1))
    cosine = ((edges[:-1] - edges[1:]) / (np.pi / height)).astype(np.float32)[:, None, None]
    # One half of the samples is shared equally, and the other half by the blocks' light. By
    # light alone, a block with only the rim of a lamp would get too few.
    energy = image.max(axis=-1) * Environment(image).row_solid_angles[:, None]
    light = [float(energy[b.slices].sum()) for b in blocks]
    for block, amount in zip(blocks, light, strict=True):
        part = (1 / len(blocks) + amount / sum(light)) / 2
        room = budget * part / block.pixels
        finer = min((FINER * max(fineness, 1)) ** 2, room)
        studio.cycles.samples = max(LEAST_HOT, _power_of_two(finer))
        set_region(studio, block)
        rows, _ = block.slices
        image[block.slices] = render_studio(studio)[..., :3] / cosine[rows]


def _dim(studio: bpy.types.Scene) -> NDArray[np.float32] | None:
    """Render a world that has no suns -> (H, W, 3), or None for a world that may have some."""
    most = brightest(studio.world)
    if not math.isfinite(most):
        return None
    for least, samples in DIM:
        studio.cycles.samples = samples
        image = np.ascontiguousarray(render_studio(studio)[..., :3])
        environment = Environment(image)
        share = most * environment.row_solid_angles.max() / environment.irradiance().max()
        if share <= least:
            return image
        if share > DIM[-1][0]:
            break
    return None


def bake(
    scene: bpy.types.Scene,
    width: int,
    view_layer: str | None = None,
    world: bpy.types.World | None = None,
) -> Environment:
    """Bake a view layer's world to an equirectangular map, width x width / 2, in the working space.

    Each texel is the mean of the light over the texel. The number of samples follows from the
    detail of the world: a disc of a tenth of a degree keeps its light to 1%. A world that has no
    room for a lamp, as clouds, needs few.
    world: the world to bake (default: the view layer's). Raises SceneError where there is no world
    or an image of the world is missing; CancelledError.
    """
    world = world or check_world(scene, view_layer)
    with _panorama(scene, view_layer, world) as studio:
        finest = detail(world)
        # Lamps are found in small texels. A coarse map gets the means of the small texels.
        scale = math.ceil(min(finest, LEAST_WIDTH) / width)
        width, height = scale * width, scale * (width // 2)
        render = studio.render
        render.resolution_x, render.resolution_y = width, height
        # Persistent data keeps the world's images loaded for all blocks.
        render.use_persistent_data = True
        fineness = finest / width
        image = _dim(studio) if fineness**2 > DIM[-1][1] else None
        if image is not None:
            return Environment(image).coarser(scale)
        studio.cycles.samples = _power_of_two(fineness**2)
        image = np.ascontiguousarray(render_studio(studio)[..., :3])
        blocks = _hot_blocks(image)
        _lamps_again(studio, image, blocks, fineness, HOT_SAMPLES)
        # This lets go of the images.
        render.use_persistent_data = False
    return Environment(image).coarser(scale)
