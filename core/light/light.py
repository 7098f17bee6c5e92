"""Light on the patches: an environment map made ready for evaluating supports (paper 6).

Every patch gets a grid of bins, equal in angle, that collects the map's flux and the solid angle
of that flux. Summed-area tables of both give the average radiance over any box of a patch,
weighted by solid angle, from four corners. The tables are float64, because sums of a sun beside
darkness cancel.

Examples
--------
>>> light = PatchLight(Environment.uniform(2.0), Hemicube(patches=2))
>>> u0, u1 = np.array([0.2]), np.array([0.5])
>>> light.box(0, u0, u1, u0, u1).round(6).tolist()
[[2.0, 2.0, 2.0]]
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

    Parameters
    ----------
    environment : Environment
    hemicube : Hemicube
        Light from directions in which it has no patch is left out.
    resolution : int or (K,) int, optional
        Bins a side, of all patches or of each. By default a bin is about one texel of the map.
    """

    def __init__(
        self,
        environment: Environment,
        hemicube: Hemicube,
        resolution: int | NDArray[np.intp] | None = None,
    ) -> None:
        if resolution is None:
            resolution = default_resolution(hemicube, environment)
        self._begin(hemicube, resolution)
        height, width = environment.image.shape[:2]
        # flux and solid angle stand side by side, so that one look-up fetches all four
        self._flat = np.zeros((int(self._offsets[-1]), 4))
        for some in sample_bins(hemicube, height, width, self.resolutions, self._offsets):
            self._collect(environment.image[some.rows], some, environment.turn)
        self._fill_empty(environment)

    @staticmethod
    def of_bins(
        hemicube: Hemicube, resolutions: NDArray[np.intp], bins: NDArray[np.float64]
    ) -> PatchLight:
        """Make a light of bins that are known already.

        Parameters
        ----------
        hemicube : Hemicube
        resolutions : (K,) int
            Bins a side of each patch.
        bins : (n, 4) float64
            Flux of red, green and blue, and solid angle: patch by patch, row by row of v. No solid
            angle is 0.

        Returns
        -------
        PatchLight
        """
        out = PatchLight.__new__(PatchLight)
        out._begin(hemicube, resolutions)
        out._flat = bins
        return out

    def _begin(self, hemicube: Hemicube, resolution: int | NDArray[np.intp]) -> None:
        self.hemicube = hemicube
        self.resolutions = np.full(len(hemicube), resolution, np.intp)
        # where the bins of each patch begin, and where its table of sums, one row and column larger
        self._offsets = _starts(self.resolutions**2)
        self._tables = _starts((self.resolutions + 1) ** 2)
        self._lock = Lock()
        self._polynomials: dict[tuple[int, ...], NDArray[np.float64]] = {}
        self._sums: NDArray[np.float64] | None = None

    @property
    def _sat(self) -> NDArray[np.float64]:
        """The tables of sums. Only boxes need them, so the first box makes them."""
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
        """Bins a side of a patch, where all patches have the same; ValueError where they differ."""
        if (self.resolutions != self.resolutions[0]).any():
            raise ValueError("the patches differ in size, and so in bins: see `resolutions`")
        return int(self.resolutions[0])

    def bins_of(self, k: int) -> NDArray[np.float64]:
        """Give the bins of a patch.

        Parameters
        ----------
        k : int
            The number of the patch.

        Returns
        -------
        (r, r, 4) float64
            Flux of red, green and blue, and solid angle, row by row of v.
        """
        r = self.resolutions[k]
        return self._flat[self._offsets[k] : self._offsets[k + 1]].reshape(r, r, 4)

    @property
    def binned(self) -> NDArray[np.float64]:
        """(K, r, r, 4) float64: the bins of all patches, where all have the same number."""
        r = self.resolution
        return self._flat.reshape(-1, r, r, 4)

    def _fill_empty(self, environment: Environment) -> None:
        """Give a bin without samples the radiance of the texel behind its middle, with a tiny
        weight.

        A thin box that sees nothing but this bin then finds light there.
        """
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
        """(K, 3) float64: the average radiance of each patch."""
        total = np.add.reduceat(self._flat, self._offsets[:-1])
        return total[:, :3] / total[:, 3:]

    @property
    def spread(self) -> float:
        """How much of the sphere an even light of the same noise would fill, 0 to 1.

        A capture spreads its samples over all patches, and those of dark patches bring nothing. The
        variance of a sum of patches goes by the mean of the light's squares. So this is the square
        of the light's mean over the mean of the light's squares; 0 without light.
        """
        radiance = np.maximum(self.whole, 0).sum(axis=-1)
        solid_angles = self.hemicube.solid_angles
        squares = float(solid_angles @ radiance**2)
        sphere = 4 * np.pi
        return float(solid_angles @ radiance) ** 2 / (sphere * squares) if squares > 0 else 0.0

    def bin_centres(self, k: int) -> tuple[NDArray, NDArray]:
        """Compute the centres of a patch's bins.

        Parameters
        ----------
        k : int
            The number of the patch.

        Returns
        -------
        u, v : (r,) float64
            Patch coordinates along u and along v.
        """
        return bin_centres(self.hemicube, k, int(self.resolutions[k]))

    def polynomial(self, which: tuple[int, ...]) -> NDArray[np.float64]:
        """Fit a polynomial in u, v to the light of each patch, by least squares over solid angle.

        Light that is such a polynomial is reproduced exactly. The pixel is then exact too, because
        it is a sum of moments.

        Parameters
        ----------
        which : tuple of int
            The monomials, as indices into `patterns.MONOMIALS`.

        Returns
        -------
        (K, len(which), 3) float64
            The coefficients.
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
        """Average the radiance over boxes of a patch, weighted by solid angle.

        A box thinner than a bin is widened to one bin, because the bins hold no finer light.

        Parameters
        ----------
        k : int or (n,) int
            The numbers of the patches.
        u0, u1, v0, v1 : (n,) float
            Edges in patch coordinates, 0 to 1.

        Returns
        -------
        (n, 3) float64
            Scene-linear radiance.

        Source
        ------
        Paper 6.
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
        total = self._sums_between(k, i0, i1, j0, j1)
        return total[:, :3] / total[:, 3:]

    def point(self, k: int | NDArray, u: NDArray, v: NDArray) -> NDArray[np.float64]:
        """Average the light of a patch over boxes that are no wider than a bin, see `box`.

        Parameters
        ----------
        k : int or (n,) int
            The numbers of the patches.
        u, v : (n,) float
            The middles of the boxes, in patch coordinates.

        Returns
        -------
        (n, 3) float64
            Scene-linear radiance.
        """
        r = self.resolutions[k]
        i, fi = _between(bin_coordinate(self.hemicube, k, u, 0, r), r)
        j, fj = _between(bin_coordinate(self.hemicube, k, v, 1, r), r)
        flat, right = self._flat, np.minimum(1, r - 1)
        at, up = self._offsets[k] + j * r + i, r * right
        total: NDArray[np.float64] = flat.take(at, axis=0)
        total *= ((1 - fi) * (1 - fj))[:, None]
        total += flat.take(at + right, axis=0) * (fi * (1 - fj))[:, None]
        total += flat.take(at + up, axis=0) * ((1 - fi) * fj)[:, None]
        total += flat.take(at + up + right, axis=0) * (fi * fj)[:, None]
        return total[:, :3] / total[:, 3:]

    def _sums_between(
        self, k: int | NDArray, i0: NDArray, i1: NDArray, j0: NDArray, j1: NDArray
    ) -> NDArray[np.float64]:
        """The sums (n, 4) over boxes in bin coordinates.

        Between its entries the table is read bilinearly, which is exact for light that is constant
        in a bin.
        """
        n, r, table = len(i0), self.resolutions[k], self._sat
        # all four corners at once: so short are most boxes' arrays that each call has its price
        corners = np.concatenate([i0, i1, i0, i1, j0, j0, j1, j1]).reshape(2, 4, n)
        whole = np.minimum(corners.astype(np.intp), r - 1)
        fi, fj = (corners - whole)[..., None]
        row = r + 1
        at = self._tables[k] + whole[1] * row + whole[0]
        low, high = table.take(at, axis=0), table.take(at + row, axis=0)
        for side, first in ((low, at + 1), (high, at + row + 1)):
            step = table.take(first, axis=0)
            step -= side
            step *= fi
            side += step
        high -= low
        high *= fj
        low += high
        total: NDArray[np.float64] = low[3] - low[2]
        total -= low[1]
        total += low[0]
        return total


def _turned(samples: NDArray, turn: float) -> NDArray:
    """What the cells of a map (rows, columns) see of the turned map: its mean over each cell.

    The cells keep their bins, so that those need not be computed again.
    """
    shift = turn / (2 * np.pi) * samples.shape[1]
    whole = int(np.floor(shift))
    part = shift - whole
    if part < 1e-6 or part > 1 - 1e-6:
        return np.roll(samples, round(shift), axis=1) if round(shift) else samples
    out = (1 - part) * np.roll(samples, whole, axis=1)
    out += part * np.roll(samples, whole + 1, axis=1)
    return out


def _starts(sizes: NDArray) -> NDArray[np.intp]:
    """Where each of some runs begins, and where the last one ends, (K + 1,)."""
    return np.concatenate([[0], np.cumsum(sizes)]).astype(np.intp)


def _between(at: NDArray, r: NDArray | int) -> tuple[NDArray[np.intp], NDArray]:
    """The lower of the two bins that a bin's width about a coordinate meets, and how much of it is
    in the other."""
    at = np.minimum(np.maximum(at - 0.5, 0), r - 1)
    low = np.minimum(at.astype(np.intp), np.maximum(r - 2, 0))
    return low, at - low


def _at_least_one_bin(low: NDArray, high: NDArray, r: NDArray | int) -> tuple[NDArray, NDArray]:
    low, high = np.minimum(np.maximum(low, 0), r), np.minimum(np.maximum(high, 0), r)
    centre = np.minimum(np.maximum((low + high) / 2, 0.5), r - 0.5)
    thin = high - low < 1
    return np.where(thin, centre - 0.5, low), np.where(thin, centre + 0.5, high)
