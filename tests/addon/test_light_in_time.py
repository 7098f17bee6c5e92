"""A light that is keyed over one capture: plates as smooth as its keys."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender import denoise
from arto.arto_addon.kit import kit as kits
from arto.arto_addon.live.line import other_shot
from arto.arto_addon.relight.many import relight_many
from arto.arto_addon.world import controls
from arto.core import exr
from arto.core.kit.light import Light
from arto.core.kit.model import Base, BaseKind, Kit
from scene_tools import hdri, smooth

FRAMES = range(1, 6)


def plates(scene: bpy.types.Scene) -> np.ndarray:
    """The plates of all frames, (F, H, W, 3)."""
    before = scene.arto.output
    scene.arto.output = before.replace(".exr", "_####.exr")
    try:
        done = work.run(relight_many(scene, scene.view_layers[0].name, frames=FRAMES))
    finally:
        scene.arto.output = before
    return np.stack([next(iter(exr.read(path).values()))[..., :3] for path in done])


def linear(owner: bpy.types.bpy_struct, path: str, values: tuple[float, float], index: int = -1):
    """Key a value at the first and the last frame, with a straight line between."""
    for frame, value in zip((FRAMES[0], FRAMES[-1]), values, strict=True):
        if index < 0:
            setattr(owner, path, value)
        else:
            getattr(owner, path)[index] = value
        owner.keyframe_insert(path, index=index, frame=frame)
    action = owner.id_data.animation_data.action
    layers = [s for layer in action.layers for s in layer.strips]
    for curve in (c for s in layers for bag in s.channelbags for c in bag.fcurves):
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"


@pytest.fixture
def moving(shot):
    scene = shot
    scene.world = bpy.data.worlds.new("Moving")
    controls.set_strength(scene.world, 1.0)
    scene.render.film_transparent = True
    yield scene
    scene.arto.denoise = False
    scene.frame_set(1)


@pytest.mark.newest
@pytest.mark.parametrize("denoised", [False, True])
def test_a_keyed_strength_is_the_light_times_it(moving, denoised) -> None:
    if denoised and not denoise.available():
        pytest.skip("this Blender has no Open Image Denoise")
    moving.arto.denoise = denoised
    hdri(moving, smooth(16))
    background = moving.world.node_tree.nodes["Background"]
    linear(background.inputs["Strength"], "default_value", (1.0, 3.0))
    found = plates(moving)
    strengths = np.linspace(1, 3, len(found))
    first = found[0]
    for picture, strength in zip(found, strengths, strict=True):
        off = np.abs(picture / strength - first).mean() / first.mean()
        assert off < (0.002 if denoised else 1e-4)


@pytest.mark.newest
def test_a_keyed_turn_has_no_flicker_of_its_own(moving) -> None:
    """What neighbours differ by changes slowly: the second difference is small beside the first."""
    hdri(moving, smooth(32))
    mapping = next(n for n in moving.world.node_tree.nodes if n.bl_idname == "ShaderNodeMapping")
    linear(mapping.inputs["Rotation"], "default_value", (0.0, 0.4), 2)
    found = plates(moving)
    first, second = np.abs(np.diff(found, axis=0)).mean(), np.abs(np.diff(found, 2, axis=0)).mean()
    assert first > 0.001 * found.mean()
    assert second < 0.25 * first


@pytest.mark.newest
def test_a_keyed_light_of_the_kit_adds_as_its_key_says(moving) -> None:
    kits.write(
        moving.world,
        Kit(
            (Light("Key", azimuth=-90, elevation=40, width=60, height=60),),
            Base(BaseKind.GRADIENT, top=(0.3,) * 3, horizon=(0.2,) * 3, bottom=(0.1,) * 3),
        ),
    )
    strength = kits.node_of(moving.world, "Key").inputs["Strength"]
    linear(strength, "default_value", (0.0, 2.0))
    found = plates(moving)
    steps = np.diff(found, axis=0)
    assert steps.mean() > 0.01 * found[0].mean()
    # where a plane falls below 0 the plate is cut
    assert np.isclose(steps, steps[:1], atol=2e-4).mean() > 0.99


@pytest.mark.newest
def test_live_says_whose_light_it_shows_while_the_timeline_plays() -> None:
    was = 3, 0.0, "Camera", 24, 18
    said = other_shot(was, (7, 0.5, *was[2:]))
    assert said == "The light of frame 7, on the shot of frame 3"
    assert "another one" in other_shot(was, (3, 0.0, "Other", 24, 18))
