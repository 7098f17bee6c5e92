"""What of a field is smooth: its entries without its lobes, as planes over patches.

Every entry is brought to a coefficient and a mean place on its patch, by channel. This is all of an
entry of the linear model, and enough of a wide support of another model. Narrow supports are
gathered into lobes before.

Examples
--------
>>> patches = Patches.of(Hemicube(patches=1), 32)
>>> sky = np.full((32 * 32, 3), 2.0, np.float32)
>>> np.abs(patches.planes(sky)[0]).round(6).tolist()  # level and slopes, by channel
[[2.0, 2.0, 2.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from dataclasses import field as made

import numpy as np
from numpy.typing import NDArray

from ..field.field import Field
from ..field.tile import Tile
from ..hemicube import Hemicube
from ..light.environment import Environment
from ..light.light import PatchLight
from ..patterns import U, V
from ..supports import LINEAR, WHOLE
from . import sphere
from .lobes import MOST, Lobes, Narrow, gathered, narrow_of
from .neighbours import accompanied

# A plane is fitted to the samples on a patch if they spread at least so far, as a share of what
# even samples would; else the level alone counts.
FLAT = 1e-3


@dataclass(frozen=True)
class Patches:
    """The patches of a hemicube on a square of directions, and planes of light on them.

    Parameters
    ----------
    side : int
        Of the square, see `sphere`.
    frames : (K, 3, 3) float64
        For each patch three vectors c, a and b. A direction d is at u = a.d / c.d and v = b.d / c.d
        on the patch.
    at : (side * side,) int
        The patch of each direction, -1 for none.
    monomials : (3, side * side) float64
        1, u and v of each direction.
    gram : (K, 3, 3) float64
        For each patch the integrals of their products over solid angle.
    """

    side: int
    frames: NDArray[np.float64]
    at: NDArray[np.intp]
    monomials: NDArray[np.float64] = made(repr=False)
    gram: NDArray[np.float64] = made(repr=False)

    @staticmethod
    def of(hemicube: Hemicube, side: int) -> Patches:
        """Lay the patches of a hemicube on the square.

        Parameters
        ----------
        hemicube : Hemicube
        side : int

        Returns
        -------
        Patches
        """
        frames = np.empty((len(hemicube), 3, 3))
        for k, (face, _, _) in enumerate(hemicube.grid):
            centre, right, up = hemicube.frame(face)
            x0, x1, y0, y1 = hemicube.extents[k]
            frames[k] = centre, (right - x0 * centre) / (x1 - x0), (up - y0 * centre) / (y1 - y0)
        at = hemicube.locate(sphere.directions(side))[0].ravel().astype(np.intp)
        return Patches.laid(side, frames.astype(np.float32), at)

    @staticmethod
    def laid(side: int, frames: NDArray, at: NDArray[np.intp]) -> Patches:
        """Make patches of what a file says of them.

        Parameters
        ----------
        side : int
        frames : (K, 3, 3) float
        at : (side * side,) int

        Returns
        -------
        Patches
        """
        around = sphere.directions(side).reshape(-1, 3)
        of = frames.astype(np.float64)[np.maximum(at, 0)]
        depth, u, v = np.einsum("nij,nj->in", of, around)
        monomials = np.stack([np.ones(len(at)), u / depth, v / depth])
        omega = np.where(at < 0, 0, sphere.solid_angles(side).ravel())
        gram = np.empty((len(frames), 3, 3))
        for i in range(3):
            for j in range(3):
                weights = monomials[i] * monomials[j] * omega
                gram[:, i, j] = np.bincount(np.maximum(at, 0), weights, len(frames))
        gram[:, 0, 0] = np.maximum(gram[:, 0, 0], 1e-12)
        # few samples in a row tell no slope
        mean = gram[:, 0, 1:] / gram[:, :1, 0]
        spread = gram[:, 1:, 1:] / gram[:, :1, :1] - mean[:, :, None] * mean[:, None]
        flat = np.linalg.det(spread) < FLAT / 144
        gram[flat, 1:] = gram[flat, :, 1:] = 0
        gram[flat, 1, 1] = gram[flat, 2, 2] = 1e12
        return Patches(side, frames.astype(np.float64), at, monomials, gram)

    def planes(self, light: NDArray) -> NDArray[np.float64]:
        """Fit planes to the light of the patches, by least squares over solid angle.

        Parameters
        ----------
        light : (side * side, 3) float
            Radiance in the directions of the square.

        Returns
        -------
        (K, 3, 3) float64
            For each patch the level at u = v = 0 and the slopes along u and v, by channel.
        """
        omega = np.where(self.at < 0, 0, sphere.solid_angles(self.side).ravel())
        at = np.maximum(self.at, 0)
        sums = np.stack(
            [
                [np.bincount(at, m * omega * light[:, c], len(self.frames)) for c in range(3)]
                for m in self.monomials
            ]
        ).transpose(2, 0, 1)
        flat = self.gram[:, 1, 1] >= 1e12
        sums[flat, 1:] = 0
        return np.linalg.solve(self.gram, sums)


@dataclass(frozen=True)
class Entries:
    """Smooth entries of a patch in a block.

    Parameters
    ----------
    k : int
    pixels : (n,) int
        Counted from the block's first.
    light : (n, 3) float32
        The reflection coefficients.
    places : (n, 3, 2) float32
        The mean u and v, by channel.
    """

    k: int
    pixels: NDArray[np.intp]
    light: NDArray[np.float32]
    places: NDArray[np.float32]


class Block:
    """A block of a field's pixels, taken apart.

    Parameters
    ----------
    field : Field
    tile : Tile
    block : int
    places : dict of PatchLight
        Light that says where on a patch a support is, see `place_lights`.
    """

    def __init__(
        self, field: Field, tile: Tile, block: int, places: tuple[PatchLight, PatchLight]
    ) -> None:
        self.tile, self.where = tile, tile.blocks[block]
        self._block, self._hemicube, self._places = block, field.hemicube, places
        self.pixels = self.where.stop - self.where.start
        r = tile.region
        rows, columns = np.divmod(np.arange(self.where.start, self.where.stop), r.width)
        # where the pixels are in the picture
        self.at = (rows + r.y) * field.shape[1] + columns + r.x
        narrow, groups = narrow_of(field.hemicube, tile, block)
        self._ones = tile.ones(self.where)
        self.total = self._white_of_all()
        self.lobes, left = self._gather(narrow)
        self._left = {(i, k): left[where] for i, k, where in groups}
        self.white = self.total.copy()
        for lobe in self.lobes:
            self.white[lobe.pixels] -= lobe.colour
        self.white = np.maximum(self.white, 0)

    def _gather(self, narrow: Narrow) -> tuple[list[Lobes], NDArray[np.bool_]]:
        if not len(narrow.pixels):
            return [], np.zeros(0, bool)
        white = self.total.mean(axis=-1)
        lobes, _ = gathered(narrow, self.pixels, white, MOST)
        width = self.tile.region.width
        first = self.where.start % width
        rows = -(-(first + self.pixels) // width)
        there = np.zeros(rows * width, bool)
        for lobe in lobes:
            there[first + lobe.pixels] = True
        company = accompanied(there.reshape(rows, width)).ravel()[first : first + self.pixels]
        return gathered(narrow, self.pixels, white, MOST, company)

    def _white_of_all(self) -> NDArray[np.float64]:
        """What the pixels show in a light of radiance 1, (n, 3)."""
        out = np.zeros((self.pixels, 3))
        for model in self.tile.models:
            for k in np.flatnonzero(model.counts[self._block]).tolist():
                at, pixels = model.at(self._block, k), model.pixels(self._block, k)
                out[pixels] += model.shares(at).T * self._ones[pixels]
        if self.tile.rest_weights is not None:
            out += self.tile.rest(self.where)
        return out

    def entries(self) -> Iterator[Entries]:
        """Give the smooth entries, model by model and patch by patch.

        Yields
        ------
        Entries
        """
        for i, model in enumerate(self.tile.models):
            code = model.support.code
            for k in np.flatnonzero(model.counts[self._block]).tolist():
                at, pixels = model.at(self._block, k), model.pixels(self._block, k)
                given, shares = model.parameters_of(at), model.shares(at).T
                if (i, k) in self._left:
                    left = self._left[i, k]
                    if not left.any():
                        continue
                    given, shares, pixels = given[left], shares[left], pixels[left]
                if code == LINEAR.code:
                    places = np.repeat(given[:, None], 3, axis=1)
                elif code == WHOLE.code:
                    mean = self._hemicube.uniform_moments(k)[[U, V]].astype(np.float32)
                    places = np.broadcast_to(mean, (len(pixels), 3, 2))
                else:
                    means = [model.support.average(p, k, given) for p in self._places]
                    places = np.stack(means, axis=-1).astype(np.float32)
                yield Entries(k, pixels, shares * self._ones[pixels], places)

    def rest(self) -> tuple[NDArray[np.float32], NDArray[np.float32]] | None:
        """Give what was too small to be an entry, see `Tile.rest`.

        Returns
        -------
        (n, 3) float32 and (K, n) float32, or None
            Its coefficients, and which share of them each patch has. None where there is none.
        """
        weights = self.tile.rest_weights
        if weights is None:
            return None
        packed = self.tile.rest_patches[:, self.where]
        bits = np.unpackbits(packed, axis=0, count=self.tile.patches, bitorder="little")
        share = bits * weights[:, None].astype(np.float32)
        total = share.sum(axis=0)
        np.divide(share, total, out=share, where=total > 0)
        return self.tile.rest(self.where), share


def place_lights(hemicube: Hemicube) -> tuple[PatchLight, PatchLight]:
    """Make light that is u, and light that is v, on every patch.

    Parameters
    ----------
    hemicube : Hemicube

    Returns
    -------
    pair of PatchLight
    """
    plain = PatchLight(Environment.uniform(1.0, 128), hemicube, 16)
    bins = plain.binned
    out = []
    for axis in range(2):
        light = bins.copy()
        for k in range(len(hemicube)):
            u, v = plain.bin_centres(k)
            light[k, ..., :3] *= (u[None, :] if axis == 0 else v[:, None])[..., None]
        out.append(PatchLight.of_bins(hemicube, plain.resolutions, light.reshape(-1, 4)))
    return out[0], out[1]


def blocks(field: Field) -> Iterator[Block]:
    """Take a field apart, block by block.

    Parameters
    ----------
    field : Field

    Yields
    ------
    Block

    Raises
    ------
    FieldError
        The field is damaged.
    """
    places = place_lights(field.hemicube)
    for tile in field.tiles:
        tile.open()
        for block in range(len(tile.blocks)):
            yield Block(field, tile, block, places)
