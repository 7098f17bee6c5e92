"""The main job on a real scene: capture, fit, relight, and the error against a reference."""

from __future__ import annotations

import json
import shutil
import time
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from arto.arto_addon.shot import paths
from arto.core import exr, metrics
from arto.core.capture.capture_set import CaptureSet
from arto.core.field.field import Field

from . import pictures, reference, scenes
from .machine import machine
from .worlds import World


def demo(
    out: Path,
    scene_name: str,
    hdri: str,
    size: tuple[int, int],
    samples: int,
    many: int,
    picture: Path | None = None,
    **settings: Any,
) -> dict[str, Any]:
    """Run the main job as an artist's batch run would and leave the results in `out`.

    many: samples of each of the two reference renders, which are denoised; picture: where else to
    put the comparison;
    settings: other values for `scene.arto`. Returns what goes into `report.json`.
    """
    scene = reference.new_scene(scene_name, *size)
    world = World(hdri)
    world.apply(scene)
    out.mkdir(parents=True, exist_ok=True)
    for name, value in {"samples": samples, **settings}.items():
        setattr(scene.arto, name, value)
    scene.arto.output = str((out / "relit.exr").resolve())
    bpy.ops.wm.save_as_mainfile(filepath=str((out / "scene.blend").resolve()))

    def timed(work: Any) -> float:
        begun = time.perf_counter()
        work()
        return time.perf_counter() - begun

    # a first render pays for loading Cycles; nobody should be charged with it
    reference.render(scene, 1, 0)
    rival = reference.render(scene, samples, 0, denoise=True)
    scene.render.film_transparent = False
    capture_seconds = timed(bpy.ops.arto.capture)
    fit_seconds = timed(bpy.ops.arto.fit)
    relight_seconds = timed(bpy.ops.arto.relight)
    captured = CaptureSet(paths.capture_folder(scene))
    field = Field(paths.field_folder(scene))

    print(f"rendering the reference, twice {many} samples", flush=True)
    one, two = (
        reference.reference(scene_name, world, size, many, seed, lambda: scene, denoise=True)
        for seed in (1, 2)
    )
    relit = exr.read(out / "relit.exr")[""][..., :3]
    truth = (one.rgb + two.rgb) / 2
    seen = one.alpha > 0.999
    error = np.full(seen.shape, np.nan)
    error[seen] = metrics.relative_error(relit, truth, seen).mean(axis=-1)
    behind = relit * (1 - one.alpha[..., None])
    exr.write(out / "reference.exr", {"": np.dstack([truth + behind, np.ones_like(one.alpha)])})
    masks = {
        "all": seen,
        **{
            name: seen & (one.index == index)
            for name, index in scenes.MATERIALS[scene_name].items()
        },
    }
    errors = {
        "arto": [metrics.mean_relative_error(relit, truth, m) for m in masks.values()],
        "denoised_render": [
            metrics.mean_relative_error(rival.rgb, truth, m) for m in masks.values()
        ],
        "noise_floor": [metrics.mean_relative_error(one.rgb, two.rgb, m) for m in masks.values()],
    }
    report = {
        "scene": scene_name,
        "hdri": hdri,
        "mean_relative_error": {
            method: dict(zip(masks, found, strict=True)) for method, found in errors.items()
        },
        "denoised_render_seconds": rival.seconds,
        "capture_seconds": capture_seconds,
        "capture_over_render": capture_seconds / rival.seconds,
        "renders": sum(map(len, captured.files)),
        "fit_seconds": fit_seconds,
        "relight_seconds": relight_seconds,
        "patches": len(captured.hemicube),
        "patterns": len(captured.patterns),
        "pixels": captured.pixels,
        "samples": samples,
        "reference_samples": 2 * many,
        "bytes_per_pixel": field.bytes_per_pixel(),
        "models": field.shares(),
        "machine": machine(),
    }
    pictures.comparison(
        out / "comparison.png",
        truth + behind,
        relit,
        error,
        (
            f"Cycles, {2 * many} samples",
            f"ARTO, relit in {relight_seconds:.1f} s",
            f"relative error, mean {errors['arto'][0]:.3f} "
            f"(render of {samples} samples, denoised: {errors['denoised_render'][0]:.3f})",
        ),
    )
    if picture:
        shutil.copyfile(out / "comparison.png", picture)
    (out / "report.json").write_text(json.dumps(report, indent=1))
    print(f"| mean relative error | ARTO | Cycles, {samples} samples, denoised | noise floor |")
    print("|---|---|---|---|")
    for name, *cells in zip(masks, *errors.values(), strict=True):
        print(f"| {name} | " + " | ".join(f"{e:.3f}" for e in cells) + " |")
    return report
