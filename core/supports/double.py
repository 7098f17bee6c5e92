"""Two components in one patch: a uniform one (the base) and a narrow box (the coat).

With share x of the light in the box, the deviation of the mean from the patch's centre is x times
that of the box's centre, and the covariance of u and v is (1 - x) x times the product of the box
centre's deviations. So x = 1 / (1 + C / (d_u d_v)), and the box follows from what is left of the
second moments. A box on either middle line of the patch has C = 0 and d = 0 there: five numbers
from four then, and the single box is what comes out (docs/identifiability.md).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..light import PatchLight
from ..moments import Moments
from ..patterns import ONE, UU, UV, VV, U, V

# Under this the product of the mean's deviations says nothing about the shares.
_LEAST_DEVIATION = 1e-4


class Double:
    name = "double"
    code = 7
    parameters: tuple[str, ...] = ("share", "u0", "u1", "v0", "v1")
    needs: tuple[int, ...] = (ONE, U, UU, V, VV, UV)

    def fit(self, moments: Moments) -> NDArray:
        (mu, mv), covariance = moments.mean, moments.covariance
        du, dv = mu - 0.5, mv - 0.5
        product = du * dv
        tells = np.abs(product) > _LEAST_DEVIATION
        ratio = np.where(tells, covariance / np.where(tells, product, 1), 0)
        share = 1 / (1 + np.maximum(ratio, 0))
        # the box's centre must be on the patch
        share = np.clip(np.maximum(share, 2 * np.maximum(np.abs(du), np.abs(dv))), 1e-6, 1)
        edges = []
        for d, square in ((du, moments.normalised[UU]), (dv, moments.normalised[VV])):
            centre = 0.5 + d / share
            own = (square - (1 - share) / 3) / share
            half = np.sqrt(3 * np.maximum(own - centre * centre, 0))
            edges += [centre - half, centre + half]
        return np.clip(np.stack([share, *edges], axis=-1), 0, 1)

    def average(self, light: PatchLight, k: int, parameters: NDArray) -> NDArray:
        share, u0, u1, v0, v1 = parameters.astype(np.float64).T
        share = share[:, None]
        return share * light.box(k, u0, u1, v0, v1) + (1 - share) * light.whole[k]
