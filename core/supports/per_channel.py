"""One support a channel, for dispersion and coloured coats, at three times the parameters.

The paper shares a support among the channels (section 5) and names this as the alternative.

Examples
--------
>>> from arto.core.supports import PER_CHANNEL
>>> PER_CHANNEL["linear"].parameters[:3], PER_CHANNEL["linear"].code
(('mean_u_r', 'mean_v_r', 'mean_u_g'), 66)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..capture.moments import Moments
from ..light.light import PatchLight
from .base import Support

# Codes of per-channel models are those of the shared ones plus this.
CODE = 64


class PerChannel:
    """Another support model, fitted to the moments of each channel.

    Parameters
    ----------
    base : Support
        The other model.
    """

    def __init__(self, base: Support) -> None:
        self.base = base
        self.name = f"{base.name}_rgb"
        self.code = base.code + CODE
        self.needs = base.needs
        self.parameters = tuple(f"{p}_{c}" for c in "rgb" for p in base.parameters)

    def fit(self, moments: Moments) -> NDArray:
        return np.concatenate([self.base.fit(m) for m in moments.channels], axis=-1)

    def average(self, light: PatchLight, k: int | NDArray, parameters: NDArray) -> NDArray:
        p = len(self.base.parameters)
        return np.stack(
            [
                self.base.average(light, k, parameters[:, c * p : (c + 1) * p])[:, c]
                for c in range(3)
            ],
            axis=-1,
        )

    def plane(self, light: PatchLight, k: int) -> None:
        return None
