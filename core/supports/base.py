"""What a support model is: a filter on the light of one patch (paper 3).

Examples
--------
>>> from arto.core.supports import SUPPORTS
>>> {model.name: model.parameters for model in SUPPORTS.values()}["box"]
('u0', 'u1', 'v0', 'v1')
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..capture.moments import Moments
from ..light.light import PatchLight


class Support(Protocol):
    """A filter shape on one patch.

    To add a model, write a module with such an object and a line in `supports.SUPPORTS`.

    Attributes
    ----------
    name : str
    code : int
        The model's number in the files of a field, never used again for another model.
    parameters : tuple of str
        The names of the p parameters; each is in [0, 1].
    needs : tuple of int
        The moments that identify the parameters, as indices into `patterns.MONOMIALS`.
    """

    name: str
    code: int
    parameters: tuple[str, ...]
    needs: tuple[int, ...]

    def fit(self, moments: Moments) -> NDArray:
        """Compute the parameters of n pixels.

        Parameters
        ----------
        moments : Moments
            Of one patch and n pixels.

        Returns
        -------
        (n, p) float
        """
        ...

    def average(self, light: PatchLight, k: int | NDArray, parameters: NDArray) -> NDArray:
        """Compute <S, L>: the light of patches averaged over supports.

        Parameters
        ----------
        light : PatchLight
        k : int or (n,) int
            The number of the patch, or of each support's.
        parameters : (n, p) float

        Returns
        -------
        (n, 3) float
            Scene-linear radiance.
        """
        ...

    def plane(
        self, light: PatchLight, k: int
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]] | None:
        """Give `average` as a plane, for models whose average is linear in the parameters.

        Parameters
        ----------
        light : PatchLight
        k : int
            The number of the patch.

        Returns
        -------
        tuple or None
            A constant (3,) and the slopes (3, p) along the parameters; None for other models.
        """
        ...
