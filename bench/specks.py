"""Specks: pixels of a plate's shadows that stand out from their neighbours, in sixteen worlds.

A pixel of the ratio against the median of those around it, where nothing covers them. Real shadows
have edges, too: so it stands beside the same of Cycles' denoised catcher and of a truth of many
samples, and what is counted is by how much it is more than any of the truth's around it.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from arto.arto_addon import work
from arto.arto_addon.capture import capture
from arto.arto_addon.shot import paths, scene_id
from arto.arto_addon.stage.takes import THINGS
from arto.core.field.field import Field
from numpy.typing import NDArray

from . import reference
from .machine import write_rows
from .plates import ARTO, CYCLES, DENOISED, HDRIS, by_arto, by_cycles, scene_of
from .worlds import World

WORLDS = (*HDRIS, "sky10", "sky70", "softboxes", "checker", "town", "dusk", "point", "slit")
# A pixel's neighbours are those of a square of so many a side.
SIDE = 5
# What is more than the truth by so much can be seen in a plate: half a stop's tenth.
SEEN = 0.1


def neighbours(image: NDArray) -> NDArray:
    """(H, W, ...) -> (SIDE * SIDE, H, W, ...), NaN beyond the edges."""
    reach = SIDE // 2
    around = [(reach, reach), (reach, reach), *[(0, 0)] * (image.ndim - 2)]
    padded = np.pad(image.astype(np.float64), around, constant_values=np.nan)
    height, width = image.shape[:2]
    return np.stack(
        [padded[y : y + height, x : x + width] for y in range(SIDE) for x in range(SIDE)]
    )


def apart(share: NDArray, bare: NDArray) -> NDArray[np.float64]:
    """How far each pixel (H, W) of a ratio (H, W, 3) is from the median of those around it, in the
    channel that is farthest; 0 where something covers it."""
    seen = np.where(bare[..., None], share, np.nan)
    with np.errstate(all="ignore"):
        middle = np.nanmedian(neighbours(seen), axis=0)
    return np.where(bare, np.nan_to_num(np.abs(share - middle)).max(axis=-1), 0.0)


def specks_of(found: NDArray, truth: NDArray, bare: NDArray) -> tuple[float, int]:
    """The largest speck of a ratio beyond what the truth has within reach, and how many of them can
    be seen."""
    allowed = np.nanmax(neighbours(apart(truth, bare)), axis=0)
    over = np.where(bare, apart(found, bare) - allowed, 0)
    return float(max(over.max(), 0)), int((over > SEEN).sum())


def specks(
    out: Path, thing: str, on: str, size: tuple[int, int], samples: int, many: int
) -> list[dict[str, Any]]:
    """A row for each world and method, written after each world."""
    reference.registered()
    scene = scene_of(thing, on, size)
    scene_id.give(scene)
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as temporary:
        folder, settings = Path(temporary), scene.arto
        settings.samples, settings.keep = samples, "never"
        settings.folder, settings.output = str(folder / "arto"), str(folder / "relit.exr")
        work.run(capture.capture(scene, scene.view_layers[0].name))
        things = Field(paths.field_folder(scene).parent / THINGS / "field").layer("alpha")
        bare = things == 0
        for name in WORLDS:
            World(name).apply(scene)
            one, two = (by_cycles(scene, many, seed, things).share for seed in (11, 12))
            truth = (one + two) / 2
            found = {
                ARTO: by_arto(scene).share,
                CYCLES: by_cycles(scene, samples, 3, things).share,
                DENOISED: by_cycles(scene, samples, 3, things, denoise=True).share,
            }
            for method, share in found.items():
                over, seen = specks_of(share, truth, bare)
                about = {"scene": thing, "ground": on, "world": name, "method": method}
                about |= {"largest": float(apart(share, bare).max()), "over": over, "seen": seen}
                about["truth"] = float(apart(truth, bare).max())
                rows.append(about)
            write_rows(out, rows)
            print(f"{thing} on {on} in {name}: {rows[-3]['over']:.3f}", flush=True)
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """Markdown: a line for each world."""
    methods = (ARTO, DENOISED, CYCLES)
    heads = [f"{m} {what}" for m in methods for what in ("largest", "over", "seen")]
    lines = [f"| world | truth | {' | '.join(heads)} |", "|---" * (2 + len(heads)) + "|"]
    for world in dict.fromkeys(r["world"] for r in rows):
        mine = {r["method"]: r for r in rows if r["world"] == world}
        cells = [world, f"{mine[ARTO]['truth']:.3f}"]
        for m in methods:
            cells += [f"{mine[m]['largest']:.3f}", f"{mine[m]['over']:.3f}", str(mine[m]["seen"])]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)
