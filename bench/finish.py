"""Finish: a plate and so many samples of a render together, beside each of them alone, by material.

A row for each number of samples: the plate, a denoised render of these samples, and what *Finish*
makes of both. Truth is as in `mirrors`: two denoised references of other seeds.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from arto.arto_addon import work
from arto.arto_addon.relight import relight
from arto.arto_addon.relight.finished import finish_plate
from arto.core import exr

from . import scenes
from .accuracy import rerendered
from .machine import write_rows
from .mirror_metrics import by_material
from .mirrors import Shot, truth_of
from .worlds import World

PLATE, RENDER, FINISHED = "plate", "render, denoised", "finished"


def finish_bench(
    out: Path,
    cases: dict[str, tuple[str, ...]],
    size: tuple[int, int],
    captured: int,
    samples: list[int],
    many: int,
) -> list[dict[str, Any]]:
    """The rows; written to `out` after each world.

    captured: samples of the capture; samples: of the renders, ascending; many: of each reference.
    """
    rows: list[dict[str, Any]] = []
    for name, worlds in cases.items():
        for world in worlds:
            one, two = truth_of(name, World(world), size, many)
            shot = Shot(name, size, captured, {})
            truth, seen = (one.rgb + two.rgb) / 2, one.alpha > 0.999
            masks = {"all": seen}
            masks |= {m: seen & (one.index == i) for m, i in scenes.MATERIALS[name].items()}
            nowhere = np.zeros_like(seen)
            scene = shot.scene()
            World(world).apply(scene)
            scene.render.film_transparent = True
            with tempfile.TemporaryDirectory() as folder:
                scene.arto.output = str(Path(folder) / "relit.exr")
                path, _ = work.run(relight.relight(scene))
                plate = exr.read(path)[""][..., :3]
                finished = {}
                for n in samples:
                    scene.arto.finish_samples = n
                    finished[n] = exr.read(work.run(finish_plate(scene)))[""][..., :3]
            for n in samples:  # each opens a scene of its own
                _, clean = rerendered(name, World(world), size, n)
                pictures = {PLATE: plate, RENDER: clean, FINISHED: finished[n]}
                for method, picture in pictures.items():
                    for material, errors in by_material(picture, truth, masks, nowhere).items():
                        row = {"scene": name, "world": world, "samples": n, "method": method}
                        rows.append({**row, "material": material, "error": errors["error"]})
            write_rows(out, rows)
            print(table([r for r in rows if (r["scene"], r["world"]) == (name, world)]), flush=True)
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """A line for each number of samples and method: the error by material."""
    lines = []
    for scene, world, n, method in dict.fromkeys(
        (r["scene"], r["world"], r["samples"], r["method"]) for r in rows
    ):
        of = [r for r in rows if (r["scene"], r["world"], r["samples"]) == (scene, world, n)]
        told = [f"{r['material']} {r['error']:.4f}" for r in of if r["method"] == method]
        lines.append(f"{scene} {world} {n:4d} {method:17s} {'  '.join(told)}")
    return "\n".join(lines)
