"""Illumination patterns: what a patch shows, by polynomials and by channel (paper 4.3).

`pattern` says what a set of patterns is, `packed` packs several polynomials into the channels of a
pattern, `sets` names the sets that there are.
"""

from __future__ import annotations

from . import sets as sets  # fills PATTERN_SETS
from .packed import LobedSet, PackedSet
from .pattern import (
    ALL,
    BASE,
    MONOMIALS,
    ONE,
    PATHS,
    PATTERN_SETS,
    SHARP,
    UU,
    UV,
    VV,
    PatternSet,
    U,
    V,
    channel_sum,
    monomials,
    pattern_set,
)

__all__ = [
    "ALL",
    "BASE",
    "MONOMIALS",
    "ONE",
    "PATHS",
    "PATTERN_SETS",
    "SHARP",
    "UU",
    "UV",
    "VV",
    "LobedSet",
    "PackedSet",
    "PatternSet",
    "U",
    "V",
    "channel_sum",
    "monomials",
    "pattern_set",
    "sets",
]
