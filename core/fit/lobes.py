"""Two lobes in a patch: what was captured apart is fitted apart (`patterns.LobedSet`).

The base, which left a diffuse surface or a volume, is broad: its mean place is enough, in the
linear projection. What is sharp, which reflected or refracted last, is a bell wherever its spread
shows one. Where it shows none, both are one entry again: a sum of moments.

A pixel most of whose light is sharp is a mirror, glass or metal itself. There a few paths are what
a render of as many samples has too: bells about their own middles, and no plane, are its unbiased
picture. Elsewhere what is sharp is also light that was reflected onto something matt, whose few
paths are noise.

Examples
--------
A patch that is seen by diffuse paths alone has no sharp entry:

>>> from arto.core.fit.evidence import evidence
>>> from arto.core.patterns import pattern_set
>>> basis = np.zeros((5, 1, 3), np.float32)
>>> basis[:2] = 0.5
>>> known = evidence(np.full((1, 1), 1.5, np.float32), (1, 1), np.ones(1))
>>> found = choose_lobes(basis, pattern_set("lobes"), known, 0, np.arange(1), (-1, 1, -1, 1))
>>> found.sharp
()
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..capture.moments import Moments, normalise
from ..field.tile_writer import TileWriter
from ..measure import Extent, uniform_moments
from ..patterns import ONE, UU, UV, VV, LobedSet, U, V, channel_sum
from ..supports import BELL, LEANING, LINEAR, NOTHING, WHOLE
from ..supports.leaning import LEANS, correlation
from .choice import CENTRED, box_of_neighbours
from .evidence import Evidence
from .pooled import hits_of

# Half width, of the patch, from which on a sharp lobe is better off in the linear projection.
BROAD_SHARP = 0.6
# Share of a pixel's light from which on all that is sharp in it is a bell.
MOSTLY = 0.5


@dataclass(frozen=True)
class Sharp:
    """Entries of a sharp lobe that share a model.

    Parameters
    ----------
    code : int
        Of the model.
    pixels : (m,) int
        Which of the n pixels have one.
    light : (3, m) float32
        Their reflection coefficients.
    parameters : (p, m) float
    """

    code: int
    pixels: NDArray[np.intp]
    light: NDArray[np.float32]
    parameters: NDArray


@dataclass(frozen=True)
class Lobes:
    """The entries of one patch in n pixels.

    Parameters
    ----------
    codes : (n,) uint8
        The models of the base, or of both lobes where they are one.
    coefficient : (n, 3) float32
        The reflection coefficients of these.
    parameters : dict of int to (m, p) float
        The parameters of each code in use.
    sharp : tuple of Sharp
        The entries of the sharp lobe, by model.
    """

    codes: NDArray[np.uint8]
    coefficient: NDArray[np.float32]
    parameters: dict[int, NDArray]
    sharp: tuple[Sharp, ...]


def choose_lobes(
    basis: NDArray,
    patterns: LobedSet,
    known: Evidence,
    k: int,
    pixels: NDArray[np.intp],
    extent: Extent,
    together: bool = True,
    sharp_share: NDArray | None = None,
) -> Lobes:
    """Choose and fit the entries of a patch in those pixels that have any.

    Parameters
    ----------
    basis : (P, n, 3) float
        The basis images in these pixels, scene-linear radiance.
    patterns : LobedSet
    known : Evidence
        Of the tile.
    k : int
    pixels : (n,) int
        The numbers of the pixels in the tile.
    extent : tuple of 4 float
        The place of the patch on its face.
    together : bool
        Whether all images are of one render, so that the grain can be believed.
    sharp_share : (N,) float, optional
        The share of each of the tile's pixels' light that is sharp.

    Returns
    -------
    Lobes
    """
    of_base, of_sharp = patterns.lobes
    even = uniform_moments(extent)
    parts = basis[: patterns.base], basis[patterns.base :]
    base, sharp = (s.shared(b, even) for s, b in zip((of_base, of_sharp), parts, strict=True))
    sizes = sharp[ONE]
    some = np.flatnonzero(sizes > 0)
    box = np.zeros(len(pixels), bool)
    sharps: list[Sharp] = []
    if len(some):
        seen = pixels[some]
        moments = Moments(parts[1][0][some], normalise(sharp[:, some], extent), extent)
        grain = of_sharp.grains(parts[1][:, some]) if together else None
        surely = None if sharp_share is None else sharp_share[seen] > MOSTLY
        hits, grain = hits_of(known, sizes[some], grain, seen)
        shown, moments = box_of_neighbours(
            moments, hits, sizes[some], grain, seen, known.shape, BROAD_SHARP, surely
        )
        # one too small to be an entry by itself is better off with the base
        shown &= known.kept_of(k, seen, sizes[some])
        box[some[shown]] = True
        leans = np.abs(correlation(moments)) > LEANS
        for support, of in ((BELL, ~leans), (LEANING, leans)):
            here = np.flatnonzero(shown & of)
            if len(here):
                light = parts[1][0][some[here]].T
                sharps.append(
                    Sharp(support.code, some[here], light, support.fit(moments.select(here)).T)
                )
    total = base + np.where(box, 0, sharp)
    total[[UU, VV, UV]] = np.nan
    left = normalise(total, extent)
    coefficient = np.where(box[:, None], parts[0][0], parts[0][0] + parts[1][0])
    size = channel_sum(coefficient)
    # what of a base is too small to keep goes into the rest of its pixel
    kept = known.kept_of(k, pixels, size)
    paths = known.share_of(pixels, size)
    codes = np.full(len(pixels), NOTHING, np.uint8)
    off = np.hypot(left[U] - even[U], left[V] - even[V])
    spread = even[UU] - even[U] ** 2 + even[VV] - even[V] ** 2
    centred = off + np.sqrt(spread / np.maximum(paths, 1e-9)) < CENTRED
    codes[kept] = np.where(centred[kept], WHOLE.code, LINEAR.code)
    parameters: dict[int, NDArray] = {}
    for support in (WHOLE, LINEAR):
        here = codes == support.code
        if here.any():
            used = [U, V] if support is LINEAR else []
            parameters[support.code] = left[used][:, here].T
    return Lobes(codes, coefficient, parameters, tuple(sharps))


def write_lobes(
    writer: TileWriter, coefficient: NDArray, lit: NDArray[np.intp], lobes: Lobes
) -> None:
    """Write the next patch of a tile, which may have two entries in a pixel.

    Parameters
    ----------
    writer : TileWriter
    coefficient : (n, 3) float
        R of all the patch's light, of every pixel of the tile.
    lit : (m,) int
        The pixels that have an entry.
    lobes : Lobes
        The entries.

    Raises
    ------
    FieldError
        A coefficient is no number.
    """
    codes = np.full(len(coefficient), NOTHING, np.uint8)
    codes[lit] = lobes.codes
    left = np.array(coefficient)
    left[lit] = lobes.coefficient
    for sharp in lobes.sharp:
        writer.add_entries(sharp.code, lit[sharp.pixels], sharp.light, sharp.parameters)
    writer.add(codes, left, lobes.parameters)
