"""What `bench accuracy` found: tables, the plot of error against seconds, the contact sheet."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from statistics import median
from typing import Any

import matplotlib as mpl
import numpy as np
from arto.core import metrics

from . import pictures, reference
from .accuracy import Shot, rerendered
from .models import MATTE, STAGE
from .seconds import ARTO, NO_LAMPS, RAW, RENDER, RENDER_DENOISED, STAGE_DENOISED, Times
from .worlds import World

mpl.use("Agg")
import matplotlib.pyplot as plt

Rows = list[dict[str, Any]]


def pick(rows: Rows, method: str, samples: int) -> dict[tuple[str, str], dict[str, Any]]:
    """The rows of a method, by scene and world."""
    return {
        (r["scene"], r["hdri"]): r
        for r in rows
        if r["method"] == method and r["samples"] == samples
    }


def _shown(count: int | None) -> str:
    return "never" if count is None else str(count)


def table(rows: Rows, samples: int) -> str:
    """Markdown: every scene and world, then what is asked of the whole."""
    own = pick(rows, ARTO, samples)
    others = {
        "denoised render": pick(rows, RENDER_DENOISED, 128),
        "16x16 whole": pick(rows, STAGE, samples),
        "16x16 whole, denoised": pick(rows, STAGE_DENOISED, samples),
        "no lamps": pick(rows, NO_LAMPS, samples),
        "matte": pick(rows, MATTE, samples),
    }
    lines = [
        "| scene | world | lamps | noise floor | ARTO | over floor | p99 | at edges | "
        + " | ".join(others)
        + " | break-even |",
        "|---" * (9 + len(others)) + "|",
    ]
    for key, r in own.items():
        over = r["mean_relative_error"] - r["noise_floor"]
        edge = "" if r["shadow_edge"] is None else f"{r['shadow_edge']:.3f}"
        cells = [
            *key,
            f"{r['lamp_share']:.0%}" if r["lamp_samples"] else "",
            f"{r['noise_floor']:.3f}",
            f"**{r['mean_relative_error']:.3f}**",
            f"{over:.3f}",
            f"{r['p99']:.2f}",
            edge,
            *(f"{o[key]['mean_relative_error']:.3f}" for o in others.values()),
            _shown(r["break_even"]),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _ratio(rows: Rows, samples: int, other: str, key: str = "relmse_trimmed") -> dict[str, float]:
    """Median over worlds of ARTO's figure over another method's, by scene."""
    own, them = pick(rows, ARTO, samples), pick(rows, other, samples)
    found = defaultdict(list)
    for k, r in own.items():
        found[k[0]].append(max(r[key], 1e-6) / max(them[k][key], 1e-6))
    return {scene: median(v) for scene, v in found.items()}


def _by_lamps(own: Rows, much: float = 0.8) -> list[str]:
    """Break-even where lamps have much of the light, and where not: a line each."""
    lines = []
    for word, here in (
        ("under", [r for r in own if r["lamp_share"] < much]),
        ("at least", [r for r in own if r["lamp_share"] >= much]),
    ):
        counts = [r["break_even"] for r in here]
        paid = [c for c in counts if c is not None]
        if paid:
            lines.append(
                f"  - lamps have {word} {much:.0%} of the light ({len(here)} cases): median "
                f"{median(np.inf if c is None else c for c in counts):g}, {min(paid)} to "
                f"{max(paid)}, never in {len(counts) - len(paid)}"
            )
    return lines


def summary(rows: Rows, samples: int) -> str:
    """Markdown: the figures that decide."""
    own = pick(rows, ARTO, samples)
    over = {k: r["mean_relative_error"] - r["noise_floor"] for k, r in own.items()}
    worst = max(over, key=lambda k: over[k])
    them = pick(rows, RENDER_DENOISED, 128)
    behind = {k: r["mean_relative_error"] - them[k]["mean_relative_error"] for k, r in own.items()}
    last = max(behind, key=lambda k: behind[k])
    counts = [r["break_even"] for r in own.values()]
    paid = sorted(np.inf if c is None else c for c in counts)
    ratio = [r["capture_seconds"] / r["plain_render_seconds"] for r in own.values()]
    lines = [
        f"- over the noise floor: median {median(over.values()):z.3f}, worst {over[worst]:.3f} "
        f"({', '.join(worst)}), of {len(over)} cases",
        f"- over a denoised render of 128 samples: median {median(behind.values()):.3f}, worst "
        f"{behind[last]:.3f} ({', '.join(last)})",
        f"- break-even: median {median(paid):g} relights; never in "
        f"{sum(c is None for c in counts)} of {len(counts)}",
        *_by_lamps(list(own.values())),
        f"- capture of {samples} samples: {min(ratio):.2f} to {max(ratio):.2f} times a plain "
        "render of as many, denoised",
    ]
    for other in (STAGE, STAGE_DENOISED, MATTE):
        by_scene = _ratio(rows, samples, other)
        shown = ", ".join(f"{s} {v:.2f}" for s, v in by_scene.items())
        lines.append(f"- relMSE (trimmed) over that of '{other}', median by scene: {shown}")
    for other in ("whole", STAGE):
        them = pick(rows, other, samples)
        lost = [
            f"{k[0]} {k[1]}"
            for k, r in own.items()
            if r["mean_relative_error"] > them[k]["mean_relative_error"]
        ]
        lines.append(f"- worse than raw '{other}' in {len(lost)} cases: {', '.join(lost) or '-'}")
    lines += [
        "",
        "| method | error | p95 | p99 | relMSE trimmed | FLIP | at edges | bytes a pixel |",
    ]
    lines.append("|---" * 8 + "|")
    for method, n in dict.fromkeys((r["method"], r["samples"]) for r in rows):
        mine = list(pick(rows, method, n).values())
        cells = [
            f"{median(r[k] for r in mine):.3f}"
            for k in ("mean_relative_error", "p95", "p99", "relmse_trimmed", "flip")
        ]
        edges = [r["shadow_edge"] for r in mine if r["shadow_edge"] is not None]
        cells.append(f"{median(edges):.3f}" if edges else "")
        cells.append(f"{median(r['bytes_per_pixel'] for r in mine):.0f}")
        lines.append(f"| {method}, {n} samples | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def by_material(rows: Rows, samples: int) -> str:
    """Markdown: medians over worlds, material by material, of ARTO and a denoised render."""
    lines = ["| scene | material | ARTO | denoised render |", "|---|---|---|---|"]
    own, them = pick(rows, ARTO, samples), pick(rows, RENDER_DENOISED, 128)
    for scene in dict.fromkeys(k[0] for k in own):
        keys = [k for k in own if k[0] == scene]
        for material in own[keys[0]]["by_material"]:
            a, b = (median(d[k]["by_material"][material] for k in keys) for d in (own, them))
            lines.append(f"| {scene} | {material} | {a:.3f} | {b:.3f} |")
    return "\n".join(lines)


def plot(path: Path, rows: Rows) -> None:
    """Error against seconds a picture, log-log, a curve a method: medians over all cases."""
    found: dict[str, dict[int, list[tuple[float, float]]]] = defaultdict(lambda: defaultdict(list))
    for r in rows:
        if r["fit_seconds"] is None or r["relight_seconds"] is None:
            continue
        once = r["capture_seconds"] + r["fit_seconds"]
        unit = r["plain_render_seconds"]
        if r["method"] in (RENDER, RENDER_DENOISED):
            curves = {(r["method"], r["samples"]): r["relight_seconds"]}
        elif r["method"] == ARTO:
            name = f"{ARTO}, 1, 5 and 20 relights"
            curves = {(name, -n): once / n + r["relight_seconds"] for n in (1, 5, 20)}
        elif r["method"] in (STAGE, STAGE_DENOISED, RAW, NO_LAMPS, "whole", "auto"):
            name = f"{r['method']}, 5 relights"
            curves = {(name, 5): once / 5 + r["relight_seconds"]}
        else:
            continue
        for (name, point), seconds in curves.items():
            found[name][point].append((seconds / unit, r["mean_relative_error"]))
    figure, axis = plt.subplots(figsize=(9, 6), layout="constrained")
    for name, points in found.items():
        xy = [np.median(np.array(points[s]), axis=0) for s in sorted(points)]
        x, y = zip(*xy, strict=True)
        style = "--" if name.startswith(RENDER) else "-"
        axis.plot(x, y, style, marker="o", label=name)
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.set_xlabel("seconds a picture, in denoised renders of as many samples as the capture")
    axis.set_ylabel("mean relative error (median over scenes and worlds)")
    axis.grid(True, which="both", alpha=0.3)
    axis.legend(fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=90)
    plt.close(figure)


def sheet(
    path: Path,
    cases: list[tuple[str, World]],
    times: dict[str, dict[str, float]],
    rows: Rows,
    size: tuple[int, int],
    samples: int,
    many: int,
    lamp_samples: int | None = None,
    relights: int = 5,
) -> None:
    """Reference, ARTO and a denoised render of the same total time, with error maps."""
    figure, axes = plt.subplots(
        len(cases), 5, figsize=(17, 2.75 * len(cases)), layout="constrained", squeeze=False
    )
    own = pick(rows, ARTO, samples)
    for line, (scene_name, world) in zip(axes, cases, strict=True):
        shot = Shot(scene_name, size, samples, lamp_samples)
        measured = Times.from_json(times[scene_name])
        row = own[scene_name, world.label]
        once = row["capture_seconds"] + row["fit_seconds"]
        budget = once / relights + row["relight_seconds"]
        affordable = max(1, round((budget - measured.render) / measured.render_a_sample))
        one, two = (
            reference.reference(scene_name, world, size, many, seed, shot.scene) for seed in (1, 2)
        )
        truth, seen = (one.rgb + two.rgb) / 2, one.alpha > 0.999
        relit = np.maximum(shot.arto(world), 0)
        rendered = rerendered(scene_name, world, size, affordable)[1]
        exposure = pictures.exposure_for(truth, seen)
        shown = [
            (truth, f"{scene_name}, {world.label}: {2 * many} samples"),
            (relit, f"ARTO: {budget:.1f} s each of {relights}"),
            (rendered, f"render, {affordable} samples, denoised: as long"),
        ]
        for axis, (picture, title) in zip(line, shown, strict=False):
            axis.imshow(pictures.display(picture, exposure), interpolation="nearest")
            axis.set_title(title, fontsize=8)
        for axis, picture in zip(line[3:], (relit, rendered), strict=True):
            error = np.full(seen.shape, np.nan)
            error[seen] = metrics.relative_error(picture, truth, seen).mean(axis=-1)
            axis.imshow(error, vmin=0, vmax=0.3, cmap="magma", interpolation="nearest")
            axis.set_title(f"relative error, mean {np.nanmean(error):.3f}", fontsize=8)
        for axis in line:
            axis.set_axis_off()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=80)
    plt.close(figure)
