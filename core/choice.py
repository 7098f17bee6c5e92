"""Which support model each pixel and patch gets: the smallest that explains its light."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .errors import FieldError
from .moments import Moments
from .patterns import PatternSet
from .supports import BOX, LINEAR, NOTHING, SUPPORTS

CHOICES = ("auto", *SUPPORTS)
# A box wider than this (half width, of the patch) is a broad reflection: there the linear
# projection has the smaller error (docs/measurements.md).
BROAD = 0.3


def check(choice: str, patterns: PatternSet) -> None:
    """Raise a typed error if `choice` is unknown or the patterns cannot identify it."""
    if choice not in CHOICES:
        raise FieldError(f"no support model '{choice}': choose one of {', '.join(CHOICES)}")
    for support in (BOX, LINEAR) if choice == "auto" else (SUPPORTS[choice],):
        patterns.require(support.needs, f"the support model '{choice}'")


def choose(choice: str, moments: Moments) -> tuple[NDArray[np.uint8], dict[int, NDArray]]:
    """Model codes of n pixels (n,), and for each code in use the parameters of its pixels."""
    lit = (moments.coefficient > 0).any(axis=-1)
    if choice != "auto":
        support = SUPPORTS[choice]
        codes = np.where(lit, support.code, NOTHING).astype(np.uint8)
        return codes, {support.code: support.fit(moments)[lit]}
    box = BOX.fit(moments)
    broad = ((box[:, 1] - box[:, 0]) > 2 * BROAD) & ((box[:, 3] - box[:, 2]) > 2 * BROAD)
    codes = np.where(lit, np.where(broad, LINEAR.code, BOX.code), NOTHING).astype(np.uint8)
    return codes, {
        BOX.code: box[codes == BOX.code],
        LINEAR.code: LINEAR.fit(moments)[codes == LINEAR.code],
    }
