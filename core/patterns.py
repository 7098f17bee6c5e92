"""Illumination patterns: what a patch shows, as polynomials of its coordinates (paper 4.3).

Every pattern here is a polynomial of degree two in the patch's coordinates u, v in [0, 1]: a row of
coefficients over `MONOMIALS`. The basis image of a pattern is then that same combination of the
*moments* of the light's path from patch to pixel, and a set of patterns is known by its matrix:
what it can see is its row space (see docs/identifiability.md).
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
    """The six monomials at patch coordinates `u`, `v` (any equal shapes) -> (6, ...)."""
    u, v = np.broadcast_arrays(u, v)
    return np.stack([np.ones_like(u), u, u * u, v, v * v, u * v])


@dataclass(frozen=True)
class PatternSet:
    """P patterns: their names and their coefficients over `MONOMIALS`, a (P, 6) tuple."""

    name: str
    patterns: tuple[str, ...]
    coefficients: tuple[tuple[float, ...], ...]

    def __len__(self) -> int:
        return len(self.patterns)

    @cached_property
    def matrix(self) -> NDArray[np.float64]:
        """(P, 6): basis image p = sum over monomials of matrix[p, m] * moment m."""
        return np.array(self.coefficients, np.float64)

    def radiance(self, u: NDArray, v: NDArray) -> NDArray:
        """What each pattern emits at (u, v), between 0 and 1 -> (P, ...)."""
        return np.tensordot(self.matrix, monomials(u, v), axes=1)

    @cached_property
    def rank(self) -> int:
        """How many independent numbers the set measures."""
        return int(np.linalg.matrix_rank(self.matrix))

    @cached_property
    def condition(self) -> float:
        """Largest over smallest non-zero singular value: how far the set amplifies noise."""
        s = np.linalg.svd(self.matrix, compute_uv=False)[: self.rank]
        return float(s[0] / s[-1])

    def sees(self, functional: NDArray | tuple[float, ...]) -> bool:
        """Whether a combination of moments (6 coefficients) can be told from the basis images."""
        f = np.asarray(functional, np.float64)
        projected = self._pseudo_inverse @ self.matrix
        return bool(np.allclose(f @ projected, f, atol=1e-9))

    @cached_property
    def _pseudo_inverse(self) -> NDArray[np.float64]:
        return np.linalg.pinv(self.matrix, rcond=1e-10)

    @cached_property
    def identified(self) -> tuple[bool, ...]:
        """For each of `MONOMIALS`, whether its moment can be told on its own."""
        return tuple(self.sees(row) for row in np.eye(6))

    def require(self, wanted: tuple[int, ...], what: str) -> None:
        """Raise PatternError unless every monomial index in `wanted` is identified."""
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
        """The zeroth moment alone, the reflection coefficient: (P, ...) basis images -> (...)."""
        self.require((ONE,), "a reflection coefficient")
        if self.shown_by is not None:
            return basis[self.shown_by]
        return np.tensordot(self._pseudo_inverse[ONE].astype(basis.dtype), basis, axes=1)

    @cached_property
    def shown_by(self) -> int | None:
        """The pattern whose basis image is the reflection coefficient itself; None where it takes
        several."""
        row = self._pseudo_inverse[ONE]
        only = row[0] == 1 and not np.abs(row[1:]).max(initial=0) > 1e-12
        return 0 if only and self.identified[ONE] else None

    def moments(self, basis: NDArray) -> NDArray:
        """Moments from basis images.

        basis: (P, ...) radiance in each pattern's light -> (6, ...) of the same dtype; a moment
        that the set cannot identify is NaN, so that nobody uses it by mistake.
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
            # term by term: most rows have one, and a product of matrices so thin keeps a library's
            # threads busy with waiting for each other
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
    """The set of that name; PatternError names those that exist."""
    try:
        return PATTERN_SETS[name]
    except KeyError:
        raise PatternError(
            f"no pattern set '{name}': choose one of {', '.join(PATTERN_SETS)}"
        ) from None
