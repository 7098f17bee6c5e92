"""What is switched off on the stage: whatever bends the light, or takes a picture apart."""

from __future__ import annotations

import bpy

from .stage import Stage


def prepare(on: Stage, layers: int) -> None:
    """Switch off on the stage whatever would bend the light or take it apart."""
    s = on.scene.arto
    through = on.scene.cycles.transparent_max_bounces + layers
    for path, value in {
        "cycles.samples": s.samples,
        "cycles.seed": s.seed,
        "cycles.use_animated_seed": False,
        "cycles.use_layer_samples": "IGNORE",
        "cycles.use_sample_subset": False,
        "cycles.time_limit": 0.0,
        "cycles.use_adaptive_sampling": False,
        "cycles.use_denoising": False,
        "cycles.sample_clamp_direct": 0.0,
        "cycles.sample_clamp_indirect": 0.0,
        "cycles.use_fast_gi": False,
        "cycles.transparent_max_bounces": through,
        # a path that a coin ends between two layers is noise in the farther ones alone
        "cycles.min_transparent_bounces": through,
        "render.film_transparent": True,
        # glass that lets the film through would let the patches through as well
        "cycles.film_transparent_glass": False,
        "render.use_persistent_data": False,
    }.items():
        on.change(path, value)
    layer = on.scene.view_layers[0]
    layer.cycles.denoising_store_passes = True
    layer.use_pass_z = True
    world = on.made(bpy.data.worlds.new("ARTO Black"))
    world.node_tree.nodes.clear()
    on.changed["world"] = [on.scene.world.name if on.scene.world else None, None]
    on.scene.world = world
