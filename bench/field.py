"""Scenes and worlds as artists bring them: each relit, beside Cycles' noise and a denoised render.

A case is a way to change a small scene, or its world, into something that real files have. The
truth is Cycles' own picture of the very scene.
"""

from __future__ import annotations

import re
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from arto.arto_addon import work
from arto.arto_addon.blender.output import float_exr, write_to
from arto.arto_addon.capture import capture
from arto.arto_addon.fit import fit
from arto.arto_addon.relight import relight
from arto.core import exr, metrics
from arto.core.capture.capture_set import CaptureSet
from arto.core.capture.head import CaptureHead
from arto.core.errors import ArtoError

from . import reference, worlds
from .field_worlds import CASES

SIZE = (64, 48)
SAMPLES, MANY = 128, 384
# Times as many samples of a capture whose mean is looked at again.
FINE = 16
# Over a denoised render of the same samples, and of the ratio of the means.
BEHIND, BIAS = 0.02, 0.01


def _cycles(
    scene: bpy.types.Scene, samples: int, seed: int, folder: Path, denoise: bool = False
) -> np.ndarray:
    """What F12 renders of the scene -> (H, W, 4), without clamps."""
    copy = scene.copy()
    try:
        cycles = copy.cycles
        cycles.samples, cycles.seed, cycles.use_denoising = samples, seed, denoise
        cycles.use_adaptive_sampling = False
        cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
        copy.frame_set(scene.frame_current)
        float_exr(copy.render, multilayer=False)
        copy.render.use_compositing = False
        write_to(copy.render, folder / "cycles.exr")
        request = work.Render(copy.name, 0, "")
        work.blocking_render(request)
        request.check()
        return next(iter(exr.read(folder / "cycles.exr").values()))
    finally:
        bpy.data.scenes.remove(copy)


def _relit(scene: bpy.types.Scene, folder: Path) -> tuple[np.ndarray, CaptureHead]:
    """Capture, fit, relight -> the plate (H, W, 3), and what the capture set says. Raises
    ArtoError."""
    scene.arto.folder, scene.arto.output = str(folder / "arto"), str(folder / "relit.exr")
    layer = scene.view_layers[0].name
    there = work.run(capture.capture(scene, layer))
    work.run(fit.fit(scene, layer))
    path, _ = work.run(relight.relight(scene, layer))
    return next(iter(exr.read(path).values()))[..., :3], CaptureSet(there).head


def _told(error: ArtoError) -> str:
    """The first line of an error, without folders that are another's with every run."""
    return re.sub(r"/\S+/", "", str(error).splitlines()[0])


def one(name: str, hdri: str = "sunset") -> dict[str, Any]:
    """A case, relit and measured."""
    base, change = CASES[name]
    scene = reference.new_scene(base, *SIZE)
    worlds.set_world_hdri(scene, hdri)
    change(scene)
    bpy.context.view_layer.update()
    scene.arto.samples = SAMPLES
    row: dict[str, Any] = {"case": name, "status": "right", "text": ""}
    begun = time.perf_counter()
    # of names that artists give: an umlaut, a percent sign, what Blender's own paths give a meaning
    with tempfile.TemporaryDirectory(prefix="Größe 50%02d {x} #") as temporary:
        folder = Path(temporary)
        try:
            relit, head = _relit(scene, folder)
        except ArtoError as e:
            return row | {"status": "refused", "text": _told(e)}
        one, two = (_cycles(scene, MANY, seed, folder)[..., :3] for seed in (1, 2))
        rival = _cycles(scene, SAMPLES, 3, folder, denoise=True)[..., :3]
        truth = (one + two) / 2
        row["error"] = metrics.mean_relative_error(relit, truth)
        row["noise_floor"] = metrics.mean_relative_error(one, two)
        row["denoised_render"] = metrics.mean_relative_error(rival, truth)
        row["bias"] = float(relit.mean() / max(truth.mean(), 1e-9) - 1)
        # what two renders of Cycles' own differ by says nothing
        row["bias_of_noise"] = 2 * abs(float(one.mean() / max(two.mean(), 1e-9)) - 1)
        if max(relit.mean(), truth.mean()) < 1e-5:  # nothing gets in, and nothing is seen
            for figure in ("error", "noise_floor", "denoised_render", "bias", "bias_of_noise"):
                row[figure] = 0.0
        most = max(row["denoised_render"], row["noise_floor"]) + BEHIND
        biased, left = abs(row["bias"]) > BIAS + row["bias_of_noise"], row["error"]
        if biased or left > most:
            # a few samples have not found all the light yet, and a denoiser takes what stands out
            scene.arto.samples, scene.arto.denoise = FINE * SAMPLES, False
            relit, _ = _relit(scene, folder)
            row["bias"] = float(relit.mean() / truth.mean() - 1)
            row["text"] = f"bias: of {FINE * SAMPLES} samples, not denoised"
            if left > most:
                left = metrics.mean_relative_error(relit, truth)
                row |= {"status": "noise", "text": f"error {left:.3f}, {row['text']}"}
    if left > most or abs(row["bias"]) >= BIAS + row["bias_of_noise"]:
        row["status"] = "wrong"
    if head.caution:
        row |= {"status": f"{row['status']}, said", "text": head.caution.text}
    row["seconds"] = time.perf_counter() - begun
    return row


def field(out: Path | None, wanted: list[str] | None = None) -> Iterator[dict[str, Any]]:
    """Rows of all cases, or of those whose names begin with one of `wanted`, as they come."""
    from .machine import write_rows

    rows = []
    for name in CASES:
        if wanted and not name.startswith(tuple(wanted)):
            continue
        try:
            rows.append(one(name))
        except Exception as e:  # a traceback is what this is there to find
            rows.append({"case": name, "status": "wrong", "text": f"{type(e).__name__}: {e}"[:200]})
        if out:
            write_rows(out, rows)
        yield rows[-1]


def table(rows: list[dict[str, Any]]) -> str:
    """The rows in Markdown."""
    lines = [
        "| case | error | noise floor | denoised render | bias | |",
        "|---|---|---|---|---|---|",
    ]
    for r in rows:
        figures = [
            f"{r[n]:.3f}" if n in r else "" for n in ("error", "noise_floor", "denoised_render")
        ]
        bias = f"{r['bias']:+.1%}" if "bias" in r else ""
        said = r["status"] + (f": {r['text']}" if r["text"] else "")
        lines.append(f"| {r['case']} | {' | '.join(figures)} | {bias} | {said} |")
    return "\n".join(lines)


def page(rows: list[dict[str, Any]]) -> str:
    """docs/scenes.md."""
    return "\n".join(
        [
            "# Scenes and worlds as artists bring them",
            "",
            f"Each case is one change of a small scene ({SIZE[0]}x{SIZE[1]}) or of its world. It",
            f"is captured with {SAMPLES} samples, fitted, relit and held against Cycles' own",
            f"picture of that very scene: the mean of two seeds of {MANY} samples, whose distance",
            f"is the noise floor. Beside it, Cycles' denoised render of {SAMPLES} samples. Errors",
            "are mean relative errors, bias is the ratio of the means less one. Right is what is",
            f"within {BEHIND} of the denoised render with a bias of at most {BIAS:.0%}, beside",
            "twice what the two seeds differ by; where error or bias is larger it is looked at",
            f"again with {FINE} times as many samples and no denoiser, which tells noise from a",
            "fault. An error that this takes away is noise, and the row says what is left. Paths",
            "have an umlaut, a percent sign, braces and a hash in them. (`python -m bench field",
            "--json FILE --page docs/scenes.md`.)",
            "",
            table(rows),
            "",
        ]
    )
