"""The pattern sets that there are: the paper's, monomials, and packed ones (paper 4.3).

Examples
--------
>>> from arto.core.patterns import PATTERN_SETS
>>> len(PATTERN_SETS["linear"])
3
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .packed import LobedSet, PackedSet
from .pattern import ONE, PATTERN_SETS, UU, UV, VV, PatternSet, U, V


def _gradient(degrees: int) -> tuple[float, ...]:
    """The paper's quadratic gradient: the square of a ramp from 0 to 1 along a diagonal."""
    su, sv = {45: (1, 1), 135: (-1, 1), 225: (-1, -1), 315: (1, -1)}[degrees]
    # ramp = c + su u / 2 + sv v / 2, with c such that it runs from 0 to 1 over the patch
    c = (2 - su - sv) / 4
    return (c * c, c * su, 0.25, c * sv, 0.25, su * sv / 2)


def _paper() -> PatternSet:
    white = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    names, rows = ["white"], [white]
    for degrees in (45, 135, 225, 315):
        row = _gradient(degrees)
        names += [f"gradient{degrees}", f"inverse{degrees}"]
        rows += [row, tuple(w - r for w, r in zip(white, row, strict=True))]
    return PatternSet("paper", tuple(names), tuple(rows))


def _monomial_set(name: str, *which: int) -> PatternSet:
    eye = np.eye(6)
    rows = tuple(tuple(float(x) for x in eye[m]) for m in which)
    return PatternSet(name, tuple(("white", "u", "u2", "v", "v2", "uv")[m] for m in which), rows)


def _packed_sets() -> tuple[PackedSet, ...]:
    """All six moments and the grains in three patterns; the first three of them in two; and both,
    for the lobes that are sharp and for those that are not."""
    eye = [tuple(float(x) for x in row) for row in np.eye(6)]
    rows: Any = (
        (eye[ONE], eye[ONE], eye[ONE]),
        (eye[U], eye[V], eye[ONE]),
        (eye[UU], eye[VV], eye[UV]),
    )
    names = ("white", "places", "squares")
    some, every = ((1, 0), (1, 1)), ((1, 0), (2, 0), (1, 1), (2, 1), (2, 2))
    grain = 1, 2
    both = (*names[:2], *(f"sharp_{n}" for n in names))
    return (
        PackedSet("packed", names, rows, every, (U, UU, V, VV, UV), grain),
        PackedSet("packed_linear", names[:2], rows[:2], some, (U, V), grain),
        LobedSet("lobes", both, (*rows[:2], *rows), (), (), grain),
    )


PATTERN_SETS.update(
    (s.name, s)
    for s in (
        _monomial_set("moments", ONE, U, UU, V, VV),
        _monomial_set("moments_uv", ONE, U, UU, V, VV, UV),
        _monomial_set("linear", ONE, U, V),
        _paper(),
        _monomial_set("white", ONE),
        *_packed_sets(),
    )
)
