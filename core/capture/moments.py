"""Moments: what the basis images of one patch say about how its light reaches the pixels.

For the transport T(u, v) from a patch to a pixel, moment m is the integral of T times the m-th of
`patterns.MONOMIALS`. The zeroth is the reflection coefficient R (paper 3); the others over it are
the mean place on the patch that the pixel sees, and its spread. T has the solid angle in it: a
patch that is seen evenly has the moments `Moments.uniform`, which are not those of its area.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..measure import Extent, uniform_moments
from ..patterns import ONE, UU, UV, VV, PatternSet, U, V


@dataclass(frozen=True)
class Moments:
    """Moments of n pixels for one patch.

    coefficient: (n, 3) reflection coefficient R per channel. normalised: (6, n) moments shared by
    the channels, over the zeroth; NaN where the patterns cannot tell. A pixel without light from
    the patch has those of the whole patch. extent: where the patch is on its face, which says what
    its solid angle is. channels: the same for red, green and blue by themselves, where they were
    asked for.
    """

    coefficient: NDArray
    normalised: NDArray
    extent: Extent
    channels: tuple[Moments, ...] = ()

    @staticmethod
    def from_basis(
        basis: NDArray, patterns: PatternSet, extent: Extent, per_channel: bool = False
    ) -> Moments:
        """basis: (P, n, 3) -> the moments. The channels share a support, as in the paper (5).

        extent: of the patch, see `Hemicube.extent`; per_channel: also the moments of each channel
        by itself, in `channels`.
        """
        # float64: a narrow support is a small difference of large moments
        shared = patterns.moments(channel_sum(basis))
        coefficient = patterns.coefficient(basis)
        channels: tuple[Moments, ...] = ()
        if per_channel:
            each = (patterns.moments(basis[..., c].astype(np.float64)) for c in range(3))
            channels = tuple(Moments(coefficient, normalise(m, extent), extent) for m in each)
        return Moments(coefficient, normalise(shared, extent), extent, channels)

    def select(self, pixels: NDArray) -> Moments:
        """The moments of some of the pixels (a mask or indices)."""
        return Moments(
            self.coefficient[pixels],
            self.normalised[:, pixels],
            self.extent,
            tuple(c.select(pixels) for c in self.channels),
        )

    @property
    def uniform(self) -> NDArray[np.float64]:
        """(6,) normalised moments of a pixel that sees the whole patch evenly."""
        return uniform_moments(self.extent)

    @cached_property
    def mean(self) -> tuple[NDArray, NDArray]:
        """Centre of the light's origin on the patch, (u, v), each (n,)."""
        return self.normalised[U], self.normalised[V]

    @cached_property
    def variance(self) -> tuple[NDArray, NDArray]:
        """Variances along u and v, each (n,), not below 0."""
        mu, mv = self.mean
        return (
            np.maximum(self.normalised[UU] - mu * mu, 0),
            np.maximum(self.normalised[VV] - mv * mv, 0),
        )

    @cached_property
    def covariance(self) -> NDArray:
        """Covariance of u and v, (n,)."""
        mu, mv = self.mean
        return self.normalised[UV] - mu * mv


def channel_sum(images: NDArray) -> NDArray[np.float64]:
    """(..., 3) -> (...), the sum over channels; numpy's own is slow over an axis so short."""
    return images[..., 0].astype(np.float64) + images[..., 1] + images[..., 2]


def normalise(moments: NDArray, extent: Extent) -> NDArray:
    """(6, n) moments over the zeroth, held inside what any transport on [0, 1]^2 can have; those of
    the whole patch where there is no light."""
    total = moments[ONE]
    # what is not a number is no evidence of a support either
    lit = (total > 0) & np.isfinite(moments[[ONE, U, V]]).all(axis=0)
    out = moments / np.where(lit, total, 1)
    out[:, ~lit] = uniform_moments(extent)[:, None]
    out[[U, V]] = np.clip(out[[U, V]], 0, 1)
    for mean, square in ((U, UU), (V, VV)):
        # 0 <= u <= 1, so E[u]^2 <= E[u^2] <= E[u]
        out[square] = np.clip(out[square], out[mean] ** 2, out[mean])
    out[UV] = np.clip(out[UV], np.maximum(out[U] + out[V] - 1, 0), np.minimum(out[U], out[V]))
    return out
