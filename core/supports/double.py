"""Two components in one patch: a uniform one (the base) and a narrow box (the coat).

Let the box have the share x of the light. Then the mean deviates from the whole patch's mean by x
times the deviation of the box, and the covariance of u and v is

    C = (1 - x) C_patch + x C_box + (1 - x) / x d_u d_v

with the deviations d of the mean. The covariance of a box is nearly 0, so this is a quadratic
equation in x. (On a patch so small that its density is constant, C_patch is 0 too, and x = 1 / (1
+ C / (d_u d_v)).) The box follows from the rest of the second moments, and its own covariance then
corrects x.

A box on a middle line of the patch has d = 0. The moments then give four numbers for five
parameters, and the result is a single box (docs/identifiability.md).

Examples
--------
>>> Double().parameters
('share', 'u0', 'u1', 'v0', 'v1')
>>> float(_share(np.array([0.02]), np.array([0.02]), 0.0)[0])  # 1 / (1 + C / (d_u d_v))
0.5
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..capture.moments import Moments
from ..light.light import PatchLight
from ..measure import box_averages, box_of
from ..patterns import ONE, UU, UV, VV, U, V

# Rounds of finding the box and taking its covariance from what the shares are told by.
_STEPS = 4
# Under this the product of the mean's deviations says nothing about the shares.
_LEAST_DEVIATION = 1e-4


class Double:
    """The model of base and coat; parameters are the share and the edges of the box."""

    name = "double"
    code = 7
    parameters: tuple[str, ...] = ("share", "u0", "u1", "v0", "v1")
    needs: tuple[int, ...] = (ONE, U, UU, V, VV, UV)

    def fit(self, moments: Moments) -> NDArray:
        even, covariance = moments.uniform, moments.covariance
        du, dv = (mean - even[m] for mean, m in zip(moments.mean, (U, V), strict=True))
        share, boxes = np.ones(len(du)), np.empty((len(du), 4))
        own = np.zeros(len(du))
        for _ in range(_STEPS):
            share = _share(du * dv, covariance - share * own, even[UV] - even[U] * even[V])
            for d, m, square in ((du, U, UU), (dv, V, VV)):
                # the box's mean must be on the patch, and its variance not below 0
                share = np.maximum(share, np.where(d > 0, d / (1 - even[m]), -d / even[m]))
                half = (moments.normalised[square] - even[square]) / 2 - even[m] * d
                spread = even[square] - even[m] ** 2
                root = np.sqrt(half * half + spread * d * d)
                share = np.maximum(share, (root - half) / spread)
            share = np.clip(share, 1e-6, 1)
            means, variances = [], []
            for d, m, square in ((du, U, UU), (dv, V, VV)):
                mean = even[m] + d / share
                left = (moments.normalised[square] - (1 - share) * even[square]) / share
                means.append(mean)
                variances.append(np.maximum(left - mean * mean, 0))
            boxes = box_of((means[0], means[1]), (variances[0], variances[1]), moments.extent)
            averages = box_averages(boxes, moments.extent)
            own = averages[UV] - averages[U] * averages[V]
        return np.clip(np.concatenate([share[:, None], boxes], axis=-1), 0, 1)

    def average(self, light: PatchLight, k: int | NDArray, parameters: NDArray) -> NDArray:
        share, u0, u1, v0, v1 = parameters.astype(np.float64).T
        share = share[:, None]
        return share * light.box(k, u0, u1, v0, v1) + (1 - share) * light.whole[k]

    def plane(self, light: PatchLight, k: int) -> None:
        return None


def _share(product: NDArray, covariance: NDArray, base: float) -> NDArray:
    """The share x in covariance = (1 - x) (base + product / x): 1 where nothing tells it.

    product: of the mean's deviations; base: the whole patch's covariance.
    """
    tells = np.abs(product) > _LEAST_DEVIATION
    size, sign = np.abs(product), np.sign(product)
    # base x^2 + (covariance - base + product) x - product = 0, by the root that stays with base = 0
    linear = np.maximum(sign * covariance, 0) - sign * base + size
    root = np.sqrt(np.maximum(linear * linear + 4 * sign * base * size, 0))
    return np.where(tells, 2 * size / np.where(tells, linear + root, 1), 1)
