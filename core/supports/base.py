"""What a support model is (paper 3: the evaluation of a support is a filter on the light)."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..capture.moments import Moments
from ..light.light import PatchLight


class Support(Protocol):
    """A filter shape on one patch. Adding one is a module with such an object, and its line in
    `supports.SUPPORTS`.

    name; code: its number in the field's files, never used again for another; parameters: their
    names, every one in [0, 1]; needs: the moments that identify it (indices of `MONOMIALS`).
    """

    name: str
    code: int
    parameters: tuple[str, ...]
    needs: tuple[int, ...]

    def fit(self, moments: Moments) -> NDArray:
        """The parameters (n, p) of n pixels."""
        ...

    def average(self, light: PatchLight, k: int, parameters: NDArray) -> NDArray:
        """<S, L>: the light of patch k averaged over the supports (n, p) -> (n, 3) radiance."""
        ...

    def plane(
        self, light: PatchLight, k: int
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]] | None:
        """What `average` is where it is linear in the parameters: a constant (3,), and slopes
        (3, p) along them. None where it is not."""
        ...
