"""Agreement: whether two pictures of one light differ by more than their noise, region by region.

The light of all patches together must equal the light of a white world. If it does not, something
keeps the patches from lighting the scene as a world does, and every basis image is wrong by as
much.

Examples
--------
>>> noise = np.random.default_rng(0).normal(0, 0.02, (3, 60, 60, 3))
>>> renders = 1 + noise
>>> agreement(renders[0], renders[1:]).agrees
True
>>> agreement(0.7 * renders[0], renders[1:]).agrees
False
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..values import Values

# Pixels a side of the regions that are compared.
BLOCK = 6
# A region differs if it is off by more than this share of its light and by so many standard errors.
# The smaller share is for a scene that is known to be lit differently in one of the two pictures.
DIFFERENT, SUSPECTED = 0.15, 0.03
SURE = 6.0
# A single firefly never makes a larger share of regions differ.
SHARE = 0.04
# A picture with less light than this share of a white world's radiance counts as dark.
DARK = 2e-3
# Of two lights, one of which is next to none.
MOST_RATIO = 1e30


@dataclass(frozen=True)
class Agreement:
    """How two pictures of one light compare.

    Parameters
    ----------
    ratio : float
        All light of the first over all light of the second.
    worst : float
        The same ratio in the regions that differ.
    share : float
        The share of regions that differ, 0 to 1.
    dark : bool
        Whether next to no light reaches the picture.
    """

    ratio: float
    worst: float
    share: float
    dark: bool

    @property
    def agrees(self) -> bool:
        """Whether so few regions differ that noise explains them."""
        return self.share <= SHARE


@dataclass(frozen=True)
class Caution:
    """What the check of the light found before the capture, see `Agreement`.

    Parameters
    ----------
    text : what is wrong and why it may be, for an artist.
    ratio : all light of the patches over that of a white world.
    worst : that ratio in the regions that differ.
    share : of the regions that differ, 0 to 1.
    dark : whether next to no light gets in at all.
    """

    text: str
    ratio: float
    worst: float
    share: float
    dark: bool

    @staticmethod
    def read(said: Values) -> Caution:
        """Read a part of a head.

        Parameters
        ----------
        said : Values

        Returns
        -------
        Caution

        Raises
        ------
        CaptureSetError
            A value is missing, or cannot be right.
        """
        text, dark = said.some_text("text"), said.kind("dark", bool)
        ratio = said.real("ratio", -MOST_RATIO, MOST_RATIO)
        worst = said.real("worst", -MOST_RATIO, MOST_RATIO)
        share = said.real("share", 0.0, 1.0)
        if text is None or ratio is None or worst is None or share is None or dark is None:
            raise said.wrong("text, ratio, worst, share, dark", said.data)
        return Caution(text, ratio, worst, share, dark)

    def to_json(self) -> dict[str, Any]:
        """Give what `read` reads.

        Returns
        -------
        dict
        """
        return dict(vars(self))


def agreement(
    found: NDArray,
    expected: NDArray,
    always: NDArray | float = 0.0,
    different: float = DIFFERENT,
    white: float = 1.0,
) -> Agreement:
    """Compare a picture with the mean of several renders.

    Pixels that are not finite are left out.

    Parameters
    ----------
    found : (H, W, 3) float
        Scene-linear.
    expected : (N, H, W, 3) float
        N renders of other seeds, at least 2.
    always : (H, W, 3) float
        Light that all of them have and that is not compared.
    different : float
        The relative difference from which on a region differs.
    white : float
        What a picture shows of a radiance of 1: the exposure of the film.

    Returns
    -------
    Agreement
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
    total = max(float(truth.mean()), 1e-12 * white)
    # regions much darker than the picture may be off by a large share of their light
    floor = np.maximum(mean, 0.1 * total)
    differs = (np.abs(apart.mean(axis=1)) > different * floor) & (
        np.abs(apart.mean(axis=1)) > SURE * error
    )
    there = float(mean[differs].sum())
    worst = float(blocks(one).mean(axis=1)[differs].sum()) / there if there > 0 else 1.0
    dark = float(truth.mean()) < DARK * 3 * white
    return Agreement(float(one.mean()) / total, worst, float(differs.mean()), dark)
