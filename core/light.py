"""Light on the patches: an environment map made ready for evaluating supports (paper 6).

Every patch gets a small grid of bins, equal in angle, that collects the map's flux and the solid
angle it came from. Summed-area tables of both (float64: a sun beside darkness cancels) then give
the average radiance over any box of a patch, weighted by solid angle, from four corners.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .environment import Environment, sample_directions
from .hemicube import Hemicube
from .patterns import monomials

_CACHE: dict[tuple, tuple[NDArray, NDArray]] = {}


def default_resolution(hemicube: Hemicube, environment: Environment) -> int:
    """Bins a patch side: about one texel of the map each, at least 4."""
    return max(4, environment.image.shape[1] // (4 * hemicube.patches))


def _bins(hemicube: Hemicube, height: int, width: int, resolution: int) -> tuple[NDArray, NDArray]:
    """Bin of every sample of a map of that size (-1: no patch), and each sample's solid angle.

    The same for every map of a size, so the last one is kept: turning through HDRIs is common.
    """
    key = (hemicube, height, width, resolution)
    if key in _CACHE:
        return _CACHE[key]
    # two samples a bin and axis on average; a narrow bin may still stay empty
    finer = max(1, int(np.ceil(8 * resolution * hemicube.patches / width)))
    azimuth, latitude, weight = sample_directions(height, width, finer)
    # float64: float32 moves a sample on a patch's border to the other side
    bins = np.empty((height * finer, width * finer), np.int32)

    def fill(row: int) -> None:
        part = latitude[row : row + 64]
        d = np.empty((len(part), len(azimuth), 3))
        d[..., :2] = np.cos(part)[:, None, None] * azimuth
        d[..., 2] = np.sin(part)[:, None]
        k, u, v = hemicube.locate(d)
        i = bin_coordinate(hemicube, k, u, 0, resolution).astype(np.int32)
        j = bin_coordinate(hemicube, k, v, 1, resolution).astype(np.int32)
        np.clip(i, 0, resolution - 1, out=i)
        np.clip(j, 0, resolution - 1, out=j)
        bins[row : row + 64] = np.where(k < 0, -1, (k * resolution + j) * resolution + i)

    with ThreadPoolExecutor() as pool:
        list(pool.map(fill, range(0, len(latitude), 64)))
    _CACHE.clear()
    _CACHE[key] = (bins, weight)
    return _CACHE[key]


def bin_coordinate(hemicube: Hemicube, k: NDArray | int, t: NDArray, axis: int, r: int) -> NDArray:
    """Patch coordinate (0..1) -> bin coordinate (0..r), where bins are equal in angle."""
    low = hemicube.extents[k, 2 * axis]
    high = hemicube.extents[k, 2 * axis + 1]
    start = np.arctan(low)
    return (np.arctan(low + (high - low) * t) - start) * (r / (np.arctan(high) - start))


class PatchLight:
    """An environment map as the patches of a hemicube see it.

    resolution: bins a patch side (default: about one texel of the map). Directions without a patch
    (a hemicube without a bottom, say) give no light.
    """

    def __init__(
        self, environment: Environment, hemicube: Hemicube, resolution: int | None = None
    ) -> None:
        self.hemicube = hemicube
        self.resolution = r = resolution or default_resolution(hemicube, environment)
        height, width = environment.image.shape[:2]
        bins, weight = _bins(hemicube, height, width, r)
        finer = bins.shape[0] // height
        lit = bins.ravel() >= 0
        index = bins.ravel()[lit]
        solid_angle = np.repeat(weight, bins.shape[1])[lit]
        size = len(hemicube) * r * r
        # flux and solid angle side by side: one look-up fetches all four
        self.binned = np.empty((len(hemicube), r, r, 4))
        flat = self.binned.reshape(size, 4)
        flat[:, 3] = np.bincount(index, solid_angle, size)
        for c in range(3):
            texels = environment.image[..., c]
            samples = np.repeat(np.repeat(texels, finer, axis=0), finer, axis=1).ravel()[lit]
            flat[:, c] = np.bincount(index, samples * solid_angle, size)
        self._fill_empty(environment)
        self._polynomials: dict[tuple[int, ...], NDArray[np.float64]] = {}
        self.sat = np.zeros((len(hemicube), r + 1, r + 1, 4))
        np.cumsum(self.binned, axis=1, out=self.sat[:, 1:, 1:])
        np.cumsum(self.sat[:, 1:, 1:], axis=2, out=self.sat[:, 1:, 1:])

    def _fill_empty(self, environment: Environment) -> None:
        """A bin that no sample met takes the texel behind its middle, with next to no weight, so
        that a thin box that sees it alone finds light there."""
        for k in np.unique(np.nonzero(self.binned[..., 3] == 0)[0]):
            j, i = np.nonzero(self.binned[k, ..., 3] == 0)
            u, v = self.bin_centres(k)
            solid_angle = 1e-3 * self.hemicube.solid_angles[k] / self.resolution**2
            light = environment.at(self.hemicube.directions(k, u[i], v[j]))
            self.binned[k, j, i, :3] = light * solid_angle
            self.binned[k, j, i, 3] = solid_angle

    @cached_property
    def whole(self) -> NDArray[np.float64]:
        """(K, 3): average radiance of each patch."""
        total = self.sat[:, -1, -1]
        return total[:, :3] / total[:, 3:]

    def bin_centres(self, k: int) -> tuple[NDArray, NDArray]:
        """Patch coordinates of the bins' centres along u and along v -> (r,), (r,)."""
        x = self.hemicube.extents[k]
        mid = (np.arange(self.resolution) + 0.5) / self.resolution
        out = []
        for low, high in ((x[0], x[1]), (x[2], x[3])):
            angle = np.arctan(low) + (np.arctan(high) - np.arctan(low)) * mid
            out.append((np.tan(angle) - low) / (high - low))
        return out[0], out[1]

    def polynomial(self, which: tuple[int, ...]) -> NDArray[np.float64]:
        """The polynomial in u, v nearest to each patch's light, by solid angle.

        which: indices into `patterns.MONOMIALS` -> coefficients (K, len(which), 3). Light that is
        such a polynomial is met exactly, and so then is the pixel: it is a sum of moments.
        """
        if which not in self._polynomials:
            out = np.empty((len(self.hemicube), len(which), 3))
            for k in range(len(self.hemicube)):
                u, v = self.bin_centres(k)
                m = monomials(u[None, :], v[:, None])[list(which)].reshape(len(which), -1)
                light = self.binned[k].reshape(-1, 4)
                gram = (m * light[:, 3]) @ m.T
                out[k] = np.linalg.solve(gram, m @ light[:, :3])
            self._polynomials[which] = out
        return self._polynomials[which]

    def box(
        self, k: int | NDArray, u0: NDArray, u1: NDArray, v0: NDArray, v1: NDArray
    ) -> NDArray[np.float64]:
        """Average radiance over boxes of patch k, weighted by solid angle -> (n, 3).

        u0..v1: (n,) edges in patch coordinates, inside [0, 1]. A box thinner than a bin is widened
        to one: the map holds no finer light.
        """
        r = self.resolution
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
        r = self.resolution
        table = self.sat.reshape(-1, 4)
        a = np.minimum(i.astype(np.int64), r - 1)
        b = np.minimum(j.astype(np.int64), r - 1)
        fi = (i - a)[:, None]
        fj = (j - b)[:, None]
        at = (np.asarray(k, np.int64) * (r + 1) + b) * (r + 1) + a
        low = table[at]
        low += fi * (table[at + 1] - low)
        high = table[at + r + 1]
        high += fi * (table[at + r + 2] - high)
        high -= low
        high *= fj
        low += high
        return low


def _at_least_one_bin(low: NDArray, high: NDArray, r: int) -> tuple[NDArray, NDArray]:
    low, high = np.clip(low, 0, r), np.clip(high, 0, r)
    centre = np.clip((low + high) / 2, 0.5, r - 0.5)
    thin = high - low < 1
    return np.where(thin, centre - 0.5, low), np.where(thin, centre + 0.5, high)
