"""Illumination patterns: what a patch shows, as polynomials of its coordinates (paper 4.3).

Every pattern is a polynomial of degree two in the patch's coordinates u, v in [0, 1]: a row of
coefficients over `MONOMIALS`. The basis image of a pattern is the same combination of the moments
of the light's path from patch to pixel. So a set of patterns is described by its matrix, and the
moments that it can tell are those in the row space of the matrix (docs/identifiability.md).

Examples
--------
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

from .errors import PatternError

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

    @cached_property
    def rank(self) -> int:
        """The number of independent combinations of moments that the set measures."""
        return int(np.linalg.matrix_rank(self.matrix))

    @cached_property
    def condition(self) -> float:
        """Largest over smallest non-zero singular value: how far the set amplifies noise."""
        s = np.linalg.svd(self.matrix, compute_uv=False)[: self.rank]
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
        projected = self._pseudo_inverse @ self.matrix
        return bool(np.allclose(f @ projected, f, atol=1e-9))

    @cached_property
    def _pseudo_inverse(self) -> NDArray[np.float64]:
        return np.linalg.pinv(self.matrix, rcond=1e-10)

    @cached_property
    def identified(self) -> tuple[bool, ...]:
        """For each of `MONOMIALS`, whether its moment can be computed from the basis images."""
        return tuple(self.sees(row) for row in np.eye(6))

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
            return basis[self.shown_by]
        return np.tensordot(self._pseudo_inverse[ONE].astype(basis.dtype), basis, axes=1)

    @cached_property
    def shown_by(self) -> int | None:
        """The number of the pattern whose basis image is the reflection coefficient itself.

        None where the coefficient is a combination of several basis images.
        """
        row = self._pseudo_inverse[ONE]
        only = row[0] == 1 and not np.abs(row[1:]).max(initial=0) > 1e-12
        return 0 if only and self.identified[ONE] else None

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


PATTERN_SETS: dict[str, PatternSet] = {
    s.name: s
    for s in (
        _monomial_set("moments", ONE, U, UU, V, VV),
        _monomial_set("moments_uv", ONE, U, UU, V, VV, UV),
        _monomial_set("linear", ONE, U, V),
        _paper(),
        _monomial_set("white", ONE),
    )
}


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
