"""Sheets of crops at full size: what the means of `mirrors` do not say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib.image
import numpy as np
from numpy.typing import NDArray

from .pictures import display, exposure_for
from .scenes import MATERIALS

# Materials whose crops are shown: those that an artist looks at first.
SHOWN = (
    *("mirror", "glossy", "glass", "car_paint", "brushed_metal", "chrome", "coat", "liquid"),
    *("pane", "tinted", "red", "floor"),
)
MOST = 150
# Screen pixels of a pixel, so that single ones can be told.
ZOOM = 2
GAP = 6


@dataclass(frozen=True)
class Crop:
    """Pictures of a case by method, `Cycles` among them; index: of materials, (H, W)."""

    title: str
    pictures: dict[str, NDArray]
    index: NDArray
    scene: str


def crops(path: Path, cases: Sequence[Crop], methods: Sequence[str]) -> None:
    """Write a PNG: a row a case and material; Cycles, then the methods, then their errors."""
    rows = []
    for case in cases:
        truth = case.pictures["Cycles"]
        exposure = exposure_for(truth, case.index > 0)
        for name in SHOWN:
            mask = case.index == MATERIALS[case.scene].get(name, -1)
            if mask.sum() < 400:
                continue
            y, x = np.nonzero(mask)
            top, left = (int(np.percentile(at, 1)) for at in (y, x))
            high = min(int(np.percentile(y, 99)) - top, MOST)
            wide = min(int(np.percentile(x, 99)) - left, MOST)
            at = slice(top, top + high), slice(left, left + wide)
            parts = [display(truth[at], exposure)]
            parts += [display(case.pictures[m][at], exposure) for m in methods]
            off = np.abs(case.pictures[methods[0]][at] - truth[at]).mean(axis=-1)
            off /= truth[at].mean(axis=-1) + 0.01 * truth[case.index > 0].mean()
            parts.append(np.repeat(np.clip(off / 0.4, 0, 1)[..., None], 3, axis=-1))
            rows.append(_beside([_zoomed(p) for p in parts]))
    if rows:
        write_png(path, _below(rows))


def _zoomed(picture: NDArray) -> NDArray:
    return picture.repeat(ZOOM, axis=0).repeat(ZOOM, axis=1)


def _beside(parts: list[NDArray]) -> NDArray:
    high = parts[0].shape[0]
    gap = np.ones((high, GAP, 3))
    return np.concatenate([x for p in parts for x in (p, gap)], axis=1)


def _below(rows: list[NDArray]) -> NDArray:
    wide = max(r.shape[1] for r in rows)
    padded = [
        np.pad(r, ((0, GAP), (0, wide - r.shape[1]), (0, 0)), constant_values=1) for r in rows
    ]
    return np.concatenate(padded)


def write_png(path: Path, picture: NDArray) -> None:
    """Write display values (H, W, 3) in [0, 1]."""
    path.parent.mkdir(parents=True, exist_ok=True)
    matplotlib.image.imsave(path, np.clip(picture, 0, 1))


def write_picture(path: Path, picture: NDArray, exposure: float) -> None:
    """Write a scene-linear picture (H, W, 3) for eyes."""
    write_png(path, display(picture, exposure))
