"""A simulated photographer: arrays of light in, values of pixels out (paper 4.2, 9).

Monitors that are not what they were measured as, and a camera that counts photons, adds noise when
it is read, has few bits and a curve. So a laboratory can plan a capture before it builds one.

Examples
--------
>>> camera = Camera(bits=8, electrons=20_000, read_noise=5.0)
>>> light = np.full((1, 400, 3), 0.18)
>>> values = camera.values(light, 1.0, np.random.default_rng(1))
>>> values.dtype, abs(int(np.median(values)) - 118) <= 1  # sRGB has 118 of 255 at 18%
(dtype('uint8'), True)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..hemicube import Hemicube
from ..patterns import MONOMIALS, monomials
from .description import LINEAR, SRGB, Monitors
from .screen_curve import light_of, value_of
from .shown import patterns_of

# Points along the side of a patch at which what a monitor shows is compared with its pattern.
POINTS = 33


@dataclass(frozen=True)
class Camera:
    """A camera, and how it writes its pictures.

    Parameters
    ----------
    bits : int
        Of a value, 8 to 16.
    electrons : float
        Photons that fill a pixel; infinite for a camera without noise of photons.
    read_noise : float
        Electrons that reading adds, as a standard deviation.
    curve : str
        `sRGB` or `linear`.
    """

    bits: int = 8
    electrons: float = 20_000.0
    read_noise: float = 5.0
    curve: str = SRGB

    def values(
        self, light: NDArray, seconds: float, rng: np.random.Generator
    ) -> NDArray[np.uint8] | NDArray[np.uint16]:
        """Take a photograph.

        Parameters
        ----------
        light : (H, W, 3) float
            Scene-linear. At an exposure of a second, 1 fills a pixel.
        seconds : float
        rng : numpy.random.Generator

        Returns
        -------
        (H, W, 3) uint8 or uint16
            Values of the file; of 9 to 15 bits, stretched over 16.
        """
        filled = np.maximum(np.asarray(light, np.float64) * seconds, 0)
        if np.isfinite(self.electrons):
            counted = rng.poisson(np.minimum(filled, 4) * self.electrons).astype(np.float64)
            counted += rng.normal(0, self.read_noise, counted.shape)
            filled = counted / self.electrons
        filled = np.clip(filled, 0, 1)
        levels = 2**self.bits - 1
        values = np.rint(levels * (encoded(filled) if self.curve == SRGB else filled)) / levels
        if self.bits == 8:
            return np.rint(255 * values).astype(np.uint8)
        return np.rint(65535 * values).astype(np.uint16)


IDEAL = Camera(bits=16, electrons=np.inf, read_noise=0.0, curve=LINEAR)


def encoded(light: NDArray) -> NDArray[np.float64]:
    """Encode light as sRGB values.

    Parameters
    ----------
    light : (...) float
        0 to 1.

    Returns
    -------
    (...) float64
        0 to 1.
    """
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def exposures_for(brightest: float, count: int, stops: float) -> tuple[float, ...]:
    """Choose exposures, of which the shortest keeps the brightest light under saturation.

    Parameters
    ----------
    brightest : float
        Scene-linear.
    count : int
    stops : float
        Between two exposures.

    Returns
    -------
    tuple of float
        Seconds, the shortest first.
    """
    shortest = 0.9 / max(brightest, 1e-12)
    return tuple(shortest * 2.0 ** (stops * i) for i in range(count))


@dataclass(frozen=True)
class TrueScreen:
    """What a monitor really does.

    Parameters
    ----------
    curve : (3, n) float64
        See `screen_curve.measured_curve`.
    white : float
        The light of white, in the unit of the pictures.
    black : float
        The light of black, as a share of white's.
    bits : int
        Of the values that it shows.
    """

    curve: NDArray[np.float64]
    white: float = 1.0
    black: float = 0.0
    bits: int = 8

    def shows(self, values: NDArray) -> NDArray[np.float64]:
        """Compute what a grey shines.

        Parameters
        ----------
        values : (...) float
            0 to 1.

        Returns
        -------
        (..., 3) float64
        """
        light = light_of(self.curve, np.asarray(values, np.float64)[..., None])
        return self.white * (self.black + (1 - self.black) * light)


def emissions(
    screen: TrueScreen, hemicube: Hemicube, monitors: Monitors
) -> list[tuple[NDArray[np.float64], ...]]:
    """Compute what the patterns on a monitor really are, as polynomials.

    A monitor shows values of few bits, made by the curve that was measured, through the curve that
    it has. What it shines is fitted by the polynomials that a capture of light groups knows.

    Parameters
    ----------
    screen : TrueScreen
    hemicube : Hemicube
    monitors : Monitors
        With the curve that was measured; without one the patterns are as they are meant.

    Returns
    -------
    list of tuple of 3 (6,) float64
        For each pattern and channel the coefficients over `patterns.MONOMIALS`, of white above
        black.
    """
    at = (np.arange(POINTS) + 0.5) / POINTS
    m = monomials(*np.meshgrid(at, at)).reshape(len(MONOMIALS), -1)
    inverse = np.linalg.pinv(m.T)
    patterns = patterns_of(monitors)
    out = []
    for name in patterns.patterns:
        # a camera sees the mean of grains, which is half of white
        half = np.eye(len(MONOMIALS))[0] / 2
        rows = [half if row is None else np.array(row) for row in patterns.emission(name)]
        wanted = np.stack(rows * (3 // len(rows)))
        if monitors.curve is None:
            out.append(tuple(wanted))
            continue
        values = value_of(np.array(monitors.curve), np.clip((wanted @ m).T, 0, 1))
        levels = 2**screen.bits - 1
        shown = light_of(screen.curve, np.rint(values * levels) / levels)
        out.append(tuple((inverse @ shown).T))
    return out


def basis_image(moments: NDArray, emission: tuple[NDArray, ...]) -> NDArray[np.float64]:
    """Compute the picture of a pattern from those of the monomials.

    Parameters
    ----------
    moments : (6, H, W, 3) float
        The pictures of one patch under each of `patterns.MONOMIALS`.
    emission : tuple of 3 (6,) float64
        See `emissions`.

    Returns
    -------
    (H, W, 3) float64
    """
    return np.stack(
        [np.tensordot(row, moments[..., c], axes=1) for c, row in enumerate(emission)], axis=-1
    )
