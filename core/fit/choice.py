"""The choice of a support model for each pixel and patch: the smallest that explains its light.

The candidates nest: nothing, the whole patch, the linear projection, the box. The capture's grain
tells how many independent light paths an entry had, which decides how its moments are read:

- A *box* needs evidence. Its spread must explain the moments better than a linear density, by more
  than two parameters gain by chance (Akaike's criterion with the correction for few samples, AICc).
  Two points in a patch are no evidence of a narrow support, however often one was hit.
- The *whole patch* needs evidence too: the mean of the light must be that of a patch seen evenly
  by solid angle, to `CENTRED`. An uncertain mean is kept as it is, in the linear projection. That
  is unbiased noise, which averages out over pixels and can be denoised. A mean that is rounded to
  the middle stays wrong.
- Where a pixel has too few paths to give evidence, its neighbours may give it: the spread within
  each of them is pooled (`pooled`). Such a box has the middle of its own pixel and the width of the
  pool.
- A box with enough evidence may still be the worse filter. Reflection that is narrow both ways is
  a box. Reflection that is broad, or narrow one way only, is mostly a diffuse view of a patch that
  something hides in part. There the edge of a box lets a sun in or shuts it out by its last digit,
  while the linear projection errs by little. `BROAD` was measured on two scenes and eight HDRIs
  (docs/measurements.md).

Examples
--------
>>> [round(float(price), 2) for price in _aicc(2, np.array([5.0, 100.0, np.inf]))]
[10.0, 4.12, 4.0]
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..capture.moments import Moments
from ..errors import FieldError, PatternError
from ..measure import Extent, box_of
from ..patterns import ONE, UU, VV, PatternSet, U, V
from ..supports import BOX, LINEAR, NOTHING, PER_CHANNEL, SUPPORTS, WHOLE, Support
from .evidence import Evidence
from .pooled import pooled, weighed

SEARCH = "search"
STAGE_AND_MATTE = "stage_and_matte"
CHOICES = ("auto", *SUPPORTS, SEARCH, STAGE_AND_MATTE)
# The largest distance, uncertainty included, at which a mean counts as the whole patch's.
CENTRED = 0.02
# Half width, of the patch, from which on the linear projection beats the box.
BROAD = 0.35
# The largest relative difference between the root of three variances and a half width of `BROAD`.
# On a patch as large as a face it is a tenth.
BENT = 0.15


def check(choice: str, patterns: PatternSet, separate: bool = False) -> None:
    """Check that a choice can be fitted.

    Parameters
    ----------
    choice : str
        One of `CHOICES`.
    patterns : PatternSet
    separate : bool
        Whether each channel gets a support of its own.

    Raises
    ------
    FieldError
        There is no such choice, or it has no supports for each channel.
    PatternError
        The patterns do not identify its moments.
    """
    if choice not in CHOICES:
        raise FieldError(f"no support model '{choice}': choose one of {', '.join(CHOICES)}")
    if separate and choice in (SEARCH, STAGE_AND_MATTE):
        raise FieldError(
            f"'{choice}' has one support for all channels: turn Per Channel off, or choose another "
            "support model"
        )
    if separate and not patterns.grey:
        raise PatternError(
            f"the pattern set '{patterns.name}' has no supports of each channel's own: turn Per "
            "Channel off, or capture with the pattern set 'moments_uv'"
        )
    if choice == SEARCH and not patterns.grey:
        raise PatternError(
            f"the support model '{choice}' needs patterns that are the same in all channels: "
            "capture with the pattern set 'moments_uv', or choose another support model"
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
    """The price of that many parameters from n samples by AICc."""
    few = n - parameters - 1
    with np.errstate(invalid="ignore", divide="ignore"):
        price = 2 * parameters * (1 + (parameters + 1) / few)
    return np.where(np.isinf(n), 2 * parameters, np.where(few > 0, price, np.inf))


def _smallest(
    moments: Moments, known: Evidence, k: int, pixels: NDArray[np.intp]
) -> tuple[NDArray[np.uint8], Moments]:
    """The codes (n,) of the smallest models that explain the moments of one patch, and the moments
    with spreads that the neighbours tell as well.

    Moments without spreads (NaN) are never boxes.
    """
    hits = known.hits(k, pixels)
    n = np.maximum(hits, 1e-9)
    even, means = moments.uniform, np.stack(moments.mean)
    offs = means - even[[U, V]][:, None]
    spreads = even[[UU, VV]] - even[[U, V]] ** 2
    uncertain = np.sqrt(spreads.sum() / n)
    centred = np.sqrt(np.square(offs).sum(axis=0)) + uncertain < CENTRED
    if known.noise is not None:
        # noise of photographs is not of the light: a mean place that it drowns tells nothing
        centred |= hits < 1
    codes = np.where(centred, WHOLE.code, LINEAR.code).astype(np.uint8)
    variances = np.stack(moments.variance)
    if not np.isfinite(variances).any():
        return codes, moments
    grain = known.grain(k) if known.grain else None
    if grain is not None:
        grain = grain.ravel()[pixels]
    box, moments = box_of_neighbours(
        moments, hits, known.sizes[k, pixels], grain, pixels, known.shape
    )
    codes[box] = BOX.code
    return codes, moments


def box_of_neighbours(
    moments: Moments,
    hits: NDArray,
    sizes: NDArray,
    grain: NDArray | None,
    pixels: NDArray[np.intp],
    shape: tuple[int, int],
    broad: float = BROAD,
    surely: NDArray[np.bool_] | None = None,
) -> tuple[NDArray[np.bool_], Moments]:
    """Find the entries of one patch for which they and their neighbours show a box.

    Parameters
    ----------
    moments : Moments
        Of n entries.
    hits : (n,) float
        The numbers of equal light paths.
    sizes : (n,) float
        The coefficients, summed over channels.
    grain : (n,) float, optional
        Without grain each pixel is judged by itself.
    pixels : (n,) int
        Their numbers in the tile, row by row.
    shape : tuple of int
        (h, w) of the tile.
    broad : float
        The half width, of the patch, from which on no box is the better filter.
    surely : (n,) bool, optional
        The entries that are boxes whatever their spread is.

    Returns
    -------
    box : (n,) bool
    moments : Moments
        With the spreads that show it.
    """
    n = np.maximum(hits, 1e-9)
    means, variances = np.stack(moments.mean), np.stack(moments.variance)
    even, extent = moments.uniform, moments.extent
    if grain is None or not len(pixels):
        box = _shown_box(means, variances, even, n, extent, broad)
        return box if surely is None else box | surely, moments

    def judged(some: NDArray[np.intp], alike: bool) -> tuple[NDArray, NDArray]:
        pool = pooled(moments, sizes, grain, pixels, shape, some if alike else None)
        of = weighed(moments.select(some), hits[some], pool)
        more = np.maximum(n[some], pool.paths + 1)
        return of, _shown_box(means[:, some], of[:2], even, more, extent, broad)

    spreads, box = judged(np.arange(len(pixels)), False)
    # what any neighbours make a box, those of about its own size must
    asked = np.flatnonzero(box if surely is None else box | surely)
    if len(asked):
        spreads[:, asked], box[asked] = judged(asked, True)
    if surely is not None:
        box |= surely
    # the middle of n paths scatters about the support's by 1 / n of its variance, which is so much
    # of a blur already: a box that is less wide by that is unbiased over pixels
    spreads = spreads * (1 - 1 / np.maximum(n, 1))
    return box, moments.spread(spreads, box)


def _shown_box(
    means: NDArray,
    variances: NDArray,
    even: NDArray,
    n: NDArray,
    extent: Extent,
    broad: float = BROAD,
) -> NDArray[np.bool_]:
    """Where the evidence shows a box that is narrow enough to be the better filter -> (n,).

    means, variances: (2, n) along u and v; even: (6,) moments of the whole patch; n: the numbers of
    hits; broad: see `box_of_neighbours`.
    """
    offs = means - even[[U, V]][:, None]
    spreads = even[[UU, VV]] - even[[U, V]] ** 2
    spread_gain = np.zeros(len(n))
    widest = np.zeros(len(n))
    for off, variance, even in zip(offs, variances, spreads, strict=True):
        # twice the gain in log likelihood per sample by a spread of its own, compared with the
        # spread of a linear density: the variance of the whole patch minus off^2
        expected = np.maximum(even - off * off, even / 4)
        ratio = np.maximum(variance / expected, 1e-9)
        spread_gain += ratio - 1 - np.log(ratio)
        np.maximum(widest, 3 * variance, out=widest)
    with np.errstate(invalid="ignore"):
        box = np.where(np.isinf(n), True, n * spread_gain > _aicc(4, n) - _aicc(2, n))
    # the half width by the variance alone, which is right to `BENT`
    widest = np.sqrt(widest)
    box &= widest < broad * (1 + BENT)
    near = np.flatnonzero(box & (widest > broad * (1 - BENT)))
    edges = box_of(
        (means[0][near], means[1][near]), (variances[0][near], variances[1][near]), extent
    )
    box[near] = np.maximum(edges[:, 1] - edges[:, 0], edges[:, 3] - edges[:, 2]) < 2 * broad
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
    """Choose the models of n pixels for a patch, and fit them.

    Parameters
    ----------
    choice : str
        `auto`, or one model for every pixel that gets light from the patch.
    basis : (P, n, 3) float
        The patch's basis images.
    coefficient : (n, 3) float
        The reflection coefficients.
    patterns : PatternSet
    known : Evidence
        Of the tile.
    k : int
        The number of the patch.
    extent : tuple of 4 float
        Its place on its face.
    separate : bool
        Whether each channel gets a support of its own.

    Returns
    -------
    codes : (n,) uint8
        The code of each pixel's model.
    parameters : dict of int to (m, p) float
        For each code in use, the parameters of its m pixels.
    """
    lit = entries(choice, coefficient, known, k)
    codes = np.full(len(coefficient), NOTHING, np.uint8)
    codes[lit], found = choose_lit(choice, basis[:, lit], patterns, known, k, lit, extent, separate)
    return codes, found


def entries(choice: str, coefficient: NDArray, known: Evidence, k: int) -> NDArray[np.intp]:
    """Find the pixels in which a patch is an entry under a choice.

    Parameters
    ----------
    choice : str
    coefficient : (n, 3) float
    known : Evidence
    k : int

    Returns
    -------
    (m,) int
    """
    if choice == "auto":
        # most entries are too dark to keep: they get no support, and their light goes into the
        # pixel's rest
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
    """Choose and fit as `choose` does, for those pixels of a patch that are `entries`.

    Parameters
    ----------
    choice : str
    basis : (P, m, 3) float
        The basis images in these pixels.
    patterns : PatternSet
    known : Evidence
    k : int
    pixels : (m,) int
        The numbers of the pixels.
    extent : tuple of 4 float
    separate : bool

    Returns
    -------
    codes : (m,) uint8
    parameters : dict of int to (n, p) float
    """
    moments = Moments.from_basis(basis, patterns, extent, separate)
    if choice == "auto":
        codes, moments = _smallest(moments, known, k, pixels)
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
