"""One support a channel: what dispersion and coloured coats need, at three times the parameters.

The paper shares a support among the channels (section 5) and names this as the other way.
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
    """Another support model, fitted to each channel's own moments."""

    def __init__(self, base: Support) -> None:
        self.base = base
        self.name = f"{base.name}_rgb"
        self.code = base.code + CODE
        self.needs = base.needs
        self.parameters = tuple(f"{p}_{c}" for c in "rgb" for p in base.parameters)

    def fit(self, moments: Moments) -> NDArray:
        return np.concatenate([self.base.fit(m) for m in moments.channels], axis=-1)

    def average(self, light: PatchLight, k: int, parameters: NDArray) -> NDArray:
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
