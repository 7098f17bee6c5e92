"""Errors as an artist sees them: by material, in the worst part, in hue, as holes, at borders."""

from __future__ import annotations

import numpy as np
from arto.core import metrics
from numpy.typing import NDArray

# Pixels a side of the blocks of which the worst one counts.
BLOCK = 24
# Of a block so much must be the material.
FILLED = 0.25
# A reference pixel is colourless where no channel is farther than this from its mean, relative.
GREY = 0.12
# A reference pixel is bright from this share of the picture's mean on.
BRIGHT = 0.5
# Fewer pixels of a material than this are not judged.
LEAST = 50


def by_material(
    picture: NDArray, truth: NDArray, masks: dict[str, NDArray], borders: NDArray
) -> dict[str, dict[str, float | None]]:
    """The errors of a picture, by material and over `all`.

    picture, truth: (H, W, 3); masks: (H, W) of each material, and of `all` the pixels that count;
    borders: (H, W), where the patch that gives the most changes within a material.
    """
    seen = masks["all"]
    error = np.zeros(truth.shape[:2])
    error[seen] = metrics.relative_error(picture, truth, seen).mean(axis=-1)
    bright = truth.sum(axis=-1) > BRIGHT * truth[seen].sum(axis=-1).mean()
    found: dict[str, dict[str, float | None]] = {}
    for name, mask in masks.items():
        if mask.sum() < LEAST:
            continue
        lit = mask & bright
        at, away = mask & borders, mask & ~borders
        over = None
        if at.sum() >= LEAST and error[away].mean() > 0:
            over = float(error[at].mean() / error[away].mean())
        found[name] = {
            "error": float(error[mask].mean()),
            "worst": worst_block(error, mask),
            "chroma": chroma(picture, truth, mask),
            "dark": dark(picture, truth, lit),
            "borders": over,
        }
    return found


def worst_block(error: NDArray, mask: NDArray) -> float | None:
    """The mean error of the worst block of a material that fills enough of it."""
    height, width = (n // BLOCK * BLOCK for n in mask.shape)
    shape = (height // BLOCK, BLOCK, width // BLOCK, BLOCK)
    count = mask[:height, :width].reshape(shape).sum(axis=(1, 3))
    total = np.where(mask, error, 0)[:height, :width].reshape(shape).sum(axis=(1, 3))
    full = count >= FILLED * BLOCK**2
    return float((total[full] / count[full]).max()) if full.any() else None


def chroma(picture: NDArray, truth: NDArray, mask: NDArray) -> float | None:
    """How far from grey, relative to its brightness, the picture is where the reference is grey."""
    mean = truth.mean(axis=-1, keepdims=True)
    grey = (np.abs(truth - mean).max(axis=-1) < GREY * mean[..., 0]) & mask
    if grey.sum() < LEAST:
        return None
    x = np.maximum(picture[grey].astype(np.float64), 0)
    hues = [c / np.maximum(c.sum(axis=-1, keepdims=True), 1e-9) for c in (x, truth[grey])]
    return float(np.abs(hues[0] - hues[1]).sum(axis=-1).mean())


def dark(picture: NDArray, truth: NDArray, lit: NDArray) -> float | None:
    """The share of bright pixels that have under half of the reference's light."""
    if lit.sum() < LEAST:
        return None
    return float((picture[lit].sum(axis=-1) < 0.5 * truth[lit].sum(axis=-1)).mean())


def patch_borders(strongest: NDArray, index: NDArray) -> NDArray[np.bool_]:
    """Pixels beside which another patch gives the most, within one object; (H, W) each."""
    found = np.zeros(index.shape, bool)
    for axis in (0, 1):
        n = index.shape[axis]
        first = [slice(None)] * 2
        second = [slice(None)] * 2
        first[axis], second[axis] = slice(0, n - 1), slice(1, n)
        a, b = tuple(first), tuple(second)
        edge = (strongest[a] != strongest[b]) & (index[a] == index[b])
        found[a] |= edge
        found[b] |= edge
    return found
