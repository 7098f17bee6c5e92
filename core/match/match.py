"""Matching: the light under which a shot looks like a target.

Cells take most of the light. Lamps are smaller than a cell. Who can render them is asked for
pictures of discs where the light is brightest; who cannot gets finer cells there.

Examples
--------
>>> target = Target(np.full((2, 3), 4.0), np.ones(2))
>>> brought(target, np.ones((2, 3)), exposure=True, balance=False).tolist()
[0.25, 0.25, 0.25]
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
from .discs import SIZES, Discs, finer, sought
from .fit import Columns, fitted
from .missing import Missing, missing
from .target import Target

# A lamp has at least this share of all light, and is so many times brighter than the mean. Its
# patch is cut into 4 times as many cells a side, up to a number; and the most cells in all.
LAMP, CONTRAST, FINEST, MOST_FINE = 0.01, 4.0, 16, 1300
# Rows of the map that is made, and how many times more where it has discs.
HEIGHT, SHARPER = 256, 2


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
    lamps: bool = False,
) -> Generator[float | Discs, NDArray | None, Matched]:
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
    lamps : bool
        Whether pictures of discs can be had.

    Yields
    ------
    float or Discs
        How much is done, 0 to 1. With `lamps` also discs whose pictures are to be sent, each
        with radiance 1: (2, L, n, 3) float at the pixels of `answers`, from two renders whose noise
        differs.

    Returns
    -------
    Matched
    """
    have = answers.cells.radiance(present)
    columns = Columns.of(answers, have)
    shown = columns.picture(have) + own
    scale = brought(target, shown, exposure, balance)
    target = target.scaled(scale)
    yield 0.05
    found = yield from _between(fitted(columns, target, own, near), 0.05, 0.35)
    discs = sought(answers.cells, found) if lamps else None
    if discs:
        cells = answers.cells
        columns, discs, found = yield from _with_discs(columns, discs, target, own, near, found)
        light, lit = found[: cells.count], found[cells.count :]
        image = cells.environment(light, height, present).image
        sharper = Environment(image.repeat(SHARPER, axis=0).repeat(SHARPER, axis=1))
        picture = columns.picture(found) + own
        environment = discs.drawn_on(sharper, lit)
        return concluded(answers, target, picture, shown, scale, environment)
    sides = _sides(answers.cells, found)
    if sides is not None:
        answers = answers.refined(sides)
        columns = Columns.of(answers, answers.cells.radiance(present))
        found = yield from _between(fitted(columns, target, own, near), 0.35, 0.9)
    environment = answers.cells.environment(found, height, present)
    return concluded(
        answers, target, answers.under(environment) + own, shown, scale, environment=environment
    )


def _between(
    work: Generator[float, object, NDArray[np.float64]], first: float, last: float
) -> Generator[float, object, NDArray[np.float64]]:
    """Do a piece of the work. first, last: how much is done before and after."""
    while True:
        try:
            share = next(work)
        except StopIteration as e:
            return e.value
        yield first + (last - first) * share


def _with_discs(
    cells: Columns,
    asked: Discs,
    target: Target,
    own: NDArray[np.float64],
    near: float,
    found: NDArray[np.float64],
) -> Generator[float | Discs, NDArray | None, tuple[Columns, Discs, NDArray[np.float64]]]:
    """Find the light of cells and of discs, smaller and smaller ones -> (columns, discs, light).

    asked: the first discs; found: the light of the cells without discs.
    """
    count = len(cells.solid_angles)
    discs = asked.only(np.zeros(len(asked), bool))
    shown = np.empty((3, 2, 0, cells.values.shape[-1]), np.float32)
    columns = cells
    step = 0.55 / len(SIZES)
    for i, _ in enumerate(SIZES):
        done = 0.35 + i * step
        pictures = yield asked
        assert pictures is not None
        more = np.moveaxis(pictures, -1, 0).astype(np.float32)
        discs, shown = discs.and_(asked), np.concatenate([shown, more], axis=2)
        columns = cells.and_discs(discs, shown)
        start = np.concatenate([found, np.zeros((len(discs) - len(found) + count, 3))])
        last = i + 1 == len(SIZES)
        rounds = 2 if last else 1
        found = yield from _between(
            fitted(columns, target, own, near, start, rounds), done + 0.5 * step, done + step
        )
        if last:
            break
        kept, asked = finer(discs, found[count:], SIZES[i + 1])
        if not len(asked):
            break
        found = np.concatenate([found[:count], found[count:][kept]])
        discs, shown = discs.only(kept), shown[:, :, kept]
    return columns, discs, found


def _sides(cells: Cells, radiance: NDArray[np.float64]) -> NDArray[np.intp] | None:
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
        missing(made, as_asked, counts, answers.mirrors),
    )
