"""Moments: what the basis images of a patch say about how its light reaches the pixels.

For the transport T(u, v) from a patch to a pixel, moment m is the integral of T times the m-th of
`patterns.MONOMIALS`. The zeroth moment is the reflection coefficient R (paper 3). The others,
divided by it, are the mean place on the patch that the pixel sees, and its spread. T includes the
solid angle: a patch that is seen evenly has the moments `Moments.uniform`, which differ from the
moments of its area.

Examples
--------
>>> from arto.core.patterns import pattern_set
>>> basis = np.array([0.4, 0.1, 0.08])[:, None, None] * np.ones((1, 1, 3))  # white, u, v
>>> found = Moments.from_basis(basis, pattern_set("linear"), (-1.0, 1.0, -1.0, 1.0))
>>> [round(float(x[0]), 3) for x in found.mean]
[0.25, 0.2]
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..measure import Extent, uniform_moments
from ..patterns import ONE, UU, UV, VV, PatternSet, U, V


@dataclass(frozen=True)
class Moments:
    """The moments of n pixels for one patch.

    Parameters
    ----------
    coefficient : (n, 3) float
        The reflection coefficient R of each channel.
    normalised : (6, n) float64
        The moments over the zeroth, shared by the channels. NaN where the patterns do not identify
        them; those of an evenly seen patch where a pixel gets no light from it.
    extent : tuple of 4 float
        The place of the patch on its face, which determines its density of solid angle.
    channels : tuple of Moments
        The moments of red, green and blue alone, if they were asked for.
    """

    coefficient: NDArray
    normalised: NDArray
    extent: Extent
    channels: tuple[Moments, ...] = ()

    @staticmethod
    def from_basis(
        basis: NDArray, patterns: PatternSet, extent: Extent, per_channel: bool = False
    ) -> Moments:
        """Compute the moments from basis images. The channels share a support, as in the paper (5).

        Parameters
        ----------
        basis : (P, n, 3) float
            Basis images of the patch, scene-linear radiance.
        patterns : PatternSet
        extent : tuple of 4 float
            The place of the patch, see `Hemicube.extent`.
        per_channel : bool
            Whether to compute `channels` too.

        Returns
        -------
        Moments
        """
        # float64: a narrow support is a small difference of large moments
        shared = patterns.shared(basis, uniform_moments(extent))
        coefficient = patterns.coefficient(basis)
        channels: tuple[Moments, ...] = ()
        if per_channel:
            each = (patterns.moments(basis[..., c].astype(np.float64)) for c in range(3))
            channels = tuple(Moments(coefficient, normalise(m, extent), extent) for m in each)
        return Moments(coefficient, normalise(shared, extent), extent, channels)

    def select(self, pixels: NDArray) -> Moments:
        """Take the moments of some pixels.

        Parameters
        ----------
        pixels : (n,) bool or (m,) int

        Returns
        -------
        Moments
        """
        return Moments(
            self.coefficient[pixels],
            self.normalised[:, pixels],
            self.extent,
            tuple(c.select(pixels) for c in self.channels),
        )

    def spread(self, spreads: NDArray, where: NDArray[np.bool_]) -> Moments:
        """Give some of the pixels another spread.

        Parameters
        ----------
        spreads : (3, n) float
            The variances along u and v, and the covariance. They are held within what a transport
            of the pixel's mean can have.
        where : (n,) bool
            The pixels that get them.

        Returns
        -------
        Moments
        """
        out = self.normalised.copy()
        for mean, square, variance in zip((U, V), (UU, VV), spreads[:2], strict=True):
            middle = out[mean][where]
            room = middle * (1 - middle)
            out[square][where] = middle**2 + np.clip(variance[where], 0, room)
        # a covariance is at most the root of both variances
        u, v = out[U][where], out[V][where]
        most = np.sqrt((out[UU][where] - u * u) * (out[VV][where] - v * v))
        out[UV][where] = u * v + np.clip(spreads[2][where], -most, most)
        return replace(self, normalised=out)

    @property
    def uniform(self) -> NDArray[np.float64]:
        """(6,) float64: the normalised moments of a pixel that sees the whole patch evenly."""
        return uniform_moments(self.extent)

    @cached_property
    def mean(self) -> tuple[NDArray, NDArray]:
        """The mean place on the patch that a pixel sees: u and v, each (n,)."""
        return self.normalised[U], self.normalised[V]

    @cached_property
    def variance(self) -> tuple[NDArray, NDArray]:
        """The variances along u and v, each (n,), at least 0."""
        mu, mv = self.mean
        return (
            np.maximum(self.normalised[UU] - mu * mu, 0),
            np.maximum(self.normalised[VV] - mv * mv, 0),
        )

    @cached_property
    def covariance(self) -> NDArray:
        """(n,): the covariance of u and v."""
        mu, mv = self.mean
        return self.normalised[UV] - mu * mv


def normalise(moments: NDArray, extent: Extent) -> NDArray:
    """Divide moments by the zeroth, and keep them within what a transport on [0, 1]^2 can have.

    Parameters
    ----------
    moments : (6, n) float64
    extent : tuple of 4 float
        The place of the patch on its face.

    Returns
    -------
    (6, n) float64
        Those of an evenly seen patch where there is no light.
    """
    total = moments[ONE]
    # moments that are not finite are no evidence of a support
    lit = (total > 0) & np.isfinite(moments[[ONE, U, V]]).all(axis=0)
    out = moments / np.where(lit, total, 1)
    out[:, ~lit] = uniform_moments(extent)[:, None]
    out[[U, V]] = np.clip(out[[U, V]], 0, 1)
    for mean, square in ((U, UU), (V, VV)):
        # 0 <= u <= 1, so E[u]^2 <= E[u^2] <= E[u]
        out[square] = np.clip(out[square], out[mean] ** 2, out[mean])
    out[UV] = np.clip(out[UV], np.maximum(out[U] + out[V] - 1, 0), np.minimum(out[U], out[V]))
    return out
