"""Packed patterns: each colour channel of a pattern shows another polynomial or grains.

A moment is the ratio of its image to the white image in the moment's own channel. There the colour
of what reflects cancels. A channel without light tells nothing of its moments.

Examples
--------
>>> from arto.core.patterns import pattern_set
>>> packed = pattern_set("packed")
>>> len(packed), packed.identified
(3, (True, True, True, True, True, True))
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import PatternError
from .pattern import BASE, ONE, PATTERN_SETS, SHARP, UU, UV, VV, PatternSet, U, V, channel_sum

# A channel with less than this share of an entry's light tells nothing of it.
TELLS = 1e-5


@dataclass(frozen=True)
class PackedSet(PatternSet):
    """Patterns of which each channel shows something else.

    Parameters
    ----------
    name : str
    patterns : tuple of str
    coefficients : (P, 3, 6) tuples of float
        A polynomial for each channel. The first pattern is white.
    places : tuple of (pattern, channel)
        Where each of the moments stands that the set tells.
    told : tuple of int
        Those moments, indices of `MONOMIALS`.
    grain : (pattern, channel)
        Where the grains stand. The coefficients there are not used.
    """

    coefficients: Any
    places: tuple[tuple[int, int], ...] = ()
    told: tuple[int, ...] = ()
    grain: tuple[int, int] = (0, 0)

    @property
    def grey(self) -> bool:
        """Whether every pattern shows the same in all channels: no."""
        return False

    @cached_property
    def matrix(self) -> NDArray[np.float64]:
        """There is none: asking raises PatternError."""
        raise PatternError(
            f"the pattern set '{self.name}' shows something else in each channel, which is of no "
            "use here: capture with the pattern set 'moments_uv'"
        )

    def emission(self, pattern: str) -> tuple[tuple[float, ...] | None, ...]:
        """See `PatternSet.emission`.

        Parameters
        ----------
        pattern : str

        Returns
        -------
        tuple
        """
        p = self.patterns.index(pattern)
        shown: list[Any] = list(self.coefficients[p])
        if self.grain[0] == p:
            shown[self.grain[1]] = None
        return tuple(shown)

    @cached_property
    def rows(self) -> NDArray[np.float64]:
        """(r, 6) float64: every polynomial that some channel of some pattern shows."""
        own = [row for name in self.patterns for row in self.emission(name) if row is not None]
        return np.unique(np.array(own, np.float64), axis=0)

    @cached_property
    def identified(self) -> tuple[bool, ...]:
        """For each of `MONOMIALS`, whether the images tell its moment."""
        return tuple(m == ONE or m in self.told for m in range(6))

    @cached_property
    def shown_by(self) -> tuple[int, ...] | None:
        """The numbers of the patterns whose basis images add up to the coefficient."""
        return (0,)

    @cached_property
    def noise_gain(self) -> float:
        """See `PatternSet.noise_gain`. A place is told by one channel of three."""
        return 3 * 1.25

    def moments(self, basis: NDArray) -> NDArray:
        """Refuse: a channel by itself does not hold the moments.

        Parameters
        ----------
        basis : (P, ...) float

        Returns
        -------
        (6, ...) float
            Never.

        Raises
        ------
        PatternError
            Always.
        """
        raise PatternError(
            f"the pattern set '{self.name}' has no moments of each channel's own: capture with the "
            "pattern set 'moments_uv'"
        )

    def shared(self, basis: NDArray, even: NDArray) -> NDArray[np.float64]:
        """Compute the moments that the channels share, see `PatternSet.shared`.

        A channel without light does not tell its moments. Along an axis of which nothing is told, a
        pixel gets the moments of the whole patch. Where only the tilt is not told, it gets none.

        Parameters
        ----------
        basis : (P, n, 3) float
        even : (6,) float

        Returns
        -------
        (6, n) float64

        Raises
        ------
        PatternError
            `basis` has another number of patterns.
        """
        if basis.shape[0] != len(self):
            raise PatternError(
                f"pattern set '{self.name}' has {len(self)} patterns, not {basis.shape[0]}"
            )
        total = channel_sum(basis[0])
        out = np.empty((6, *total.shape))
        out[ONE] = 1
        out[[m for m in range(1, 6) if m not in self.told]] = np.nan
        for m, (p, c) in zip(self.told, self.places, strict=True):
            own = basis[0][..., c].astype(np.float64)
            told = own > TELLS * total
            np.divide(basis[p][..., c], own, out=out[m], where=told)
            out[m][~told] = np.nan
        for mean, square in ((U, UU), (V, VV)):
            missing = np.isnan(out[mean])
            out[mean][missing] = even[mean]
            if square in self.told:
                out[square][missing] = even[square]
                out[UV][missing] = np.nan
        if UV in self.told:
            out[UV] = np.where(np.isnan(out[UV]), out[U] * out[V], out[UV])
        out *= total
        return out

    def grains(self, basis: NDArray) -> NDArray | None:
        """See `PatternSet.grains`.

        Parameters
        ----------
        basis : (P, ..., 3) float

        Returns
        -------
        (...) float or None
        """
        p, c = self.grain
        own = basis[0][..., c]
        total = basis[0].sum(axis=-1)
        told = own > np.float32(TELLS) * total
        difference = 2 * basis[p][..., c] - own
        ratio = np.divide(total, own, out=np.full_like(own, np.nan), where=told)
        return np.asarray(difference * ratio)


@dataclass(frozen=True)
class LobedSet(PackedSet):
    """Packed patterns of which some are seen by diffuse paths alone, and the others by the rest.

    A coat on paint, or glass before a wall, is two lobes in one patch: a broad one of which the
    mean place is enough, and a narrow one whose spread is wanted. They come apart in the render
    already, where a path says what it left last.

    Parameters
    ----------
    name, patterns, coefficients, places, told, grain
        See `PackedSet`.
    base : int
        How many patterns are the broad lobe's. They come first.
    """

    base: int = 2

    def emission(self, pattern: str) -> tuple[tuple[float, ...] | None, ...]:
        """See `PatternSet.emission`.

        Parameters
        ----------
        pattern : str

        Returns
        -------
        tuple
        """
        first, second = self.lobes
        p = self.patterns.index(pattern)
        if p < self.base:
            return first.emission(first.patterns[p])
        return second.emission(second.patterns[p - self.base])

    def paths(self, pattern: str) -> str:
        """See `PatternSet.paths`.

        Parameters
        ----------
        pattern : str

        Returns
        -------
        str
        """
        return BASE if self.patterns.index(pattern) < self.base else SHARP

    @cached_property
    def identified(self) -> tuple[bool, ...]:
        """For each of `MONOMIALS`, whether the images tell its moment."""
        # of the sum of both lobes
        return tuple(m in (ONE, U, V) for m in range(6))

    @cached_property
    def shown_by(self) -> tuple[int, ...] | None:
        """The numbers of the patterns whose basis images add up to the coefficient."""
        return (0, self.base)

    def sees(self, functional: NDArray | tuple[float, ...]) -> bool:
        """See `PatternSet.sees`.

        Parameters
        ----------
        functional : (6,) float

        Returns
        -------
        bool
        """
        f = np.asarray(functional, np.float64)
        return not f[[m for m in range(6) if not self.identified[m]]].any()

    @cached_property
    def lobes(self) -> tuple[PackedSet, PackedSet]:
        """The sets of the base and of what is sharp, each by itself."""
        first, second = PATTERN_SETS["packed_linear"], PATTERN_SETS["packed"]
        assert isinstance(first, PackedSet) and isinstance(second, PackedSet)
        return first, second

    def shared(self, basis: NDArray, even: NDArray) -> NDArray[np.float64]:
        """Compute the moments of the sum of both lobes, see `PatternSet.shared`.

        Parameters
        ----------
        basis : (P, n, 3) float
        even : (6,) float

        Returns
        -------
        (6, n) float64
            NaN for the second moments, which only one lobe tells.
        """
        parts = basis[: self.base], basis[self.base :]
        first, second = (s.shared(b, even) for s, b in zip(self.lobes, parts, strict=True))
        out = first + second
        out[[UU, VV, UV]] = np.nan
        return out

    def grains(self, basis: NDArray) -> NDArray | None:
        """See `PatternSet.grains`.

        Parameters
        ----------
        basis : (P, ..., 3) float

        Returns
        -------
        (...) float or None
        """
        return None
