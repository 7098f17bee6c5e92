"""The world as the camera sees it behind all things."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ...core.capture.names import combined
from ...core.region import Region
from ..blender.front import set_on_world
from ..blender.output import float_exr, write_to
from ..blender.reached import reached
from ..blender.scratch import temporary
from ..shot.shot import layer_of
from ..stage.bounds import rendered
from ..stage.settings import prepare
from ..stage.stage import Stage, free_mark, picture_size, set_region, stage
from ..stage.takes import WHOLE, take
from ..work import Render, blocking_render
from .check import check_world
from .still import still

# The most samples of a pixel of the background, and the noise at which a pixel has enough samples.
BACKGROUND_SAMPLES = 64
BACKGROUND_NOISE = 0.002


def _set(on: Stage, world: bpy.types.World, region: Region, even: bool) -> None:
    """Put the world on the stage, and set the samples for a render of the world alone.

    world: a copy, which is changed; even: give every pixel all samples. A sun may be smaller than a
    pixel. With adaptive sampling, a pixel that has missed the sun would then stop early.
    """
    prepare(on, layers=0)
    # The field was rendered by Cycles, whatever engine the artist works with now.
    on.scene.render.engine = "CYCLES"
    on.scene.render.film_transparent = False
    cycles, layer = on.scene.cycles, on.scene.view_layers[0]
    layer.use_pass_z = layer.cycles.denoising_store_passes = False
    on.scene.world = world
    # Nothing is lit here, so Cycles needs no map for importance sampling.
    set_on_world(on.scene.world, on.scene, sampling_method="NONE")
    cycles.samples = BACKGROUND_SAMPLES
    cycles.use_adaptive_sampling = not even
    cycles.adaptive_threshold = BACKGROUND_NOISE
    cycles.adaptive_min_samples = 8
    set_region(on.scene, region)


def _render(on: Stage) -> dict[str, NDArray]:
    with temporary() as folder:
        path = folder / "behind.exr"
        write_to(on.scene.render, path)
        request = Render(on.scene.name, 0, "world")
        blocking_render(request)
        request.check()
        return exr.read(path)


def background(
    scene: bpy.types.Scene,
    region: Region | None = None,
    view_layer: str | None = None,
    even: bool = False,
    world: bpy.types.World | None = None,
) -> NDArray[np.float32]:
    """Render the world as the artist's camera sees it behind all things -> (H, W, 3).

    The render is of a copy of the scene without objects, so lens, motion blur and film are the
    scene's.
    region: the part to render (default: all); the rest is 0.
    even: give every pixel `BACKGROUND_SAMPLES`, for a world with lamps. Else a pixel gets as many
    as it needs: few in an even sky, all on the rim of a sun.
    world: the world to render (default: the view layer's).
    Raises SceneError, CancelledError.
    """
    layer = view_layer or layer_of(scene)
    world = world or check_world(scene, layer)
    width, height = picture_size(scene)
    region = region or Region(0, 0, width, height)
    out = np.zeros((height, width, 3), np.float32)
    with still(scene, layer, world, camera=False) as held, stage(scene, layer) as on:
        on.scene.background_set = None
        _set(on, held, region, even)
        float_exr(on.scene.render, multilayer=False)
        root = on.scene.collection
        for child in list(root.children):
            root.children.unlink(child)
        for thing in list(root.objects):
            root.objects.unlink(thing)
        out[region.slices] = next(iter(_render(on).values()))[..., :3]
    return out


def holds_out(scene: bpy.types.Scene, view_layer: str) -> bool:
    """Whether a holdout may cut a hole into the picture, in which the world is not seen."""
    todo = [scene.view_layers[view_layer].layer_collection]
    while todo:
        collection = todo.pop()
        if collection.holdout:
            return True
        todo += collection.children
    # This looks at the whole file, not at the scene alone: a needless render does no harm.
    return any(o.is_holdout for o in bpy.data.objects) or any(
        node.bl_idname == "ShaderNodeHoldout"
        for material in bpy.data.materials
        for node in reached(material)
    )


def background_with_holes(
    scene: bpy.types.Scene,
    region: Region,
    view_layer: str,
    world: bpy.types.World | None = None,
) -> NDArray[np.float32]:
    """Render the part of the world that is seen between the scene's things -> (H, W, 4).

    For a scene with holdouts. The colour is premultiplied by how much of the world is not covered,
    so that it can be added to a plate. Alpha is the whole picture's: 0 in the holes and outside the
    region.
    world: the world to render (default: the view layer's).
    """
    world = world or check_world(scene, view_layer)
    width, height = picture_size(scene)
    out = np.zeros((height, width, 4), np.float32)
    with still(scene, view_layer, world, camera=False) as held, stage(scene, view_layer) as on:
        group = _set_behind(on, held, region)
        parts = _render(on)
    light = next(pixels for name, pixels in parts.items() if name.endswith(group))
    whole = combined(parts)
    out[region.slices] = np.dstack([light[..., :3], whole[..., 3:]])
    return out


def without_holes(
    scene: bpy.types.Scene,
    region: Region,
    view_layer: str,
    world: bpy.types.World | None = None,
) -> NDArray[np.float32]:
    """Render the alpha of a scene with shadow catchers and its world -> (H, W).

    The catchers are there as ordinary things. Alpha is 0 in holes and outside the region.
    """
    world = world or check_world(scene, view_layer)
    width, height = picture_size(scene)
    out = np.zeros((height, width), np.float32)
    with (
        still(scene, view_layer, world, camera=False) as held,
        stage(scene, view_layer) as on,
        take(rendered(on), WHOLE),
    ):
        _set_behind(on, held, region)
        parts = _render(on)
    whole = combined(parts)
    out[region.slices] = whole[..., 3]
    return out


def _set_behind(on: Stage, world: bpy.types.World, region: Region) -> str:
    """Show the world to the camera alone, in a light group of its own; returns the group's name.

    Only the world's light group is read, so it does not matter what else lights the stage.
    """
    _set(on, world, region, even=True)
    rays = on.scene.world.cycles_visibility
    for prop in rays.bl_rna.properties:
        if prop.type == "BOOLEAN" and not prop.is_readonly and prop.identifier != "camera":
            setattr(rays, prop.identifier, False)
    group = free_mark() + "behind"
    on.scene.world.lightgroup = group
    on.scene.view_layers[0].lightgroups.add(name=group)
    on.scene.cycles.max_bounces = 0
    return group
