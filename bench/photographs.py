"""What a laboratory's photographs are good for: a simulated capture against Cycles.

The truth is Cycles' render under an HDRI that is black where the capture has no patch. See
`photographs_cases` for what is photographed, and how.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from arto.core import metrics
from arto.core.hemicube import Hemicube
from arto.core.light.light import PatchLight
from arto.core.photographs import simulate
from arto.core.photographs.photographer import Exposing
from arto.core.relight import relight
from numpy.typing import NDArray

from . import reference, scenes
from .machine import write_rows
from .photographs_cases import OUT, Case, HoledWorld, faultless, photographed, rendered

HDRIS = ("courtyard", "interior", "sunset", "studio")


@lru_cache(maxsize=8)
def _light(world: HoledWorld, hemicube: Hemicube) -> PatchLight:
    return PatchLight(world.environment, hemicube)


def case_rows(
    scene_name: str,
    case: Case,
    hdris: Iterable[str],
    size: tuple[int, int],
    samples: int,
    many: int,
    keep: Callable[[str, NDArray, NDArray, NDArray], None] | None = None,
) -> list[dict[str, Any]]:
    """The rows of one case: of each world, all pixels and each material."""
    light, alpha = rendered(scene_name, case, size, samples)
    folder = OUT / f"work_{os.getpid()}"
    fields = {}
    for name in ("faults", "none"):
        shutil.rmtree(folder / name, ignore_errors=True)
    (folder / "faults").mkdir(parents=True)
    fields["faults"], count = photographed(case, light, alpha, folder / "faults")
    (folder / "none").mkdir(parents=True)
    fields["none"] = faultless(case, light, alpha, samples, folder / "none")
    hole = f"{case.sides}_sides" if case.rig == "monitors" else "whole"
    seen_cube = case.hemicube if case.rig == "monitors" else Hemicube()
    rows = []
    for hdri in hdris:
        world = HoledWorld(hdri, hole, seen_cube)
        truth = reference.reference(
            scene_name,
            world,  # type: ignore[arg-type]
            size,
            many,
            1,
            lambda: reference.new_scene(scene_name, *size),
            denoise=True,
        )
        seen = truth.alpha > 0.999
        pictures = {}
        for name, made in fields.items():
            shown = relight(made, _light(world, made.hemicube))[..., :3]
            if case.rig == "dome":
                # nothing of a dome's photographs tells their exposure
                shown = shown * (truth.rgb[seen].sum() / max(shown[seen].sum(), 1e-9))
            pictures[name] = shown
        if keep:
            keep(hdri, truth.rgb, pictures["faults"], pictures["none"])
        masks = {"all": seen}
        masks |= {m: seen & (truth.index == i) for m, i in scenes.MATERIALS[scene_name].items()}
        for material, mask in masks.items():
            found = {
                name: metrics.mean_relative_error(p, truth.rgb, mask)
                for name, p in pictures.items()
            }
            rows.append(
                {
                    "scene": scene_name,
                    "rig": case.rig,
                    "patches": case.patches,
                    "sides": case.sides if case.rig == "monitors" else 0,
                    "patterns": case.patterns if case.rig == "monitors" else "lamps",
                    "bits": case.camera.bits,
                    "jpeg": case.jpeg,
                    "exposures": case.exposing.count,
                    "stops": case.exposing.stops,
                    "noise": case.camera.electrons if np.isfinite(case.camera.electrons) else 0,
                    "clean": case.clean,
                    "distance": case.distance,
                    "photographs": count,
                    "world": hdri,
                    "material": material,
                    "error": found["faults"],
                    "error_without_faults": found["none"],
                }
            )
    return rows


def shown_cases() -> list[Case]:
    """The captures that are looked at: monitors on four and five sides, the paper's, a dome."""
    return [
        Case(),
        Case(sides=5),
        Case(patterns="paper"),
        Case(rig="dome", patches=64),
    ]


def sweep() -> list[Case]:
    """One thing at a time is changed of a capture by monitors on four sides."""
    plain = Case()
    still = simulate.Camera(14, np.inf, 0.0, "linear")
    out = [plain]
    out += [replace(plain, patches=n) for n in (1, 2, 8)]
    out += [replace(plain, patterns=n) for n in ("white", "linear", "packed", "paper")]
    out += [replace(plain, sides=n) for n in (5, 6)]
    out += [replace(plain, exposing=Exposing(n, s)) for n, s in ((1, 0), (2, 4), (5, 2))]
    out += [replace(plain, camera=replace(plain.camera, electrons=n)) for n in (1000, 5000, 80000)]
    out += [replace(plain, jpeg=False)]
    out += [
        replace(plain, jpeg=False, camera=replace(plain.camera, bits=b, curve="linear"))
        for b in (12, 14)
    ]
    out += [replace(plain, jpeg=False, camera=still), replace(plain, clean=False)]
    out += [replace(plain, distance=d) for d in (3.0, 10.0)]
    return out


def photographs(
    path: Path,
    scene_names: Sequence[str],
    hdris: Sequence[str],
    size: tuple[int, int],
    samples: int,
    many: int,
    cases: Sequence[Case],
    sheet: Path | None = None,
) -> list[dict[str, Any]]:
    """All rows, written after each case."""
    rows: list[dict[str, Any]] = []
    shown: list[tuple[str, list[NDArray]]] = []
    for scene_name in scene_names:
        for case in cases:

            def keep(hdri: str, *pictures: NDArray, of: Case = case) -> None:
                if hdri == hdris[0]:
                    name = (
                        f"{of.rig} {of.patterns if of.rig == 'monitors' else ''}, {of.sides} sides"
                    )
                    shown.append((name, list(pictures)))

            rows += case_rows(scene_name, case, hdris, size, samples, many, keep)
            write_rows(path, rows)
            last = [r for r in rows[-len(hdris) * 8 :] if r["material"] == "all"]
            print(
                json.dumps({k: last[-1][k] for k in ("rig", "patches", "sides", "patterns")}),
                flush=True,
            )
    if sheet:
        _sheet(sheet, shown)
    return rows


def _sheet(path: Path, shown: list[tuple[str, list[NDArray]]]) -> None:
    """The truth, the relit photographs and the same without faults, a row for each case."""
    from .pictures import display, exposure_for, plt

    figure, axes = plt.subplots(
        len(shown), 3, figsize=(12, 3.2 * len(shown)), layout="constrained", squeeze=False
    )
    for row, (name, pictures) in zip(axes, shown, strict=True):
        exposure = exposure_for(pictures[0])
        for axis, picture, title in zip(
            row, pictures, ("Cycles", f"photographs: {name}", "without faults"), strict=True
        ):
            axis.imshow(display(picture, exposure), interpolation="nearest")
            axis.set_title(title, fontsize=9)
            axis.set_axis_off()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=80)
    plt.close(figure)


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Markdown: a line for each case, the mean over worlds; mirror, gloss and diffuse apart."""
    materials = ["all", "mirror", "glossy", "diffuse", "glass", "floor"]
    there = [m for m in materials if any(r["material"] == m for r in rows)]
    keys = (
        "rig",
        "patches",
        "sides",
        "patterns",
        "bits",
        "jpeg",
        "exposures",
        "noise",
        "clean",
        "distance",
    )
    lines = [
        "| rig | patches | sides | patterns | files | exposures | electrons | photographs | "
        + " | ".join(there)
        + " |",
        "|---" * (8 + len(there)) + "|",
    ]
    for key in dict.fromkeys(tuple(r[k] for k in keys) for r in rows):
        mine = [r for r in rows if tuple(r[k] for k in keys) == key]
        r = mine[0]
        files = f"{r['bits']} bits" + (", JPEG" if r["jpeg"] else "")
        more = "" if r["clean"] else ", noise left in"
        more += f", at {r['distance']:g} radii" if r["distance"] else ""
        cells = []
        for m in there:
            some = [x for x in mine if x["material"] == m]
            error, none = (np.mean([x[k] for x in some]) for k in ("error", "error_without_faults"))
            cells.append(f"{error:.3f} ({none:.3f})" if some else "")
        sides = r["sides"] or "all"
        lines.append(
            f"| {r['rig']}{more} | {r['patches']} | {sides} | {r['patterns']} | {files} | "
            f"{r['exposures']} | {r['noise'] or 'no noise'} | {r['photographs']} | "
            + " | ".join(cells)
            + " |"
        )
    return "\n".join(lines)
