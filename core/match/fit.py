"""Least squares of a target: the radiance of cells, and of discs, that a picture is made of.

What is minimised is the error of each pixel relative to its light, without the weight of those few
that no light can match, plus two pulls. One holds each piece of light to the present light; the
other holds neighbouring cells together where the picture says nothing, and lets go at the rims of
windows and suns.

Examples
--------
>>> [float(f"{pull_of(near):.1e}") for near in (0.0, 0.5, 1.0)]
[1e-05, 0.01, 10.0]
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .answers import Answers
from .discs import Discs
from .solve import nonnegative
from .target import Target, between

# Rounds in which what does not fit loses weight, and by which relative error a pixel has lost half.
ROUNDS, ODD = 3, 0.05
# The pull between neighbours, and the step between them, in mean lights, that it lets go.
SMOOTH, STEP = 1e-5, 0.3
# The pull to the present light, from `faithful` to `near`.
FAITHFUL, NEAR = 1e-5, 1e1
# How much of what noise adds to the equations of discs is taken out of them.
TAKEN, MOST_TAKEN = 0.8, 0.9
# What is so many times brighter than the mean of all below it counts no more than this for the
# mean of a light, by which the pulls are measured.
OUTSHINES = 8.0


def pull_of(near: float) -> float:
    """Say how strongly a slider holds to the present light.

    Parameters
    ----------
    near : float
        From 0, faithful to the target, to 1, near to the present light.

    Returns
    -------
    float
        The weight of the pull.
    """
    return FAITHFUL * (NEAR / FAITHFUL) ** float(np.clip(near, 0, 1))


@dataclass(frozen=True)
class Columns:
    """The pieces of light whose radiance is looked for, and what each shows.

    Parameters
    ----------
    values : (3, M, n) float32
        As `Answers.values`.
    solid_angles : (M,) float64
        Steradians.
    pairs : (e, 2) int
        Which pieces are neighbours.
    border : (e,) float64
        As `Cells.borders`.
    have : (M, 3) float64
        The present radiance of each.
    noise : (3, L, n) float32, optional
        Half the difference of two pictures of each of the last L pieces.
    """

    values: NDArray[np.float32]
    solid_angles: NDArray[np.float64]
    pairs: NDArray[np.intp]
    border: NDArray[np.float64]
    have: NDArray[np.float64]
    noise: NDArray[np.float32] | None = None

    @staticmethod
    def of(answers: Answers, have: NDArray[np.float64]) -> Columns:
        """Take the cells of a matrix.

        Parameters
        ----------
        answers : Answers
        have : (M, 3) float64

        Returns
        -------
        Columns
        """
        cells = answers.cells
        return Columns(answers.values, cells.solid_angles, *cells.borders, have)

    def and_discs(self, discs: Discs, shown: NDArray[np.float32]) -> Columns:
        """Add discs, which do not shine in the present light.

        Parameters
        ----------
        discs : Discs
        shown : (3, 2, L, n) float32
            Two pictures of each with radiance 1, whose noise differs.

        Returns
        -------
        Columns
        """
        return Columns(
            np.concatenate([self.values, shown.mean(axis=1)], axis=1),
            np.concatenate([self.solid_angles, discs.solid_angles]),
            self.pairs,
            self.border,
            np.concatenate([self.have, np.zeros((len(discs), 3))]),
            np.float32(0.5) * (shown[:, 0] - shown[:, 1]),
        )

    def picture(self, radiance: NDArray) -> NDArray[np.float64]:
        """Compute what light shows.

        Parameters
        ----------
        radiance : (M, 3) float

        Returns
        -------
        (n, 3) float64
        """
        lit = [radiance[:, c].astype(np.float32) @ self.values[c] for c in range(3)]
        return np.stack(lit, axis=-1).astype(np.float64)


def fitted(
    columns: Columns,
    target: Target,
    own: NDArray[np.float64],
    near: float = 0.0,
    start: NDArray[np.float64] | None = None,
    rounds: int = ROUNDS,
) -> Generator[float, object, NDArray[np.float64]]:
    """Find the radiance of pieces of light.

    Parameters
    ----------
    columns : Columns
    target : Target
    own : (n, 3) float64
        The light of the scene's own lamps, which stays.
    near : float
        See `pull_of`.
    start : (M, 3) float64, optional
        A guess; the present light, as bright as the target, by default.
    rounds : int
        In which what does not fit loses weight.

    Yields
    ------
    float
        How much is done, 0 to 1.

    Returns
    -------
    (M, 3) float64
    """
    used = np.flatnonzero(target.weights > 0)
    asked, lamps, dark = target.picture[used], own[used], target.dark
    lit = columns.picture(columns.have)[used]
    wanted = asked - lamps
    weights = target.weights[used]
    weights = weights / weights.sum()
    omega = columns.solid_angles / (4 * np.pi)
    # the present light, as bright as the target, is what is held to
    levels = _levels(weights @ lit, weights @ wanted)
    level = float(levels.mean())
    if start is None:
        mean = np.maximum(omega @ columns.have, 1e-3 * float((omega @ columns.have).max())) * levels
    else:
        mean = np.array([_mean(omega, start[:, c]) for c in range(3)])
        mean = np.maximum(mean, 1e-3 * float(mean.max()))
    mean = np.maximum(mean, 1e-12)
    one, two = columns.pairs.T
    count = len(omega)
    found = np.empty_like(columns.have)
    for c in range(3):
        matrix = columns.values[c][:, used]
        pull = pull_of(near) * omega / mean[c] ** 2
        if columns.noise is not None:
            # by their light and not by their radiance, or a small one could not be bright
            discs = slice(count - columns.noise.shape[1], count)
            pull[discs] *= omega[discs]
        hold = level ** (1 - near) * columns.have[:, c]
        x = None if start is None else start[:, c]
        made = lamps[:, c] + (levels[c] * lit[:, c] if x is None else x.astype(np.float32) @ matrix)
        some = np.ones(len(used)) if x is None else _counted(made, asked[:, c], dark, weights)
        link = np.ones(len(one))
        for i in range(rounds):
            # the brighter of both at first, so that a place that cannot be as dark as it should be
            # does not rule where the search begins
            ruled = between if i or start is not None else np.maximum
            relative = np.maximum(ruled(asked[:, c], made), 0) + dark
            root = (np.sqrt(some * weights) / relative).astype(np.float32)
            weighted = matrix * root
            gram = (weighted @ weighted.T).astype(np.float64)
            right = (weighted @ (root * wanted[:, c].astype(np.float32))).astype(np.float64)
            if columns.noise is not None:
                # noise in the pictures would spread the light of one over many
                seen = columns.noise[c][:, used] * root
                discs = slice(count - len(seen), count)
                gram[discs, discs] -= _taken(gram[discs, discs], seen, some * weights, count)
            gram[np.diag_indices(count)] += pull
            e = SMOOTH * columns.border * link / (4 * np.pi * mean[c] ** 2)
            np.add.at(gram, (one, one), e)
            np.add.at(gram, (two, two), e)
            np.add.at(gram, (one, two), -e)
            np.add.at(gram, (two, one), -e)
            x = nonnegative(gram, right + pull * hold, x)
            made = x.astype(np.float32) @ matrix + lamps[:, c]
            some = _counted(made, asked[:, c], dark, weights)
            link = 1 / np.sqrt(((x[one] - x[two]) / mean[c]) ** 2 + STEP**2)
            yield (c * rounds + i + 1) / (3 * rounds)
        found[:, c] = x
    return found


def _taken(
    gram: NDArray[np.float64], seen: NDArray[np.float32], weights: NDArray[np.float64], count: int
) -> NDArray[np.float64]:
    """What noise adds to the equations of discs, (L, L), as far as it is taken out of them.

    As many unknowns as there are fit that much of the noise, and something has to be left of each
    disc. gram: the equations of the discs; seen: their noise; weights: of the pixels; count: of the
    unknowns.
    """
    pixels = float(weights.sum()) ** 2 / float((weights**2).sum())
    noise = (seen @ seen.T).astype(np.float64) * TAKEN * max(1 - count / pixels, 0.0)
    root = np.linalg.cholesky(gram + 1e-9 * np.diag(np.diag(gram)))
    inner = np.linalg.solve(root, np.linalg.solve(root, noise).T)
    sizes, axes = np.linalg.eigh((inner + inner.T) / 2)
    kept = root @ axes * np.clip(sizes, 0, MOST_TAKEN)
    return kept @ (root @ axes).T


def _counted(
    made: NDArray[np.float64], asked: NDArray[np.float64], dark: float, weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """How much each pixel counts by how far off it is, 1 in the mean."""
    off = (made - asked) / (between(asked, made) + dark)
    some = 1 / np.sqrt(off**2 + ODD**2)
    return some / (weights @ some)


def _mean(omega: NDArray[np.float64], light: NDArray[np.float64]) -> float:
    """The mean of a light without what outshines the rest of it. omega: of all directions, as a
    share."""
    level = np.inf
    for _ in range(30):
        level = OUTSHINES * float(omega @ np.minimum(light, level)) / float(omega.sum())
    return level / OUTSHINES


def _levels(shown: NDArray[np.float64], wanted: NDArray[np.float64]) -> NDArray[np.float64]:
    """How many times brighter the target is than the present picture, (3,), from their means."""
    least = 1e-3 * max(float(np.abs(wanted).max()), 1e-12)
    wanted = np.maximum(wanted, least)
    return np.divide(wanted, shown, out=np.ones(3), where=shown > least)
