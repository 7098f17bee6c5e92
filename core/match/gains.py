"""Gains: how bright lights must be, and in which colour, so that a shot looks like a target.

The lights are those that there are: a kit's, the base below them, the scene's own lamps. Each has a
picture, and the pictures add up. The base can be turned, too.

Examples
--------
>>> key, fill = np.array([[1.0, 1, 1], [0.2, 0.2, 0.2]]), np.full((2, 3), 0.5)
>>> target = Target(2 * key + 0.5 * fill, np.ones(2))
>>> found, _, _ = solved({"key": key, "fill": fill}, np.zeros((2, 3)), target)
>>> {name: gain.round(2).tolist() for name, gain in found.items()}
{'key': [2.0, 2.0, 2.0], 'fill': [0.5, 0.5, 0.5]}
"""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..light.environment import Environment
from .answers import Answers
from .fit import ODD, ROUNDS, pull_of
from .match import Matched, brought, concluded
from .solve import nonnegative
from .target import Target, between

# The turns that are tried, and the width in texels of the map that is turned.
TURNS, TURNED_WIDTH = 72, 256
# Each finer search halves the step; this many of them.
FINER = 5


@dataclass(frozen=True)
class Wish:
    """What may change beside the gains.

    Parameters
    ----------
    near : float
        From 0, as the target, to 1, as the present light.
    colours : bool
        Whether each light's colour may change, or its strength alone.
    exposure, balance : bool
        Whether the target may be brighter as a whole, and in each colour by itself.
    grey : frozenset of str
        The lights whose strength alone may change, whatever `colours` says.
    """

    near: float = 0.0
    colours: bool = False
    exposure: bool = False
    balance: bool = False
    grey: frozenset[str] = frozenset()


def solved(
    lights: Mapping[str, NDArray[np.float64]],
    fixed: NDArray[np.float64],
    target: Target,
    wish: Wish = Wish(),
) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.float64], float]:
    """Find the gains of lights.

    Parameters
    ----------
    lights : dict of str to (n, 3) float64
        By name, the picture of each light as it is now.
    fixed : (n, 3) float64
        The picture of what stays.
    target : Target
    wish : Wish

    Returns
    -------
    gains : dict of str to (3,) float64
    scale : (3,) float64
        What the target is multiplied by.
    error : float
        The mean of the relative error, of an error of half as much in all pixels, about half.
    """
    every = sum(lights.values(), fixed)
    scale = brought(target, every, wish.exposure, wish.balance)
    used = np.flatnonzero(target.weights > 0)
    # with light that stays, its brightness in the target tells the exposure
    stays = bool((np.abs(fixed[used]).sum(axis=0) > 1e-3 * np.abs(every[used]).sum(axis=0)).all())
    free_scale = stays and (wish.exposure or wish.balance)
    asked = target if free_scale else target.scaled(scale)
    pictures = [light[used] for light in lights.values()]
    kept = np.zeros_like(fixed[used])
    if free_scale:
        pictures.append(fixed[used])
    else:
        kept = fixed[used]
    wanted, dark = asked.picture[used] - kept, asked.dark
    relative = np.maximum(np.maximum(asked.picture, every)[used], 0) + dark
    weights = asked.weights[used] / asked.weights[used].sum()
    hold = np.tile(1 / scale if free_scale else np.ones(3), (len(pictures), 1))
    count = len(lights)
    by_colour = np.zeros(len(pictures), bool)
    by_colour[:count] = [wish.colours and name not in wish.grey for name in lights]
    by_colour[count:] = wish.balance
    found = np.ones((len(pictures), 3))
    some = np.ones_like(wanted)
    # an unknown for each picture and colour, or one for all colours
    columns = [
        (i, c) for i in range(len(pictures)) for c in (range(3) if by_colour[i] else (None,))
    ]
    basis = np.zeros((len(columns), *wanted.shape))
    for a, (i, c) in enumerate(columns):
        chosen = slice(None) if c is None else c
        basis[a, :, chosen] = pictures[i][:, chosen]
    pull = pull_of(wish.near)
    goal = np.array([hold[i].mean() if c is None else hold[i, c] for i, c in columns])
    error = 0.0
    for _ in range(ROUNDS):
        w = some * weights[:, None] / relative**2
        gram = np.einsum("anc,bnc->ab", basis * w, basis, optimize=True)
        right = np.einsum("anc,nc->a", basis * w, wanted)
        # a light that does nothing here keeps its gain
        gram[np.diag_indices(len(gram))] += pull + 1e-9
        x = nonnegative(gram, right + (pull + 1e-9) * goal)
        for (i, c), value in zip(columns, x, strict=True):
            found[i, slice(None) if c is None else c] = value
        made = np.tensordot(x, basis, 1)
        relative = between(asked.picture[used], made + kept) + dark
        off = (made - wanted) / relative
        error = float((weights[:, None] * np.abs(off)).sum() / 3)
        some = 1 / np.sqrt(off**2 + ODD**2)
        some /= (weights[:, None] * some).sum() / 3
    if free_scale:
        scale = 1 / np.maximum(found[-1], 1e-6)
        if not wish.exposure:
            scale = scale / scale.mean()
        found = found * scale
    return dict(zip(lights, found, strict=False)), scale, error


def gains(
    answers: Answers,
    lights: Mapping[str, NDArray[np.float64]],
    fixed: NDArray[np.float64],
    target: Target,
    wish: Wish = Wish(),
) -> Matched:
    """Find the gains of lights, and say how near they come.

    Parameters
    ----------
    answers : Answers
    lights, fixed, target, wish
        As `solved` takes them, at the pixels of `answers`.

    Returns
    -------
    Matched
    """
    found, scale, _ = solved(lights, fixed, target, wish)
    picture = sum((found[name] * light for name, light in lights.items()), fixed)
    before = sum(lights.values(), fixed)
    return concluded(answers, target.scaled(scale), picture, before, scale, gains=found)


def turned(
    answers: Answers,
    base: Environment,
    lights: Mapping[str, NDArray[np.float64]],
    fixed: NDArray[np.float64],
    target: Target,
    wish: Wish = Wish(),
    name: str = "base",
) -> Generator[float, object, Matched]:
    """Find the turn of a base, its gain, and the gains of other lights.

    Parameters
    ----------
    answers : Answers
    base : Environment
    lights, fixed, target, wish
        As `gains` takes them; the base is not among the lights.
    name : str
        The base's, in the gains that are returned.

    Yields
    ------
    float
        How much is done, 0 to 1.

    Returns
    -------
    Matched
        Its `turn` is to be added to the base's.
    """
    coarse = base.image.shape[1] // TURNED_WIDTH
    fits = coarse > 1 and not any(side % coarse for side in base.image.shape[:2])
    small = base.coarser(coarse) if fits else base

    def tried(turn: float) -> tuple[float, NDArray[np.float64]]:
        picture = answers.under(replace(small, turn=base.turn + turn))
        return solved({**lights, name: picture}, fixed, target, wish)[2], picture

    step = 2 * math.pi / TURNS
    errors = []
    for i in range(TURNS):
        errors.append(tried(i * step)[0])
        yield 0.9 * (i + 1) / TURNS
    best, least = float(np.argmin(errors)) * step, min(errors)
    for _ in range(FINER):
        step /= 2
        for turn in (best - step, best + step):
            error = tried(turn)[0]
            if error < least:
                best, least = turn, error
    yield 0.98
    best = (best + math.pi) % (2 * math.pi) - math.pi
    now = gains(answers, {**lights, name: tried(best)[1]}, fixed, target, wish)
    before = sum(lights.values(), fixed) + answers.under(small)
    shown = sum((now.gains[n] * p for n, p in {**lights, name: tried(best)[1]}.items()), fixed)
    return concluded(
        answers, target.scaled(now.scale), shown, before, now.scale, gains=now.gains, turn=best
    )
