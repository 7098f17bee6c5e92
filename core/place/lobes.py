"""The lobes of a pixel: from which directions light comes to it, and how much.

An entry of the field is taken for a lobe: a direction, a spread and a weight. The density of a
pixel's lobes in a direction is how bright a small light there makes the pixel. A narrow reflection
has a high density however weak it is, so the place of a reflection is the peak of the density.

Examples
--------
>>> coat = Lobes(np.array([[0.0, 0, 1], [1, 0, 0]]), np.array([0.02, 0.5]), np.array([0.04, 0.5]))
>>> at, spread = coat.peak(SMALL)
>>> at.round(3).tolist(), round(spread, 3)
([0.0, 0.0, 1.0], 0.02)
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..field.field import Field
from ..inside import entries_at

# The spread in radians by which narrow lobes are smoothed: about that of a small light.
SMALL = math.radians(1.5)
# Times the typical weight of a lobe that a reflection has.
_OUTSTANDING = 2.5


@dataclass(frozen=True)
class Lobes:
    """The lobes of a pixel.

    Parameters
    ----------
    direction : (n, 3) float64
        Unit vectors in the world, towards the light.
    spread : (n,) float64
        The standard deviation of the angle along an axis, in radians.
    weight : (n,) float64
        The mean of R over the channels.
    """

    direction: NDArray[np.float64]
    spread: NDArray[np.float64]
    weight: NDArray[np.float64]

    def density(self, at: NDArray, smooth: float) -> NDArray[np.float64]:
        """Compute how bright a light of some size makes the pixel, per solid angle.

        Parameters
        ----------
        at : (m, 3) float
            Unit vectors.
        smooth : float
            The spread of the light, in radians.

        Returns
        -------
        (m,) float64
        """
        variance = self.spread**2 + smooth**2
        square = 2 * np.maximum(1 - at @ self.direction.T, 0)
        return np.exp(-square / (2 * variance)) @ (self.weight / (2 * np.pi * variance))

    def only(self, these: NDArray[np.bool_]) -> Lobes:
        """Take some of the lobes.

        Parameters
        ----------
        these : (n,) bool

        Returns
        -------
        Lobes
        """
        return Lobes(self.direction[these], self.spread[these], self.weight[these])

    def peak(self, smooth: float) -> tuple[NDArray[np.float64], float]:
        """Find the direction with the highest density, and the spread of the lobes around it.

        Parameters
        ----------
        smooth : float
            The spread of the light, in radians.

        Returns
        -------
        direction : (3,) float64
        spread : float
            In radians.
        """
        best = int(self.density(self.direction, smooth).argmax())
        at = self.direction[best]
        spread = float(self.spread[best])
        for _ in range(12):
            # A lobe that reaches over the rim of its patch goes on in the next one.
            width = max(smooth, spread)
            variance = self.spread**2 + width**2
            square = 2 * np.maximum(1 - self.direction @ at, 0)
            share = self.weight / variance * np.exp(-square / (2 * variance))
            # The narrower, the more a lobe says of the place.
            share = share * (variance.min() / variance)
            moved = unit(share @ self.direction)
            square = 2 * np.maximum(1 - self.direction @ moved, 0)
            spread = math.sqrt(float(share @ (self.spread**2 + square / 2) / share.sum()))
            done = float(moved @ at) > 1 - 1e-10
            at = moved
            if done:
                break
        return at, spread

    def stands_out(self, at: NDArray, spread: float) -> bool:
        """Tell whether more light comes from around a direction than to a matt place from any.

        With few samples, a matt pixel has met a patch once or twice: a narrow lobe in each patch.

        Parameters
        ----------
        at : (3,) float
        spread : float
            In radians.

        Returns
        -------
        bool
        """
        off = np.arccos(np.clip(self.direction @ at, -1, 1))
        near = off < max(3 * spread, 2 * SMALL)
        others = self.weight[~near & (off < math.radians(75.0))]
        if not len(others):
            return True
        typical = float((others**2).sum() / others.sum())
        return float(self.weight[near].sum()) > _OUTSTANDING * typical


def lobes_at(field: Field, x: int, y: int) -> Lobes:
    """Find the lobes of a pixel.

    Parameters
    ----------
    field : Field
    x, y : int
        The pixel, from the left and from the top.

    Returns
    -------
    Lobes
        None of them where nothing stands at the pixel.

    Raises
    ------
    FieldError
        The pixel was not captured.
    """
    cube = field.hemicube
    found: list[tuple[NDArray, float, float]] = []
    for k, support, reflects, parameters in entries_at(field, x, y):
        for weight, u, v, half_u, half_v in _parts(support.name, parameters, reflects):
            if weight <= 0:
                continue
            x0, x1, y0, y1 = cube.extents[k]
            s, t = x0 + (x1 - x0) * u, y0 + (y1 - y0) * v
            per_area = (x1 - x0) * (y1 - y0) / (1 + s * s + t * t) ** 1.5
            # A rectangle of the half widths a and b has the variances a^2 / 3 and b^2 / 3.
            spread = math.sqrt(per_area * (half_u**2 + half_v**2) / 6)
            found.append((cube.directions(k, np.array(u), np.array(v)), spread, weight))
    if not found:
        return Lobes(np.zeros((0, 3)), np.zeros(0), np.zeros(0))
    around, spread, weight = zip(*found, strict=True)
    return Lobes(np.array(around), np.array(spread), np.array(weight, np.float64))


def _parts(
    support: str, parameters: NDArray, reflects: NDArray
) -> list[tuple[float, float, float, float, float]]:
    """The parts of an entry: weight, middle and half widths on the patch."""
    grey = float(reflects.mean())
    base = support.removesuffix("_rgb")
    if base != support:
        each = parameters.reshape(3, -1)
        return [
            (weight * float(reflects[c]) / 3, *rest)
            for c in range(3)
            for weight, *rest in _parts(base, each[c], np.ones(3))  # type: ignore[misc]
        ]
    p = [float(x) for x in parameters]
    if base == "box":
        return [(grey, *_middle(*p))]
    if base == "double":
        return [(grey * p[0], *_middle(*p[1:])), (grey * (1 - p[0]), 0.5, 0.5, 0.5, 0.5)]
    if base in {"bell", "leaning"}:
        return [(grey, p[0], p[2], p[1], p[3])]
    if base in {"oriented_box", "gaussian"}:
        return [(grey, p[0], p[1], math.sqrt(3) / 2 * p[2], math.sqrt(3) / 2 * p[3])]
    if base == "quadratic":
        across, along = (math.sqrt(3 * max(p[i + 1] - p[i] ** 2, 0)) for i in (0, 2))
        return [(grey, p[0], p[2], across, along)]
    if base == "linear":
        # The middle alone is known. What is off the patch's own middle is no wider than its rim.
        return [(grey, p[0], p[1], min(0.5, 2 * min(p[0], 1 - p[0]) + 0.1),
                 min(0.5, 2 * min(p[1], 1 - p[1]) + 0.1))]  # fmt: skip
    return [(grey, 0.5, 0.5, 0.5, 0.5)]


def _middle(u0: float, u1: float, v0: float, v1: float) -> tuple[float, float, float, float]:
    return (u0 + u1) / 2, (v0 + v1) / 2, (u1 - u0) / 2, (v1 - v0) / 2


def unit(vector: NDArray) -> NDArray[np.float64]:
    """Scale a vector to a length of 1.

    Parameters
    ----------
    vector : (3,) float

    Returns
    -------
    (3,) float64
    """
    return np.asarray(vector, np.float64) / max(float(np.linalg.norm(vector)), 1e-12)
