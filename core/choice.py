"""Which support model each pixel and patch gets: the smallest that explains its light.

The candidates nest: nothing, the whole patch, the linear projection, the box. How many independent
light paths an entry had is known from the capture's grain, and decides how its moments are read:

- A *box* must be shown. Its spread must explain the moments better than a linear density's by more
  than two parameters would by chance: Akaike's criterion with the correction for few samples
  (AICc). Two points in a patch are no evidence of a narrow support, however often one was hit.
- The *whole patch* must be shown too: that the light's mean is its middle, to `CENTRED`. A mean
  that is not known is kept as it is, in the linear projection. That is noise, but unbiased noise,
  which averages out over pixels and can be denoised; a mean rounded to the middle stays wrong.
- Enough evidence still does not make a box the better filter. A reflection that is narrow both ways
  is one; what is broad, or narrow one way only, is mostly a diffuse view of a patch that something
  hides in part, and there a box lets a sun in or shuts it out by its edge's last digit, while the
  linear projection errs by little. Where one overtakes the other was measured, on two scenes and
  eight HDRIs (docs/measurements.md).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import FieldError
from .moments import UNIFORM_VARIANCE, Moments, channel_sum
from .patterns import ONE, PatternSet
from .supports import BOX, LINEAR, NOTHING, PER_CHANNEL, SUPPORTS, WHOLE, Support

SEARCH = "search"
STAGE_AND_MATTE = "stage_and_matte"
CHOICES = ("auto", *SUPPORTS, SEARCH, STAGE_AND_MATTE)
# Entries are dropped as nothing, smallest first, while what is dropped stays under this share of
# the pixel's light.
DROPPED = 1e-3
# Pixels along the side of the window that an entry's noise is measured in.
WINDOW = 5
# A mean this near to the patch's middle, its own uncertainty included, is the middle.
CENTRED = 0.02
# Half width, of the patch, from which on the linear projection beats the box.
BROAD = 0.35


@dataclass(frozen=True)
class Evidence:
    """How far the moments of a tile can be believed.

    hits: (K, n) how many equal light paths would be as noisy as what reached each patch, infinite
    where there is no such noise (photographs); least: (n,) coefficient, summed over channels, under
    which an entry is dropped.
    """

    hits: NDArray
    least: NDArray


def evidence(
    coefficients: NDArray,
    shape: tuple[int, int],
    samples: float | None = None,
    grain: NDArray | None = None,
) -> Evidence:
    """What is known of a tile's noise, and what is too small to keep.

    coefficients: (K, n, 3) of all patches; shape: (h, w) of the tile, n = h x w; samples: samples a
    pixel of the capture, None without noise; grain: (K, h, w), see `capture_set.GRAIN`. Paths of
    weights w_i are as good as (sum w)^2 / sum w^2 equal ones. Grain shows the sum of squares, on
    average: over a window of pixels. Without it, hits are counted by the patch's share of the
    light, which takes all paths for equal.
    """
    size = channel_sum(coefficients)
    total = size.sum(axis=0)
    order = np.sort(size, axis=0)
    kept = np.cumsum(order, axis=0) > DROPPED * total
    # the smallest entry that must be kept
    least = np.take_along_axis(order, kept.argmax(axis=0)[None], axis=0)[0]
    if samples is None:
        return Evidence(np.full(size.shape, np.inf), least)
    share = samples * size / np.where(total > 0, total, 1)
    if grain is None:
        return Evidence(share, least)
    squares = _window_sum(np.square(grain, dtype=np.float64))
    signal = _window_sum(np.square(size).reshape(-1, *shape))
    found = signal / np.maximum(squares, 1e-300)
    # few grains may cancel by chance; no path counts for more than one sample
    return Evidence(np.minimum(found.reshape(size.shape), 2 * share + 1), least)


def _window_sum(images: NDArray) -> NDArray:
    """Sums over windows of `WINDOW` pixels a side, cut at the rim: (K, h, w) -> (K, h, w)."""
    for axis in (1, 2):
        length = images.shape[axis]
        pad = [(0, 0)] * 3
        pad[axis] = (1, 0)
        sums = np.pad(np.cumsum(images, axis=axis), pad)
        at = np.arange(length)
        high = np.minimum(at + WINDOW // 2 + 1, length)
        low = np.maximum(at - WINDOW // 2, 0)
        images = sums.take(high, axis=axis) - sums.take(low, axis=axis)
    return images


def check(choice: str, patterns: PatternSet) -> None:
    """Raise a typed error if `choice` is unknown or the patterns cannot identify it."""
    if choice not in CHOICES:
        raise FieldError(f"no support model '{choice}': choose one of {', '.join(CHOICES)}")
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


def automatic(moments: Moments, hits: NDArray, least: NDArray) -> NDArray[np.uint8]:
    """The model codes (n,) of the smallest models that explain the moments of one patch.

    hits, least: (n,), see `Evidence`. Moments without spreads (NaN) leave the box out.
    """
    n = np.maximum(hits, 1e-9)
    size = channel_sum(moments.coefficient)
    off_centre = np.zeros(len(size))
    spread_gain = np.zeros(len(size))
    narrow = np.ones(len(size), bool)
    for mean, variance in zip(moments.mean, moments.variance, strict=True):
        off = mean - 0.5
        off_centre += off * off
        # twice the gain in log likelihood, a sample, of a spread of its own over that of a linear
        # density, 1/12 - off^2
        expected = np.maximum(UNIFORM_VARIANCE - off * off, UNIFORM_VARIANCE / 4)
        ratio = np.maximum(variance / expected, 1e-9)
        spread_gain += ratio - 1 - np.log(ratio)
        narrow &= 3 * variance < BROAD**2
    uncertain = np.sqrt(2 * UNIFORM_VARIANCE / n)
    centred = np.sqrt(off_centre) + uncertain < CENTRED
    with np.errstate(invalid="ignore"):
        box = np.where(np.isinf(n), True, n * spread_gain > _aicc(4, n) - _aicc(2, n))
    codes = np.where(centred, WHOLE.code, LINEAR.code)
    codes = np.where(narrow & box, BOX.code, codes)
    return np.where((size > 0) & (size >= least), codes, NOTHING).astype(np.uint8)


def choose(
    choice: str, moments: Moments, known: Evidence, k: int, separate: bool = False
) -> tuple[NDArray[np.uint8], dict[int, NDArray]]:
    """Model codes of n pixels for patch k, and for each code in use the parameters of its pixels.

    separate: supports of each channel's own (then `moments.channels` must be there).
    """
    if choice == "auto":
        codes = automatic(moments, known.hits[k], known.least)
    else:
        lit = (moments.coefficient > 0).any(axis=-1)
        codes = np.where(lit, SUPPORTS[choice].code, NOTHING).astype(np.uint8)
    found: dict[int, NDArray] = {}
    for support in SUPPORTS.values():
        here = codes == support.code
        if not here.any():
            continue
        used: Support = support
        if separate and support.parameters:
            used = PER_CHANNEL[support.name]
            codes[here] = used.code
        found[used.code] = used.fit(moments.select(here))
    return codes, found
