"""Match: a hidden HDRI's look, found again from its picture alone.

The target is a denoised render of 128 samples under the hidden world. The start is another HDRI.
The plate under the light that was found is held against the target, beside the plate under the
hidden world itself.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from arto.arto_addon.match.match import can_render, steps
from arto.arto_addon.work import run
from arto.arto_addon.world.bake import bake
from arto.core.files import whole
from arto.core.light.environment import Environment
from arto.core.match.answers import Answers
from arto.core.match.cells import Cells
from arto.core.match.match import Matched, free_light
from arto.core.match.target import Target
from arto.core.metrics import mean_relative_error
from arto.core.preview import Preview
from numpy.typing import NDArray

from . import reference, worlds
from .accuracy import ARTO, Shot, code_key
from .machine import write_rows
from .pictures import display, exposure_for, plt
from .worlds import World

SCENES = ("four_spheres", "product", "soft", "window")
OUT = Path("out/match")
SAMPLES = 128


@dataclass(frozen=True)
class Found(World):
    """A world that shows a light that was found."""

    light: Environment | None = None

    def apply(self, scene: bpy.types.Scene) -> None:
        assert self.light is not None
        image = worlds._packed(self.name, self.light.image[::-1])
        worlds._set_world(scene, image, 0.0, 1.0)


def light_error(cells: Cells, one: Environment, two: Environment) -> float:
    """The mean difference of two lights' irradiance over all normals, relative to the second's."""
    across = np.maximum(cells.middles @ cells.middles.T, 0) * cells.solid_angles
    found, true = (across @ cells.radiance(light) for light in (one, two))
    return float(np.abs(found - true).mean() / true.mean())


def matched(shot: Shot, target: NDArray, start: Environment) -> tuple[Matched, Answers, float]:
    """Find the light of a picture -> (what was found, the matrix, seconds of both)."""
    begun = time.perf_counter()
    answers = Answers.of(Preview([shot.fields[ARTO]]))
    asked = Target(answers.columns(target), answers.sizes * answers.solid)
    field, scene = shot.fields[ARTO], shot.scene()
    work = free_light(answers, start, asked, answers.layer("own"), lamps=can_render(scene, field))
    found = run(steps(work, scene, field, answers))
    return found, answers, time.perf_counter() - begun


def _true_plate(shot: Shot, world: World) -> NDArray[np.float32]:
    """The plate under the hidden world, kept by content."""
    key = reference.content_key(
        scene=shot.name, world=world.label, size=shot.size, samples=shot.samples, code=code_key()
    )
    path = OUT / f"{shot.name}_{world.label}_{key}.npy"
    if path.is_file():
        return np.load(path)
    found = shot.arto(world)
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole(path) as partial, partial.open("wb") as file:
        np.save(file, found)
    return found


def _sheet(path: Path, cases: list[tuple[list[NDArray], list[str]]]) -> None:
    """A row of pictures for each case; the last two are maps, shown at their own exposure."""
    figure, axes = plt.subplots(
        len(cases), 5, figsize=(15, 2.4 * len(cases)), layout="constrained", squeeze=False
    )
    for row, (pictures, titles) in zip(axes, cases, strict=True):
        shot, sky = exposure_for(pictures[1]), exposure_for(pictures[4])
        for i, (axis, picture, title) in enumerate(zip(row, pictures, titles, strict=True)):
            axis.imshow(display(np.maximum(picture, 0), sky if i > 2 else shot))
            axis.set_title(title, fontsize=9)
            axis.set_axis_off()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=80)
    plt.close(figure)


def match(
    out: Path,
    scene_names: Iterable[str],
    hdris: Iterable[str],
    size: tuple[int, int],
    samples: int,
    sheet: Path | None = None,
) -> list[dict[str, Any]]:
    """A row for each scene and hidden world, written after each. sheet: a picture of them all."""
    cases: list[tuple[list[NDArray], list[str]]] = []
    rows: list[dict[str, Any]] = []
    names = worlds.hdri_names()
    maps: dict[str, Environment] = {}
    hdris = list(hdris)
    for scene_name in scene_names:
        shot = Shot(scene_name, size, samples)
        for name in names:
            if name not in maps:
                scene = shot.scene()
                World(name).apply(scene)
                maps[name] = bake(scene, scene.arto.environment_width)
        for name in hdris:
            world = World(name)
            start = names[(names.index(name) + 1) % len(names)]
            target = reference.reference(
                scene_name, world, size, SAMPLES, 1, shot.scene, denoise=True
            )
            seen = target.alpha > 0.999
            begun = time.process_time()
            found, answers, seconds = matched(shot, target.rgb, maps[start])
            cpu = time.process_time() - begun
            assert found.environment is not None
            plate = shot.arto(Found("found", light=found.environment))
            error = mean_relative_error(plate, target.rgb, seen)
            least = mean_relative_error(_true_plate(shot, world), target.rgb, seen)
            rows.append(
                {
                    "scene": scene_name,
                    "world": name,
                    "start": start,
                    "seconds": seconds,
                    "cpu_seconds": cpu,
                    "error": error,
                    "error_of_the_true_world": least,
                    "light_error": light_error(answers.cells, found.environment, maps[name]),
                    "of_the_proxies": found.error,
                    "start_error": found.before,
                    "missing": found.missing.share,
                    "cells": answers.cells.count,
                }
            )
            write_rows(out, rows)
            if sheet:
                shown = [shot.arto(World(start)), target.rgb, plate]
                shown += [found.environment.image, maps[name].image]
                titles = [f"{scene_name} in {start}", f"target: in {name}", "in the light found"]
                cases.append((shown, [*titles, "the light found", name]))
                _sheet(sheet, cases)
            print({k: round(v, 3) if isinstance(v, float) else v for k, v in rows[-1].items()})
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """Markdown: a row for each, and the medians."""
    lines = [
        "| scene | hidden | start | s | start's error | found | true world | ratio | light |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    ratios = [r["error"] / r["error_of_the_true_world"] for r in rows]
    for r, ratio in zip(rows, ratios, strict=True):
        lines.append(
            f"| {r['scene']} | {r['world']} | {r['start']} | {r['seconds']:.1f} | "
            f"{r['start_error']:.3f} | {r['error']:.3f} | {r['error_of_the_true_world']:.3f} | "
            f"{ratio:.2f} | {r['light_error']:.3f} |"
        )
    lines.append(f"\nMedian of the ratios: {np.median(ratios):.2f}")
    return "\n".join(lines)
