"""Verify: compare the plate with a few samples of a path-traced render of the scene."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ...core.capture.names import combined
from ...core.errors import SceneError
from ...core.field.field import Field
from ...core.verify import Verdict, marked, verify
from ..shot import paths
from ..shot.shot import layer_of
from ..stage.small import parts_of
from ..stage.stage import stage
from ..work import Progress, Steps
from ..world.own import gains_of
from . import marks, plate
from .marks import PLATE
from .names import relit_file

# Samples of each of the two renders.
SAMPLES = 16


def verify_file(path: Path) -> Path:
    """The path of the verification, beside a plate: where it differs from a render."""
    return path.with_name(f"{path.stem}_verify.exr")


def verify_plate(scene: bpy.types.Scene, view_layer: str | None = None) -> Steps[Path]:
    """Render the scene twice with a few samples, and compare the plate with both renders.

    Returns the path of a picture that marks where the plate is off by more than noise. The header
    of the picture has the result in words. Raises SceneError where there is no plate, where its
    size differs from a render's, or where pixels are not finite; CancelledError.
    """
    layer = view_layer or layer_of(scene)
    if scene.arto.photographs:
        raise SceneError(
            f"the scene '{scene.name}' is of photographs, and cannot be rendered: held_out.txt in "
            "the shot's folder says how well the lamps are predicted"
        )
    path = relit_file(scene)
    if not path.is_file():
        raise SceneError(f"there is no plate {path} to verify: press Relight first")
    out = verify_file(path)
    marks.check(out, path, scene.arto.overwrite)
    there = next(iter(exr.read(path).values()))
    renders: list[NDArray[np.float32]] = []
    for seed in (1, 2):
        with stage(scene, layer) as on:
            on.change("render.engine", "CYCLES")
            on.change("cycles.samples", SAMPLES)
            on.change("cycles.seed", scene.cycles.seed + 7919 * seed)
            on.change("cycles.use_animated_seed", False)
            on.change("cycles.use_layer_samples", "IGNORE")
            on.change("cycles.use_adaptive_sampling", False)
            on.change("cycles.use_denoising", False)
            on.change("cycles.time_limit", 0.0)
            # The plate has all light. A clamped render would leave light out and differ by that.
            on.change("cycles.sample_clamp_direct", 0.0)
            on.change("cycles.sample_clamp_indirect", 0.0)
            on.change("render.use_crop_to_border", False)
            text = f"rendering {SAMPLES} samples to compare with, {seed} of 2"
            parts = yield from parts_of(on, text, (seed - 1) / 2, 0.5)
            renders.append(combined(parts))
    if renders[0].shape[:2] != there.shape[:2]:
        raise SceneError("the plate has another size than a render now: press Relight first")
    for what, picture in (("the plate", there), ("the render", renders[0] + renders[1])):
        if bad := int((~np.isfinite(picture)).any(axis=-1).sum()):
            raise SceneError(
                f"{what} has {bad} pixels that are infinite or not a number, and cannot be compared"
            )
    yield Progress(0.95, "comparing")
    samples = Field(paths.field_folder(scene, layer)).about.samples or SAMPLES
    ratio = 2 * SAMPLES / samples
    found = verify(there[..., :3], renders[0][..., :3], renders[1][..., :3], own=ratio)
    told = {"verify": said(scene, found), "samples": f"2 x {SAMPLES}"}
    told[PLATE.removeprefix("arto.")] = path.name
    # All pixels are written, whatever the plate's windows: only Blender shows this file.
    exr.write(out, {"": marked(there, found)}, *plate.header_of(scene, told))
    yield Progress(1.0, told["verify"])
    return out


def said(scene: bpy.types.Scene, found: Verdict) -> str:
    """Say in a sentence or two what was found, in words that do not gainsay each other."""
    text = found.line
    settings = scene.arto
    if settings.own_lamps != 1 or any(gain != 1 for gain in gains_of(scene).values()):
        text += ". The plate has the scene's lamps at other gains than a render"
    return text
