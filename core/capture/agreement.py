"""Whether two pictures of one light agree: by regions, and by more than their noise.

The sum of what all patches bring must be what a white world brings. Where it is not, something
keeps the patches from lighting the scene as a world does, and every picture of the capture is wrong
by as much.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Pixels a side of the regions that are compared.
BLOCK = 6
# A region differs by more than this share of its light, and by so many standard errors; the smaller
# share is for a scene that is known to be lit otherwise by one of the two.
DIFFERENT, SUSPECTED = 0.15, 0.03
SURE = 6.0
# So many regions of a hundred that differ are no accident of one firefly.
SHARE = 0.04
# Of a white world's radiance: less light than this in all the picture is none.
DARK = 2e-3


@dataclass(frozen=True)
class Agreement:
    """ratio: all light of the one over that of the other; worst: the ratio in the regions that
    differ; share: of the regions that do, 0 to 1; dark: whether next to no light gets in at all."""

    ratio: float
    worst: float
    share: float
    dark: bool

    @property
    def agrees(self) -> bool:
        return self.share <= SHARE


def agreement(
    found: NDArray,
    expected: NDArray,
    always: NDArray | float = 0.0,
    different: float = DIFFERENT,
) -> Agreement:
    """Compare `found` with the mean of `expected`, renders of other seeds.

    found: (H, W, 3); expected: (N, H, W, 3), N at least 2; always: (H, W, 3), light that is in
    all of them and none of the matter; different: the share of its light by which a region must be
    off. Non-finite pixels are left out.
    """
    one = (found - always).sum(axis=-1).astype(np.float64)
    many = (expected - always).sum(axis=-1).astype(np.float64)
    good = np.isfinite(one) & np.isfinite(many).all(axis=0)
    one, many = np.where(good, one, 0), np.where(good, many, 0)
    truth = many.mean(axis=0)
    off = one - truth
    height, width = truth.shape
    rows, columns = max(height // BLOCK, 1), max(width // BLOCK, 1)

    def blocks(image: NDArray) -> NDArray:
        """(H, W) -> (regions, pixels of a region)"""
        h, w = min(height, rows * BLOCK), min(width, columns * BLOCK)
        cut = image[:h, :w].reshape(rows, h // rows, columns, w // columns)
        return cut.swapaxes(1, 2).reshape(rows * columns, -1)

    light, apart = blocks(truth), blocks(off)
    n = light.shape[1]
    error = apart.std(axis=1) / np.sqrt(n)
    mean = light.mean(axis=1)
    total = max(float(truth.mean()), 1e-12)
    # what is dark beside the picture may be wrong by much of itself
    floor = np.maximum(mean, 0.1 * total)
    differs = (np.abs(apart.mean(axis=1)) > different * floor) & (
        np.abs(apart.mean(axis=1)) > SURE * error
    )
    there = float(mean[differs].sum())
    worst = float(blocks(one).mean(axis=1)[differs].sum()) / there if there > 0 else 1.0
    dark = float(truth.mean()) < DARK * 3
    return Agreement(float(one.mean()) / total, worst, float(differs.mean()), dark)
