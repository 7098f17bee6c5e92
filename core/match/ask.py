"""Asking a region: which lights and directions light it, and how it would be even.

Examples
--------
>>> [(p.name, round(p.share, 2)) for p in sorted_shares({"key": 3.0, "fill": 1.0})]
[('key', 0.75), ('fill', 0.25)]
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import TargetError
from .answers import Answers
from .target import Target

# How much of an albedo of 1 a pixel has at least, where light is told from what it falls on.
DARKEST = 0.05


@dataclass(frozen=True)
class Part:
    """A part of a region's light.

    Parameters
    ----------
    name : str
    share : float
        Of the region's light, 0 to 1.
    """

    name: str
    share: float


@dataclass(frozen=True)
class From:
    """A direction that lights a region.

    Parameters
    ----------
    direction : (3,) float64
        The middle of a cell, in the world.
    share : float
        Of the light of all cells, 0 to 1.
    """

    direction: NDArray[np.float64]
    share: float


def sorted_shares(light: Mapping[str, float]) -> list[Part]:
    """Give the shares of lights, the largest first. They sum to 1, or are 0 where there is none.

    Parameters
    ----------
    light : dict of str to float
        How much each gives. A flag gives less than nothing: its share is below 0.

    Returns
    -------
    list of Part
    """
    total = sum(light.values())
    found = [Part(name, value / total if total else 0.0) for name, value in light.items()]
    return sorted(found, key=lambda part: -part.share)


def by_lights(
    pictures: Mapping[str, NDArray[np.float64]], region: NDArray[np.float64]
) -> list[Part]:
    """Find which lights make a region.

    Parameters
    ----------
    pictures : dict of str to (n, 3) float64
        By name, what each light shows by itself.
    region : (n,) float64
        How much each pixel counts.

    Returns
    -------
    list of Part
        See `sorted_shares`.
    """
    _check(region)
    return sorted_shares({n: float((region @ p).sum()) for n, p in pictures.items()})


def by_directions(
    answers: Answers, radiance: NDArray[np.float64], region: NDArray[np.float64]
) -> list[From]:
    """Find from which directions a region is lit.

    Parameters
    ----------
    answers : Answers
    radiance : (M, 3) float64
        The light on the cells.
    region : (n,) float64
        How much each pixel counts.

    Returns
    -------
    list of From
        A direction for each cell that gives light, the brightest first. The shares sum to 1.
    """
    _check(region)
    given = sum((answers.values[c] @ region.astype(np.float32)) * radiance[:, c] for c in range(3))
    # a plane beside a bright spot falls below 0
    given = np.maximum(given, 0)
    total = float(given.sum())
    order = np.argsort(-given)
    if not total:
        return []
    middles = answers.cells.middles
    return [From(middles[j], float(given[j] / total)) for j in order.tolist() if given[j] > 0]


def _check(region: NDArray[np.float64]) -> None:
    if not (region > 0).any():
        raise TargetError("the region is empty: choose a place inside the picture")


def evened(
    shown: NDArray[np.float64],
    albedo: NDArray[np.float64],
    region: NDArray[np.float64],
    keep: NDArray[np.float64],
) -> Target:
    """Make a target in which a region is evenly lit, as bright as it is now in the mean.

    Parameters
    ----------
    shown : (n, 3) float64
        The picture now.
    albedo : (n, 3) float64
        What the light falls on: its pattern stays.
    region, keep : (n,) float64
        How much each pixel counts for being even, and for staying as it is.

    Returns
    -------
    Target

    Raises
    ------
    TargetError
        The region is empty.
    """
    _check(region)
    ground = np.maximum(albedo, DARKEST)
    light = np.average(shown / ground, axis=0, weights=region)
    picture = np.where((region > 0)[:, None], light * ground, shown)
    return Target(picture, np.maximum(region, keep))


def unevenness(
    shown: NDArray[np.float64], albedo: NDArray[np.float64], region: NDArray[np.float64]
) -> float:
    """Compute the deviation of the light on a region, relative to its mean.

    Parameters
    ----------
    shown, albedo : (n, 3) float64
    region : (n,) float64

    Returns
    -------
    float
    """
    _check(region)
    light = (shown / np.maximum(albedo, DARKEST)).mean(axis=-1)
    mean = float(np.average(light, weights=region))
    return float(np.sqrt(np.average((light - mean) ** 2, weights=region))) / max(mean, 1e-12)
