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

    many: samples of each of the two reference renders; picture: where else to put the comparison;
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
    plain = reference.render(scene, samples, 0)
    scene.render.film_transparent = False
    capture_seconds = timed(bpy.ops.arto.capture)
    fit_seconds = timed(bpy.ops.arto.fit)
    relight_seconds = timed(bpy.ops.arto.relight)
    scene.arto.denoise, scene.arto.output = False, str((out / "relit_raw.exr").resolve())
    bpy.ops.arto.relight()
    rival = reference.render(scene, samples, 0, denoise=True)
    captured = CaptureSet(paths.capture_folder(scene))
    field = Field(paths.field_folder(scene))

    print(f"rendering the reference, twice {many} samples", flush=True)
    one, two = (
        reference.reference(scene_name, world, size, many, seed, lambda: scene) for seed in (1, 2)
    )
    relit, raw = (exr.read(out / f"{n}.exr")[""][..., :3] for n in ("relit", "relit_raw"))
    truth = (one.rgb + two.rgb) / 2
    seen = one.alpha > 0.999
    error = np.full(seen.shape, np.nan)
    error[seen] = metrics.relative_error(relit, truth, seen).mean(axis=-1)
    behind = relit * (1 - one.alpha[..., None])
    exr.write(out / "reference.exr", {"": np.dstack([truth + behind, np.ones_like(one.alpha)])})
    report = {
        "scene": scene_name,
        "hdri": hdri,
        "mean_relative_error": metrics.mean_relative_error(relit, truth, seen),
        "noise_floor": metrics.mean_relative_error(one.rgb, two.rgb, seen),
        "mean_relative_error_not_denoised": metrics.mean_relative_error(raw, truth, seen),
        "mean_relative_error_of_plain_render": metrics.mean_relative_error(plain.rgb, truth, seen),
        "mean_relative_error_of_plain_render_denoised": metrics.mean_relative_error(
            rival.rgb, truth, seen
        ),
        "error_by_material": {
            name: metrics.mean_relative_error(relit, truth, seen & (one.index == index))
            for name, index in scenes.MATERIALS[scene_name].items()
        },
        "plain_render_seconds": plain.seconds,
        "capture_seconds": capture_seconds,
        "capture_over_plain": capture_seconds / plain.seconds,
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
            f"relative error, mean {report['mean_relative_error']:.3f} "
            f"(noise floor {report['noise_floor']:.3f})",
        ),
    )
    if picture:
        shutil.copyfile(out / "comparison.png", picture)
    (out / "report.json").write_text(json.dumps(report, indent=1))
    return report
