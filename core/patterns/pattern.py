"""Illumination patterns: what a patch shows, as polynomials of its coordinates (paper 4.3).

Every pattern is a polynomial of degree two in the patch's coordinates u, v in [0, 1]: a row of
coefficients over `MONOMIALS`. The basis image of a pattern is the same combination of the moments
of the light's path from patch to pixel. So a set of patterns is described by its matrix, and the
moments that it can tell are those in the row space of the matrix (docs/identifiability.md).

A pattern may also show another polynomial in each colour channel (`packed`). A moment is then the
ratio of its image to the white image in the moment's own channel, where the colour of what reflects
cancels. So three patterns hold all six moments, at the price of three layers that a light path
crosses.

Examples
--------
>>> from arto.core.patterns import pattern_set
>>> paper = pattern_set("paper")
>>> len(paper), paper.rank
(9, 5)
>>> paper.identified
(True, True, False, True, False, True)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..errors import PatternError

MONOMIALS = ("1", "u", "u2", "v", "v2", "uv")
ONE, U, UU, V, VV, UV = range(6)


def monomials(u: NDArray, v: NDArray) -> NDArray:
    """Evaluate the six monomials 1, u, u^2, v, v^2, uv.

    Parameters
    ----------
    u, v : (...) float
        Patch coordinates, of shapes that broadcast.

    Returns
    -------
    (6, ...) float
        In the order of `MONOMIALS`.
    """
    u, v = np.broadcast_arrays(u, v)
    return np.stack([np.ones_like(u), u, u * u, v, v * v, u * v])


# Which light paths see a pattern, by what they left last on their way from the camera: a diffuse
# surface or a volume, or one that reflects or refracts.
PATHS = ALL, BASE, SHARP = "all", "base", "sharp"


# Every pattern set by its name: `sets` fills it.
PATTERN_SETS: dict[str, PatternSet] = {}


@dataclass(frozen=True)
class PatternSet:
    """A set of P patterns.

    Parameters
    ----------
    name : str
    patterns : tuple of str
        The names of the patterns.
    coefficients : tuple of P tuples of 6 float
        Their coefficients over `MONOMIALS`.
    """

    name: str
    patterns: tuple[str, ...]
    coefficients: tuple[tuple[float, ...], ...]

    def __len__(self) -> int:
        return len(self.patterns)

    @cached_property
    def matrix(self) -> NDArray[np.float64]:
        """(P, 6) float64: basis image p is the sum of matrix[p, m] times moment m over the
        monomials m.
        """
        return np.array(self.coefficients, np.float64)

    def radiance(self, u: NDArray, v: NDArray) -> NDArray:
        """Evaluate what each pattern emits.

        Parameters
        ----------
        u, v : (...) float
            Patch coordinates.

        Returns
        -------
        (P, ...) float
            Radiance between 0 and 1.
        """
        return np.tensordot(self.matrix, monomials(u, v), axes=1)

    @property
    def grey(self) -> bool:
        """Whether every pattern shows the same in all channels."""
        return True

    def emission(self, pattern: str) -> tuple[tuple[float, ...] | None, ...]:
        """Say what each channel of a pattern emits.

        Parameters
        ----------
        pattern : str
            Its name.

        Returns
        -------
        tuple
            For each channel the coefficients over `MONOMIALS`, or None where the channel shows
            grains (`names.GRAIN`). One for all channels where they are the same.
        """
        return (self.coefficients[self.patterns.index(pattern)],)

    @cached_property
    def rows(self) -> NDArray[np.float64]:
        """(r, 6) float64: every polynomial that some channel of some pattern shows."""
        return self.matrix

    @cached_property
    def rank(self) -> int:
        """The number of independent combinations of moments that the set measures."""
        return int(np.linalg.matrix_rank(self.rows))

    @cached_property
    def condition(self) -> float:
        """Largest over smallest non-zero singular value: how far the set amplifies noise."""
        s = np.linalg.svd(self.rows, compute_uv=False)[: self.rank]
        return float(s[0] / s[-1])

    def sees(self, functional: NDArray | tuple[float, ...]) -> bool:
        """Say whether a combination of moments can be computed from the basis images.

        Parameters
        ----------
        functional : (6,) float
            The coefficients of the combination over `MONOMIALS`.

        Returns
        -------
        bool
        """
        f = np.asarray(functional, np.float64)
        projected = self._pseudo_inverse @ self.rows
        return bool(np.allclose(f @ projected, f, atol=1e-9))

    @cached_property
    def _pseudo_inverse(self) -> NDArray[np.float64]:
        return np.linalg.pinv(self.rows, rcond=1e-10)

    @cached_property
    def identified(self) -> tuple[bool, ...]:
        """For each of `MONOMIALS`, whether its moment can be computed from the basis images."""
        return tuple(self.sees(row) for row in np.eye(6))

    @cached_property
    def noise_gain(self) -> float:
        """How far noise of the images, each by itself, is in a mean place on the patch.

        The variance of the mean place is this times the variance of an image (of the sum over its
        channels), over the square of the coefficient.
        """
        one, *places = (float(np.square(self._pseudo_inverse[m]).sum()) for m in (ONE, U, V))
        return sum(places) / 2 + one / 4

    def require(self, wanted: tuple[int, ...], what: str) -> None:
        """Check that the set identifies some moments.

        Parameters
        ----------
        wanted : tuple of int
            Indices into `MONOMIALS`.
        what : str
            What needs the moments, for the message.

        Raises
        ------
        PatternError
            A moment is not identified. The message names the pattern sets that would do.
        """
        missing = [MONOMIALS[m] for m in wanted if not self.identified[m]]
        if missing:
            able = [s for s in PATTERN_SETS.values() if all(s.identified[m] for m in wanted)]
            names = " or ".join(f"'{s.name}'" for s in able)
            raise PatternError(
                f"{what} needs the moments {', '.join(missing)}, which the pattern set "
                f"'{self.name}' cannot tell. Capture with the pattern set {names}, "
                "or choose another support model."
            )

    def coefficient(self, basis: NDArray) -> NDArray:
        """Compute the reflection coefficient R, the zeroth moment.

        Parameters
        ----------
        basis : (P, ...) float
            Basis images, scene-linear radiance.

        Returns
        -------
        (...) float

        Raises
        ------
        PatternError
            The set does not identify the zeroth moment.

        Source
        ------
        Paper 3.
        """
        self.require((ONE,), "a reflection coefficient")
        if self.shown_by is not None:
            first, *others = self.shown_by
            total = basis[first]
            for p in others:
                total = total + basis[p]
            return total
        return np.tensordot(self._pseudo_inverse[ONE].astype(basis.dtype), basis, axes=1)

    @cached_property
    def shown_by(self) -> tuple[int, ...] | None:
        """The numbers of the patterns whose basis images add up to the reflection coefficient.

        None where the coefficient is another combination of basis images.
        """
        row = self._pseudo_inverse[ONE]
        only = row[0] == 1 and not np.abs(row[1:]).max(initial=0) > 1e-12
        return (0,) if only and self.identified[ONE] else None

    def paths(self, pattern: str) -> str:
        """Say which light paths see a pattern.

        Parameters
        ----------
        pattern : str

        Returns
        -------
        str
            One of `PATHS`.
        """
        return ALL

    def moments(self, basis: NDArray) -> NDArray:
        """Compute the moments from basis images.

        Parameters
        ----------
        basis : (P, ...) float
            Radiance in the light of each pattern, scene-linear.

        Returns
        -------
        (6, ...) float
            Of the dtype of `basis`. A moment that the set does not identify is NaN, so that nothing
            uses it by mistake.

        Raises
        ------
        PatternError
            `basis` has another number of patterns.
        """
        if basis.shape[0] != len(self):
            raise PatternError(
                f"pattern set '{self.name}' has {len(self)} patterns, not {basis.shape[0]}"
            )
        inverse = self._pseudo_inverse.astype(basis.dtype)
        inverse[np.abs(inverse) < 1e-12] = 0
        out = np.empty((6, *basis.shape[1:]), basis.dtype)
        for moment, row, identified in zip(out, inverse, self.identified, strict=True):
            if not identified:
                moment[...] = np.nan
                continue
            # term by term, because most rows have one term: for a matrix product this thin a
            # library's threads mostly wait for each other
            first, *others = np.flatnonzero(row)
            np.multiply(basis[first], row[first], out=moment)
            for p in others:
                moment += basis[p] * row[p]
        return out

    def shared(self, basis: NDArray, even: NDArray) -> NDArray[np.float64]:
        """Compute the moments that the channels share.

        Parameters
        ----------
        basis : (P, n, 3) float
            Basis images, scene-linear radiance.
        even : (6,) float
            The normalised moments of the whole patch, for what the images do not tell.

        Returns
        -------
        (6, n) float64
            The moments of the sum over channels; NaN for what the set does not identify.

        Source
        ------
        Paper 5: the channels share a support.
        """
        return self.moments(channel_sum(basis))

    def grains(self, basis: NDArray) -> NDArray | None:
        """Compute the difference of two random halves of the light, summed over channels.

        Parameters
        ----------
        basis : (P, ..., 3) float

        Returns
        -------
        (...) float or None
            None where no pattern of the set shows grains. NaN where the channel of the grains has
            no light.
        """
        return None


def channel_sum(images: NDArray) -> NDArray[np.float64]:
    """Sum images over their channels. numpy's own sum is slow over so short an axis.

    Parameters
    ----------
    images : (..., 3) float

    Returns
    -------
    (...) float64
    """
    return images[..., 0].astype(np.float64) + images[..., 1] + images[..., 2]


def pattern_set(name: str) -> PatternSet:
    """Find a pattern set by its name.

    Parameters
    ----------
    name : str

    Returns
    -------
    PatternSet

    Raises
    ------
    PatternError
        There is no such set. The message names those that exist.
    """
    try:
        return PATTERN_SETS[name]
    except KeyError:
        raise PatternError(
            f"no pattern set '{name}': choose one of {', '.join(PATTERN_SETS)}"
        ) from None
