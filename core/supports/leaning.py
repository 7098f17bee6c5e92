"""The leaning bell: a bell whose long axis is aslant on the patch.

A pixel of a curved mirror sees a slanted, narrow piece of the world, and so does the lobe of a
glossy surface at a grazing angle. A bell that lies along u and v has the right spread along each,
and shows what is beside the slant. A row of three bells along it has the covariance as well.

Examples
--------
The bells of a slant, their middles in a row and each narrower than the whole:

>>> u, across, v, along = row_of(np.array([[0.5, 0.1, 0.5, 0.1, 0.9]])).reshape(3, 4).T
>>> u.round(3).tolist(), v.round(3).tolist()
([0.437, 0.5, 0.563], [0.437, 0.5, 0.563])
>>> across.round(3).tolist()
[0.045, 0.045, 0.045]

Their mean variance, with that of their middles, is the bell's:

>>> round(float(u.var() + (across**2).mean() / 3), 6), round(0.1**2 / 3, 6)
(0.003333, 0.003333)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..capture.moments import Moments
from ..light.light import PatchLight
from ..patterns import ONE, UU, UV, VV, U, V
from .bell import Bell, bells_of

# Correlation from which on a bell leans. Below it what a row adds is less than the noise of it.
LEANS = 0.3
# The bells of a row stand so many deviations from its middle: their variance is 1.
PLACES = np.array([-np.sqrt(1.5), 0.0, np.sqrt(1.5)])
# Bells that are still less round than this leave gaps between them.
MOST = 0.95

_BELL = Bell()


class Leaning:
    """The leaning bell model; parameters are those of the bell, and (correlation + 1) / 2."""

    name = "leaning"
    code = 10
    parameters: tuple[str, ...] = (*Bell.parameters, "tilt")
    needs: tuple[int, ...] = (ONE, U, UU, V, VV, UV)

    def fit(self, moments: Moments) -> NDArray:
        bells = bells_of(moments.mean, moments.variance, moments.extent)
        return np.concatenate([bells, (correlation(moments)[:, None] + 1) / 2], axis=-1)

    def average(self, light: PatchLight, k: int | NDArray, parameters: NDArray) -> NDArray:
        # what a bin of the light holds has no slant
        widest = 2 * np.sqrt(1.5) * parameters[:, [1, 3]].max(axis=-1).astype(np.float64)
        wide = widest * light.resolutions[k] >= 1
        several = isinstance(k, np.ndarray)
        out = np.empty((len(parameters), 3))
        thin = ~wide
        out[thin] = _BELL.average(light, k[thin] if several else k, parameters[thin, :4])
        row = row_of(parameters[wide])
        of = np.repeat(k[wide], len(PLACES)) if several else k
        found = _BELL.average(light, of, row.reshape(-1, 4))
        out[wide] = found.reshape(-1, len(PLACES), 3).mean(axis=1)
        return out

    def plane(self, light: PatchLight, k: int) -> None:
        return None


def correlation(moments: Moments) -> NDArray[np.float64]:
    """Compute the correlation of u and v.

    Parameters
    ----------
    moments : Moments
        Of n pixels.

    Returns
    -------
    (n,) float64
        -1 to 1; 0 where there is no spread.
    """
    product = np.sqrt(moments.variance[0] * moments.variance[1])
    some = product > 1e-12
    out = np.where(some, moments.covariance, 0) / np.where(some, product, 1)
    return np.clip(out, -1, 1)


def row_of(parameters: NDArray) -> NDArray[np.float64]:
    """Find the bells that a leaning bell is made of.

    Parameters
    ----------
    parameters : (n, 5) float

    Returns
    -------
    (n, 3, 4) float64
        Their parameters. Together they have the mean, the variances and the covariance, as far as
        the middles stay on the patch.
    """
    u, across, v, along, tilt = parameters.astype(np.float64).T
    slant = np.clip(2 * tilt - 1, -MOST, MOST)
    steps = np.sqrt(np.abs(slant) / 3)
    far = PLACES[-1] * steps
    room = np.minimum(
        np.minimum(u, 1 - u) / np.maximum(far * across, 1e-12),
        np.minimum(v, 1 - v) / np.maximum(far * along, 1e-12),
    )
    steps = steps * np.minimum(room, 1)
    narrower = np.sqrt(1 - 3 * steps * steps)
    out = np.empty((len(parameters), len(PLACES), 4))
    out[..., 0] = u[:, None] + np.multiply.outer(steps * across, PLACES)
    out[..., 1] = (across * narrower)[:, None]
    out[..., 2] = v[:, None] + np.multiply.outer(steps * along * np.sign(slant), PLACES)
    out[..., 3] = (along * narrower)[:, None]
    return out
