"""The world as the camera sees it behind everything."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.region import Region
from ..stage.stage import picture_size, set_region
from .check import check_world
from .studio import render as render_studio
from .studio import studio_scene

# Of the world that is seen behind everything, and the noise at which a pixel has enough.
BACKGROUND_SAMPLES = 64
BACKGROUND_NOISE = 0.002


def background(
    scene: bpy.types.Scene, region: Region | None = None, view_layer: str | None = None
) -> NDArray[np.float32]:
    """The world as the artist's camera sees it behind everything -> (H, W, 3).

    region: all that is looked at, 0 outside (default: everything). Pixels get as many samples as
    they need, up to `BACKGROUND_SAMPLES`: next to none in an even sky, all on the rim of a sun.
    """
    world = check_world(scene, view_layer)
    with studio_scene(scene, world, "ARTO Background") as (studio, _):
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
        out[region.slices] = render_studio(studio)[..., :3]
        return out
