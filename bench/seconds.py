"""What each method costs: seconds of capture, fit and relight, measured once a scene.

Errors are taken of small pictures, seconds of larger ones, where what a render costs once (building
the scene, the map of a world) no longer hides what a sample costs.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from arto.arto_addon import work
from arto.arto_addon.capture import capture
from arto.arto_addon.fit import fit
from arto.arto_addon.relight import relight
from arto.arto_addon.world.bake import bake
from arto.core.fit.choice import SEARCH
from arto.core.light import lamps

from . import reference
from .models import MATTE, STAGE
from .worlds import World

ARTO, RAW, NO_LAMPS = "arto", "arto, not denoised", "arto, no lamps"
RENDER, RENDER_DENOISED = "render", "render denoised"
STAGE_DENOISED = f"{STAGE} denoised"
FEW, MANY = 4, 36


@dataclass(frozen=True)
class Work:
    """Seconds of one way to capture: the capture, the fit, a relight as it is and denoised."""

    capture: float
    fit: float
    relight: float
    denoised: float


@dataclass(frozen=True)
class Times:
    """Seconds of one scene. own: ARTO as it comes, without lamps of their own; grid: 4x4 patches
    under the patterns that every support model can be fitted from; stage: 16x16 whole patches.
    `a_sample` is what one more sample costs; renders are denoised, which costs `denoise`.
    """

    own: Work
    grid: Work
    stage: Work
    lamps: float
    lamps_a_sample: float
    render: float
    render_a_sample: float
    denoise: float

    @staticmethod
    def from_json(found: dict[str, Any]) -> Times:
        works = {name: Work(**found[name]) for name in ("own", "grid", "stage")}
        return Times(**{**found, **works})

    def render_of(self, samples: float) -> float:
        """A render of so many samples, denoised."""
        return self.render + self.render_a_sample * samples

    def cost(self, method: str, samples: int, lamp_samples: int) -> dict[str, float | None]:
        """Seconds of capture, fit and relight of a method (None: not measured).

        samples: of a render; lamp_samples: of the lamps of a relight, 0 for none.
        """
        if method in (RENDER, RENDER_DENOISED):
            raw = method == RENDER
            seconds = self.render_of(samples) - (self.denoise if raw else 0.0)
            return {"capture_seconds": 0.0, "fit_seconds": 0.0, "relight_seconds": seconds}
        by_method = {ARTO: self.own, RAW: self.own, NO_LAMPS: self.own}
        by_method |= {STAGE: self.stage, STAGE_DENOISED: self.stage}
        taken = by_method.get(method, self.grid)
        clean = method in (ARTO, NO_LAMPS, STAGE_DENOISED)
        relit = taken.denoised if clean else taken.relight
        if lamp_samples:
            relit += self.lamps + self.lamps_a_sample * lamp_samples
        # closed forms take as long as `auto`; Algorithm 1 takes minutes, matting has no field
        fitted = None if method in (SEARCH, MATTE) else taken.fit
        return {
            "capture_seconds": taken.capture,
            "fit_seconds": fitted,
            "relight_seconds": None if method == MATTE else relit,
        }


def seconds_of(work_to_do: Callable[[], Any]) -> float:
    begun = time.perf_counter()
    work_to_do()
    return time.perf_counter() - begun


def times(scene_name: str, size: tuple[int, int], samples: int) -> Times:
    """Measure one scene: ARTO, the baselines' captures, renders of few and of many samples."""
    scene = reference.new_scene(scene_name, *size)
    World("city").apply(scene)
    reference.render(scene, 1, 0)  # the first pays for loading Cycles
    raw = reference.render(scene, FEW, 0).seconds
    few, many = (reference.render(scene, s, 0, denoise=True).seconds for s in (FEW, MANY))
    each = (many - few) / (MANY - FEW)
    settings = scene.arto
    settings.samples = samples
    with tempfile.TemporaryDirectory() as folder:
        settings.output = str(Path(folder) / "relit.exr")

        def measured(name: str, **options: Any) -> Work:
            for option, value in {"folder": str(Path(folder) / name), **options}.items():
                setattr(settings, option, value)
            layer = scene.view_layers[0].name
            captured = seconds_of(lambda: work.run(capture.capture(scene, layer)))
            fitted = seconds_of(lambda: work.run(fit.fit(scene)))
            settings.lamps = False
            work.run(relight.relight(scene))  # the first pays for the map's place on the patches
            settings.denoise = False
            raw = seconds_of(lambda: work.run(relight.relight(scene)))
            settings.denoise = True
            return Work(captured, fitted, raw, seconds_of(lambda: work.run(relight.relight(scene))))

        own = measured("own")
        share = lamps.split(bake(scene, settings.environment_width)).share
        settings.lamps = True
        lit = []
        for n in (FEW, MANY):
            settings.lamp_samples = math.ceil(n / share)
            lit.append(seconds_of(lambda: work.run(relight.relight(scene))))
        light_sample = max((lit[1] - lit[0]) / (MANY - FEW), 0.0)
        grid = measured("grid", patterns="moments_uv", grain=True, adaptive=False)
        stage = measured("stage", patterns="white", grain=False, patches=16, support="whole")
    return Times(
        own=own,
        grid=grid,
        stage=stage,
        lamps=max(lit[0] - own.denoised - FEW * light_sample, 0.0),
        lamps_a_sample=light_sample,
        render=max(few - FEW * each, 0.0),
        render_a_sample=each,
        denoise=max(few - raw, 0.0),
    )


def break_even(
    times: Times, once: float, error: float, relight: float, rival: dict[int, float]
) -> int | None:
    """Relights after which capture and relights cost less than renders of the same error.

    once: seconds of capture and fit; rival: error of the denoised render by samples. Between them
    it is a power of the samples; below the last, as many samples as that. None: never, a relight
    costs more than such a render.
    """
    better: dict[float, int] = {}  # error -> the fewest samples that have it
    for n in sorted(rival):
        if not better or rival[n] < min(better):
            better[rival[n]] = n
    errors = sorted(better)
    need = float(max(rival))
    if error >= errors[0]:
        at = np.interp(math.log(error), np.log(errors), np.log([better[e] for e in errors]))
        need = math.exp(at)
    saved = times.render_of(need) - relight
    return math.ceil(once / saved) if saved > 0 else None


def price(rows: list[dict[str, Any]], by_scene: dict[str, Times], samples: int) -> None:
    """Put seconds and break-even into the rows of errors; samples: those of the captures."""
    rivals: dict[tuple[str, str], dict[int, float]] = {}
    for r in rows:
        if r["method"] == RENDER_DENOISED:
            case = rivals.setdefault((r["scene"], r["hdri"]), {})
            case[r["samples"]] = r["mean_relative_error"]
    for r in rows:
        measured = by_scene[r["scene"]]
        cost = measured.cost(r["method"], r["samples"], r["lamp_samples"])
        r |= cost
        r["plain_render_seconds"] = measured.render_of(samples)
        if r["method"] in (ARTO, RAW, NO_LAMPS):
            captured, fitted = cost["capture_seconds"], cost["fit_seconds"]
            relit = cost["relight_seconds"]
            # all of these methods are measured
            assert captured is not None and fitted is not None and relit is not None
            rival = rivals[r["scene"], r["hdri"]]
            r["break_even"] = break_even(
                measured, captured + fitted, r["mean_relative_error"], relit, rival
            )
