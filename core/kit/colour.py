"""The colour of a black body, relative to that of 6500 K.

Examples
--------
>>> [round(x, 2) for x in of_kelvin(6500.0)]
[1.0, 1.0, 1.0]
>>> red, green, blue = of_kelvin(3200.0)
>>> red > 1.5 and blue < 0.4
True
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

# The temperature that counts as white.
WHITE_KELVIN = 6500.0
# From CIE XYZ to linear Rec. 709.
_REC709 = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560],
     [0.0556434, -0.2040259, 1.0572252]]
)  # fmt: skip
# Planck's second constant, in metres and kelvins.
_SECOND = 1.4387769e-2


def _bell(x: NDArray, middle: float, below: float, above: float) -> NDArray:
    return np.exp(-0.5 * ((x - middle) / np.where(x < middle, below, above)) ** 2)


def _luminous(kelvin: float) -> NDArray[np.float64]:
    """The colour of a black body with a luminance of 1, in linear Rec. 709."""
    nm = np.arange(360.0, 831.0)
    metres = nm * 1e-9
    spectrum = metres**-5 / np.expm1(_SECOND / (metres * kelvin))
    x = 1.056 * _bell(nm, 599.8, 37.9, 31.0) + 0.362 * _bell(nm, 442.0, 16.0, 26.7)
    x -= 0.065 * _bell(nm, 501.1, 20.4, 26.2)
    y = 0.821 * _bell(nm, 568.8, 46.9, 40.5) + 0.286 * _bell(nm, 530.9, 16.3, 31.1)
    z = 1.217 * _bell(nm, 437.0, 11.8, 36.0) + 0.681 * _bell(nm, 459.0, 26.0, 13.8)
    xyz = np.stack([x, y, z]) @ spectrum
    return _REC709 @ (xyz / xyz[1])


@lru_cache(maxsize=4096)
def of_kelvin(kelvin: float) -> tuple[float, float, float]:
    """Give the colour of a black body, divided by the colour at 6500 K.

    Below 1900 K the blue of Rec. 709 is 0.

    Parameters
    ----------
    kelvin : float

    Returns
    -------
    tuple of 3 float
        Linear Rec. 709.

    Source
    ------
    Planck's law; the observer by Wyman, Sloan and Shirley, "Simple analytic approximations to the
    CIE XYZ color matching functions", 2013.
    """
    ratio = np.maximum(_luminous(kelvin), 0) / _luminous(WHITE_KELVIN)
    return float(ratio[0]), float(ratio[1]), float(ratio[2])
