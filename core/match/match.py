"""Matching: the light under which a shot looks like a target, by least squares.

What is minimised is the error of each pixel relative to its light, without the weight of those few
that no light can match, plus two pulls. One holds each cell to the present light; the other holds
neighbouring cells together where the picture says nothing, and lets go at the rims of windows and
suns.

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

from ..light.environment import Environment
from ..metrics import mean_relative_error
from .answers import Answers
from .cells import Cells
from .missing import Missing, missing
from .solve import nonnegative
from .target import Target, between

# Rounds in which what does not fit loses weight, and by which relative error a pixel has lost half.
ROUNDS, ODD = 3, 0.05
# The pull between neighbours, and the step between them, in mean lights, that it lets go.
SMOOTH, STEP = 1e-5, 0.3
# The pull to the present light, from `faithful` to `near`.
FAITHFUL, NEAR = 1e-5, 1e1
# A lamp has at least this share of all light, and is so many times brighter than the mean. Its
# patch is cut into 4 times as many cells a side, up to a number; and the most cells in all.
LAMP, CONTRAST, FINEST, MOST_FINE = 0.01, 4.0, 16, 1300
# Rows of the map that is made.
HEIGHT = 256


@dataclass(frozen=True)
class Matched:
    """What was found.

    Parameters
    ----------
    environment : Environment or None
        The light in all directions; None where only gains were looked for.
    gains : dict of str to (3,) float64
        By name, what each light is multiplied by, in red, green and blue.
    turn : float
        By how many radians the base is turned further, counterclockwise from above.
    scale : (3,) float64
        What the target was multiplied by: its exposure and white balance.
    error, before : float
        `metrics.mean_relative_error` of the picture to the scaled target: in the light that was
        found, and in the present light.
    picture, target : (h, w, 3) float64
        In the light that was found, and as it should be, at the size of the small proxy.
    missing : Missing
        What no light that was allowed can make.
    """

    environment: Environment | None
    gains: dict[str, NDArray[np.float64]]
    turn: float
    scale: NDArray[np.float64]
    error: float
    before: float
    picture: NDArray[np.float64]
    target: NDArray[np.float64]
    missing: Missing


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


def brought(
    target: Target, shown: NDArray[np.float64], exposure: bool, balance: bool
) -> NDArray[np.float64]:
    """Find the scale that brings a target to the brightness, or the colour, of a picture.

    Parameters
    ----------
    target : Target
    shown : (n, 3) float64
        The picture in the present light.
    exposure : bool
        Whether the target may be brighter or darker as a whole.
    balance : bool
        Whether each colour of it may be.

    Returns
    -------
    (3,) float64
    """
    have = target.weights @ np.maximum(target.picture, 0)
    want = target.weights @ np.maximum(shown, 0)
    if not (exposure or balance) or not (have > 0).all() or not (want > 0).all():
        return np.ones(3)
    level = want.sum() / have.sum()
    colour = want / have / level if balance else np.ones(3)
    return colour * (level if exposure else 1.0)


def free_light(
    answers: Answers,
    present: Environment,
    target: Target,
    own: NDArray[np.float64],
    near: float = 0.0,
    exposure: bool = False,
    balance: bool = False,
    height: int = HEIGHT,
) -> Generator[float, None, Matched]:
    """Find light in all directions that makes a shot look like a target.

    Parameters
    ----------
    answers : Answers
    present : Environment
        Where the target says nothing, the light is like this.
    target : Target
        At the pixels of `answers`.
    own : (n, 3) float64
        The light of the scene's own lamps, which stays.
    near : float
        From 0, as the target, to 1, as the present light.
    exposure, balance : bool
        See `brought`.
    height : int
        Rows of the map.

    Yields
    ------
    float
        How much is done, 0 to 1.

    Returns
    -------
    Matched
    """
    cells = answers.cells
    have = cells.radiance(present)
    shown = answers.picture(have) + own
    scale = brought(target, shown, exposure, balance)
    target = target.scaled(scale)
    yield 0.1
    found = yield from _solved(answers, have, target, own, near, 0.1, 0.5)
    finer = _finer(answers.cells, found)
    if finer is not None:
        answers = answers.refined(finer)
        cells = answers.cells
        have = cells.radiance(present)
        found = yield from _solved(answers, have, target, own, near, 0.5, 0.9)
    environment = cells.environment(found, height, present)
    return concluded(
        answers, target, answers.under(environment) + own, shown, scale, environment=environment
    )


def _finer(cells: Cells, radiance: NDArray[np.float64]) -> NDArray[np.intp] | None:
    """Cut the patches of bright lights more finely -> (K,) cells a side; None where none is one.

    A lamp is smaller than a cell, and its place decides where its shadows and its images are.
    """
    if cells.hemicube.lamps:  # nothing is known of the parts of a lamp's cell
        return None
    light = radiance.sum(axis=-1)
    flux = light * cells.solid_angles
    bright = (flux > LAMP * flux.sum()) & (light > CONTRAST * flux.sum() / (4 * np.pi))
    patch = np.repeat(np.arange(len(cells.sides)), cells.sides**2)
    order = patch[np.argsort(-flux)]
    sides = cells.sides.copy()
    for k in dict.fromkeys(order[bright[np.argsort(-flux)]].tolist()):
        finer = min(int(sides[k]) * 4, FINEST)
        if finer > sides[k] and (sides**2).sum() + finer**2 - sides[k] ** 2 <= MOST_FINE:
            sides[k] = finer
    return sides if (sides > cells.sides).any() else None


def _solved(
    answers: Answers,
    have: NDArray[np.float64],
    target: Target,
    own: NDArray[np.float64],
    near: float,
    first: float,
    last: float,
) -> Generator[float, None, NDArray[np.float64]]:
    """Find the radiance of the cells, (M, 3). first, last: how much is done before and after."""
    cells = answers.cells
    used = np.flatnonzero(target.weights > 0)
    asked, lamps, dark = target.picture[used], own[used], target.dark
    lit = answers.picture(have)[used]
    wanted = asked - lamps
    weights = target.weights[used]
    weights = weights / weights.sum()
    omega = cells.solid_angles / (4 * np.pi)
    # the present light, as bright as the target, is what is held to
    levels = _levels(weights @ lit, weights @ wanted)
    level = float(levels.mean())
    mean = np.maximum(omega @ have, 1e-3 * float((omega @ have).max())) * levels
    mean = np.maximum(mean, 1e-12)
    pairs, border = cells.borders
    one, two = pairs.T
    found = np.empty_like(have)
    for c in range(3):
        matrix = answers.values[c][:, used]
        pull = pull_of(near) * omega / mean[c] ** 2
        hold = level ** (1 - near) * have[:, c]
        made = lamps[:, c] + levels[c] * lit[:, c]
        some, link = np.ones(len(used)), np.ones(len(pairs))
        x: NDArray[np.float64] | None = None
        for i in range(ROUNDS):
            # the brighter of both at first, so that a place that cannot be as dark as it should be
            # does not rule where the search begins
            ruled = between if i else np.maximum
            relative = np.maximum(ruled(asked[:, c], made), 0) + dark
            root = (np.sqrt(some * weights) / relative).astype(np.float32)
            weighted = matrix * root
            gram = (weighted @ weighted.T).astype(np.float64)
            right = (weighted @ (root * wanted[:, c].astype(np.float32))).astype(np.float64)
            gram[np.diag_indices(cells.count)] += pull
            e = SMOOTH * border * link / (4 * np.pi * mean[c] ** 2)
            np.add.at(gram, (one, one), e)
            np.add.at(gram, (two, two), e)
            np.add.at(gram, (one, two), -e)
            np.add.at(gram, (two, one), -e)
            x = nonnegative(gram, right + pull * hold, x)
            made = x.astype(np.float32) @ matrix + lamps[:, c]
            off = (made - asked[:, c]) / (between(asked[:, c], made) + dark)
            some = 1 / np.sqrt(off**2 + ODD**2)
            some /= weights @ some
            link = 1 / np.sqrt(((x[one] - x[two]) / mean[c]) ** 2 + STEP**2)
            yield first + (last - first) * (c * ROUNDS + i + 1) / (3 * ROUNDS)
        found[:, c] = x
    return found


def _levels(shown: NDArray[np.float64], wanted: NDArray[np.float64]) -> NDArray[np.float64]:
    """How many times brighter the target is than the present picture, (3,), from their means."""
    least = 1e-3 * max(float(np.abs(wanted).max()), 1e-12)
    wanted = np.maximum(wanted, least)
    return np.divide(wanted, shown, out=np.ones(3), where=shown > least)


def concluded(
    answers: Answers,
    target: Target,
    picture: NDArray[np.float64],
    before: NDArray[np.float64],
    scale: NDArray[np.float64],
    environment: Environment | None = None,
    gains: dict[str, NDArray[np.float64]] | None = None,
    turn: float = 0.0,
) -> Matched:
    """Say how near a light came.

    Parameters
    ----------
    answers : Answers
    target : Target
        Scaled.
    picture, before : (n, 3) float64
        In the light that was found, and in the present light.
    scale : (3,) float64
    environment : Environment, optional
    gains : dict of str to (3,) float64, optional
    turn : float

    Returns
    -------
    Matched
    """
    picture = np.maximum(picture, 0)
    counts = answers.image(target.weights) > 0
    as_asked, made = answers.image(target.picture), answers.image(picture)
    used = target.weights > 0
    wanted = np.maximum(target.picture, 0)

    def error(shown: NDArray[np.float64]) -> float:
        if counts.any():
            return mean_relative_error(answers.image(shown), np.maximum(as_asked, 0), counts)
        return mean_relative_error(shown[None], wanted[None], used[None])

    return Matched(
        environment,
        gains or {},
        turn,
        scale,
        error(picture),
        error(np.maximum(before, 0)),
        made,
        as_asked,
        missing(made, as_asked, counts),
    )
