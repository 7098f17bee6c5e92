"""Light on the patches: an environment map made ready for evaluating supports (paper 6).

Every patch gets a small grid of bins, equal in angle, that collects the map's flux and the solid
angle it came from. Summed-area tables of both (float64: a sun beside darkness cancels) then give
the average radiance over any box of a patch, weighted by solid angle, from four corners.
"""

from __future__ import annotations

from functools import cached_property
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from ..hemicube import Hemicube
from ..patterns import monomials
from .bins import (
    Samples,
    bin_centres,
    bin_coordinate,
    bin_monomials,
    default_resolution,
    sample_bins,
)
from .environment import Environment


class PatchLight:
    """An environment map as the patches of a hemicube see it.

    resolution: bins a patch side, the same for all (default: about one texel of the map each).
    Directions without a patch (a hemicube without a bottom, say) give no light.
    """

    def __init__(
        self, environment: Environment, hemicube: Hemicube, resolution: int | None = None
    ) -> None:
        self.hemicube = hemicube
        if resolution is None:
            self.resolutions = default_resolution(hemicube, environment)
        else:
            self.resolutions = np.full(len(hemicube), resolution, np.intp)
        # where each patch's bins begin, and its table of sums, which has a row and column more
        self._offsets = _starts(self.resolutions**2)
        self._tables = _starts((self.resolutions + 1) ** 2)
        height, width = environment.image.shape[:2]
        # flux and solid angle side by side: one look-up fetches all four
        self._flat = np.zeros((int(self._offsets[-1]), 4))
        for some in sample_bins(hemicube, height, width, self.resolutions, self._offsets):
            self._collect(environment.image[some.rows], some, environment.turn)
        self._fill_empty(environment)
        self._lock = Lock()
        self._polynomials: dict[tuple[int, ...], NDArray[np.float64]] = {}
        self._sums: NDArray[np.float64] | None = None

    @property
    def _sat(self) -> NDArray[np.float64]:
        """The tables of sums, of which only boxes ask; worked out for the first one."""
        with self._lock:  # threads that relight come here at once
            if self._sums is None:
                sums = np.zeros((int(self._tables[-1]), 4))
                for k, r in enumerate(self.resolutions):
                    table = sums[self._tables[k] : self._tables[k + 1]].reshape(r + 1, r + 1, 4)
                    np.cumsum(self.bins_of(k), axis=0, out=table[1:, 1:])
                    np.cumsum(table[1:, 1:], axis=1, out=table[1:, 1:])
                self._sums = sums
            return self._sums

    def _collect(self, texels: NDArray, some: Samples, turn: float) -> None:
        """Add some rows of the map, turned, to the bins."""
        index, solid_angle = some.lit
        few = len(index) < len(self._flat) // 4

        def add(c: int, values: NDArray) -> None:
            if few:
                np.add.at(self._flat[:, c], index, values)
            else:
                self._flat[:, c] += np.bincount(index, values, len(self._flat))

        if few:
            add(3, solid_angle)
        else:
            self._flat[: len(some.solid_angles), 3] += some.solid_angles
        everywhere = len(index) == some.bins.size
        for c in range(3):
            samples = np.repeat(texels[..., c], some.finer, axis=0)
            samples = _turned(np.repeat(samples, some.finer, axis=1), turn).ravel()
            add(c, (samples if everywhere else samples[some.bins.ravel() >= 0]) * solid_angle)

    @property
    def resolution(self) -> int:
        """Bins a patch side, where all patches have the same (ValueError where not)."""
        if (self.resolutions != self.resolutions[0]).any():
            raise ValueError("the patches differ in size, and so in bins: see `resolutions`")
        return int(self.resolutions[0])

    def bins_of(self, k: int) -> NDArray[np.float64]:
        """(r, r, 4): flux (3) and solid angle of the bins of patch k, row by row of v."""
        r = self.resolutions[k]
        return self._flat[self._offsets[k] : self._offsets[k + 1]].reshape(r, r, 4)

    @property
    def binned(self) -> NDArray[np.float64]:
        """(K, r, r, 4): `bins_of` all patches, where all have as many."""
        r = self.resolution
        return self._flat.reshape(-1, r, r, 4)

    def _fill_empty(self, environment: Environment) -> None:
        """A bin that no sample met takes the texel behind its middle, with next to no weight, so
        that a thin box that sees it alone finds light there."""
        empty = np.flatnonzero(self._flat[:, 3] == 0)
        for k in np.unique(np.searchsorted(self._offsets, empty, side="right") - 1):
            bins = self.bins_of(int(k))
            j, i = np.nonzero(bins[..., 3] == 0)
            u, v = self.bin_centres(int(k))
            solid_angle = 1e-3 * self.hemicube.solid_angles[k] / self.resolutions[k] ** 2
            light = environment.at(self.hemicube.directions(int(k), u[i], v[j]))
            bins[j, i, :3] = light.astype(np.float64) * solid_angle
            bins[j, i, 3] = solid_angle

    @cached_property
    def whole(self) -> NDArray[np.float64]:
        """(K, 3): average radiance of each patch."""
        total = np.add.reduceat(self._flat, self._offsets[:-1])
        return total[:, :3] / total[:, 3:]

    def bin_centres(self, k: int) -> tuple[NDArray, NDArray]:
        """Patch coordinates of the bins' centres along u and along v -> (r,), (r,)."""
        return bin_centres(self.hemicube, k, int(self.resolutions[k]))

    def polynomial(self, which: tuple[int, ...]) -> NDArray[np.float64]:
        """The polynomial in u, v nearest to each patch's light, by solid angle.

        which: indices into `patterns.MONOMIALS` -> coefficients (K, len(which), 3). Light that is
        such a polynomial is met exactly, and so then is the pixel: it is a sum of moments.
        """
        with self._lock:  # threads that relight come here at once
            if which in self._polynomials:
                return self._polynomials[which]
            every = bin_monomials(self.hemicube, self.resolutions)
            out = np.empty((len(self.hemicube), len(which), 3))
            for k in range(len(self.hemicube)):
                some = slice(self._offsets[k], self._offsets[k + 1])
                if every is None:
                    u, v = self.bin_centres(k)
                    m = monomials(u[None, :], v[:, None])[list(which)].reshape(len(which), -1)
                else:
                    m = every[list(which), some]
                light = self._flat[some]
                gram = (m * light[:, 3]) @ m.T
                out[k] = np.linalg.solve(gram, m @ light[:, :3])
            self._polynomials[which] = out
            return out

    def box(
        self, k: int | NDArray, u0: NDArray, u1: NDArray, v0: NDArray, v1: NDArray
    ) -> NDArray[np.float64]:
        """Average radiance over boxes of patch k, weighted by solid angle -> (n, 3).

        u0..v1: (n,) edges in patch coordinates, inside [0, 1]. A box thinner than a bin is widened
        to one: the map holds no finer light.
        """
        r = self.resolutions[k]
        i0, i1 = _at_least_one_bin(
            bin_coordinate(self.hemicube, k, u0, 0, r),
            bin_coordinate(self.hemicube, k, u1, 0, r),
            r,
        )
        j0, j1 = _at_least_one_bin(
            bin_coordinate(self.hemicube, k, v0, 1, r),
            bin_coordinate(self.hemicube, k, v1, 1, r),
            r,
        )
        total = self._sum_to(k, i1, j1)
        total -= self._sum_to(k, i0, j1)
        total -= self._sum_to(k, i1, j0)
        total += self._sum_to(k, i0, j0)
        return total[:, :3] / total[:, 3:]

    def _sum_to(self, k: int | NDArray, i: NDArray, j: NDArray) -> NDArray[np.float64]:
        """The table between its entries: bilinear, which is exact for light constant in a bin."""
        r = self.resolutions[k]
        table = self._sat
        a = np.minimum(i.astype(np.int64), r - 1)
        b = np.minimum(j.astype(np.int64), r - 1)
        fi = (i - a)[:, None]
        fj = (j - b)[:, None]
        at = self._tables[k] + b * (r + 1) + a
        low = table[at]
        low += fi * (table[at + 1] - low)
        high = table[at + r + 1]
        high += fi * (table[at + r + 2] - high)
        high -= low
        high *= fj
        low += high
        return low


def _turned(samples: NDArray, turn: float) -> NDArray:
    """What cells of a map (rows, columns) see of it once it is turned: its mean over each. So the
    cells stay where they are, and their bins need not be looked for again."""
    shift = turn / (2 * np.pi) * samples.shape[1]
    whole = int(np.floor(shift))
    part = shift - whole
    if part < 1e-6 or part > 1 - 1e-6:
        return np.roll(samples, round(shift), axis=1) if round(shift) else samples
    out = (1 - part) * np.roll(samples, whole, axis=1)
    out += part * np.roll(samples, whole + 1, axis=1)
    return out


def _starts(sizes: NDArray) -> NDArray[np.intp]:
    """Where each of some runs of these lengths begins, and where the last one ends (K + 1,)."""
    return np.concatenate([[0], np.cumsum(sizes)]).astype(np.intp)


def _at_least_one_bin(low: NDArray, high: NDArray, r: NDArray | int) -> tuple[NDArray, NDArray]:
    low, high = np.clip(low, 0, r), np.clip(high, 0, r)
    centre = np.clip((low + high) / 2, 0.5, r - 0.5)
    thin = high - low < 1
    return np.where(thin, centre - 0.5, low), np.where(thin, centre + 0.5, high)
