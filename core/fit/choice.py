"""Which support model each pixel and patch gets: the smallest that explains its light.

The candidates nest: nothing, the whole patch, the linear projection, the box. How many independent
light paths an entry had is known from the capture's grain, and decides how its moments are read:

- A *box* must be shown. Its spread must explain the moments better than a linear density's by more
  than two parameters would by chance: Akaike's criterion with the correction for few samples
  (AICc). Two points in a patch are no evidence of a narrow support, however often one was hit.
- The *whole patch* must be shown too: that the light's mean is that of the patch, seen evenly by
  solid angle, to `CENTRED`. A mean that is not known is kept as it is, in the linear projection.
  That is noise, but unbiased noise, which averages out over pixels and can be denoised; a mean
  rounded to the middle stays wrong.
- Enough evidence still does not make a box the better filter. A reflection that is narrow both ways
  is one; what is broad, or narrow one way only, is mostly a diffuse view of a patch that something
  hides in part, and there a box lets a sun in or shuts it out by its edge's last digit, while the
  linear projection errs by little. Where one overtakes the other was measured, on two scenes and
  eight HDRIs (docs/measurements.md).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..capture.moments import Moments
from ..errors import FieldError
from ..measure import Extent
from ..patterns import ONE, UU, VV, PatternSet, U, V
from ..supports import BOX, LINEAR, NOTHING, PER_CHANNEL, SUPPORTS, WHOLE, Support
from .evidence import Evidence

SEARCH = "search"
STAGE_AND_MATTE = "stage_and_matte"
CHOICES = ("auto", *SUPPORTS, SEARCH, STAGE_AND_MATTE)
# A mean this near to the whole patch's, its own uncertainty included, is the whole patch's.
CENTRED = 0.02
# Half width, of the patch, from which on the linear projection beats the box.
BROAD = 0.35
# How far the root of three variances may be off a box's half width of `BROAD`, relative: on a patch
# as large as a face it is a tenth.
BENT = 0.15


def check(choice: str, patterns: PatternSet, separate: bool = False) -> None:
    """Raise a typed error if `choice` is unknown, has no supports for each channel where those are
    asked for (`separate`), or cannot be identified from the patterns."""
    if choice not in CHOICES:
        raise FieldError(f"no support model '{choice}': choose one of {', '.join(CHOICES)}")
    if separate and choice in (SEARCH, STAGE_AND_MATTE):
        raise FieldError(
            f"'{choice}' has one support for all channels: turn Per Channel off, or choose another "
            "support model"
        )
    if choice == SEARCH:
        patterns.require((ONE,), f"the support model '{choice}'")
    elif choice == "auto":
        patterns.require(LINEAR.needs, f"the support model '{choice}'")
    elif choice == STAGE_AND_MATTE:
        patterns.require(BOX.needs, f"the support model '{choice}'")
    else:
        patterns.require(SUPPORTS[choice].needs, f"the support model '{choice}'")


def _aicc(parameters: int, n: NDArray) -> NDArray:
    """AICc's price of that many parameters from n samples."""
    few = n - parameters - 1
    with np.errstate(invalid="ignore", divide="ignore"):
        price = 2 * parameters * (1 + (parameters + 1) / few)
    return np.where(np.isinf(n), 2 * parameters, np.where(few > 0, price, np.inf))


def _smallest(moments: Moments, hits: NDArray) -> NDArray[np.uint8]:
    """The codes (n,) of the smallest models that explain the moments of one patch.

    Moments without spreads (NaN) leave the box out.
    """
    n = np.maximum(hits, 1e-9)
    even = moments.uniform
    offs = [mean - middle for mean, middle in zip(moments.mean, even[[U, V]], strict=True)]
    spreads = even[[UU, VV]] - even[[U, V]] ** 2
    uncertain = np.sqrt(spreads.sum() / n)
    centred = np.sqrt(offs[0] * offs[0] + offs[1] * offs[1]) + uncertain < CENTRED
    codes = np.where(centred, WHOLE.code, LINEAR.code).astype(np.uint8)
    if np.isfinite(moments.variance).any():
        codes[_shown_box(moments, offs, spreads, n)] = BOX.code
    return codes


def _shown_box(
    moments: Moments, offs: list[NDArray], spreads: NDArray, n: NDArray
) -> NDArray[np.bool_]:
    """Where a box is shown, and narrow enough to be the better filter -> (n,).

    offs: the means' distances from the whole patch's, along u and v; spreads: the variances of the
    whole patch; n: hits.
    """
    spread_gain = np.zeros(len(n))
    widest = np.zeros(len(n))
    for off, variance, even in zip(offs, moments.variance, spreads, strict=True):
        # twice the gain in log likelihood, a sample, of a spread of its own over that of a linear
        # density, that of the whole patch less off^2
        expected = np.maximum(even - off * off, even / 4)
        ratio = np.maximum(variance / expected, 1e-9)
        spread_gain += ratio - 1 - np.log(ratio)
        np.maximum(widest, 3 * variance, out=widest)
    with np.errstate(invalid="ignore"):
        box = np.where(np.isinf(n), True, n * spread_gain > _aicc(4, n) - _aicc(2, n))
    # the half width by the variance alone, which solid angle bends by less than `BENT`
    widest = np.sqrt(widest)
    box &= widest < BROAD * (1 + BENT)
    near = np.flatnonzero(box & (widest > BROAD * (1 - BENT)))
    edges = BOX.fit(moments.select(near))
    box[near] = np.maximum(edges[:, 1] - edges[:, 0], edges[:, 3] - edges[:, 2]) < 2 * BROAD
    return box


def choose(
    choice: str,
    basis: NDArray,
    coefficient: NDArray,
    patterns: PatternSet,
    known: Evidence,
    k: int,
    extent: Extent,
    separate: bool = False,
) -> tuple[NDArray[np.uint8], dict[int, NDArray]]:
    """Model codes of n pixels for patch k, and for each code in use the parameters of its pixels.

    basis: (P, n, 3), the patch's images; coefficient: (n, 3) of theirs; extent: of patch k on its
    face; choice: `auto`, or one model for every pixel that gets light from the patch; separate:
    supports of each channel's own.
    """
    lit = entries(choice, coefficient, known, k)
    codes = np.full(len(coefficient), NOTHING, np.uint8)
    codes[lit], found = choose_lit(choice, basis[:, lit], patterns, known, k, lit, extent, separate)
    return codes, found


def entries(choice: str, coefficient: NDArray, known: Evidence, k: int) -> NDArray[np.intp]:
    """The pixels in which patch k is an entry under a choice; coefficient: (n, 3)."""
    if choice == "auto":
        # most entries are too dark to keep: what they see of their patch is not asked for, and
        # their light goes into the pixel's rest
        return known.kept(k)
    return np.flatnonzero((coefficient > 0).any(axis=-1))


def choose_lit(
    choice: str,
    basis: NDArray,
    patterns: PatternSet,
    known: Evidence,
    k: int,
    pixels: NDArray[np.intp],
    extent: Extent,
    separate: bool = False,
) -> tuple[NDArray[np.uint8], dict[int, NDArray]]:
    """`choose` for those pixels of patch k that are `entries`; basis: (P, n, 3) of them."""
    moments = Moments.from_basis(basis, patterns, extent, separate)
    if choice == "auto":
        codes = _smallest(moments, known.hits(k, pixels))
    else:
        codes = np.full(len(pixels), SUPPORTS[choice].code, np.uint8)
    found: dict[int, NDArray] = {}
    chosen = codes.copy()
    for support in SUPPORTS.values():
        here = chosen == support.code
        if not here.any():
            continue
        used: Support = support
        if separate and support.parameters:
            used = PER_CHANNEL[support.name]
            codes[here] = used.code
        found[used.code] = used.fit(moments.select(here))
    return codes, found
