"""Environment maps: light from every direction, as an equirectangular image (paper 6).

Rows run top-down, the first one looks up. Directions are those of Cycles: u = 0.5 - atan2(y, x) /
2 pi, v = 0.5 + atan2(z, hypot(x, y)) / pi, with v counted from the bottom row. Texels are
scene-linear radiance.

Examples
--------
>>> sky = Environment.uniform(2.0)
>>> [round(float(x / np.pi), 6) for x in sky.irradiance()]  # 2 over 4 pi steradians
[8.0, 8.0, 8.0]
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .. import exr
from ..errors import EnvironmentMapError


@dataclass(frozen=True)
class Environment:
    """An equirectangular map.

    Parameters
    ----------
    image : (H, W, 3) float32
        Scene-linear radiance.
    turn : float
        The angle in radians, counterclockwise from above, that is added to the azimuth of a
        direction before the map is looked up. Turning an HDRI so moves no texel.

    Raises
    ------
    EnvironmentMapError
        The image has another shape, or texels that are not finite.
    """

    image: NDArray[np.float32]
    turn: float = 0.0

    def __post_init__(self) -> None:
        shape = self.image.shape
        if len(shape) != 3 or shape[2] != 3 or min(shape[:2]) < 2:
            raise EnvironmentMapError(
                f"an environment map is an image of three channels, not {shape}"
            )
        if not np.isfinite(self.image).all():
            raise EnvironmentMapError(
                "the environment map has pixels that are infinite or not a number: "
                "repair the HDRI, or choose another"
            )

    @staticmethod
    def uniform(radiance: float | tuple[float, ...] = 1.0, height: int = 64) -> Environment:
        """Make a map of the same radiance in every direction.

        Parameters
        ----------
        radiance : float or tuple of 3 float
        height : int
            Rows; there are twice as many columns.

        Returns
        -------
        Environment
        """
        image = np.empty((height, 2 * height, 3), np.float32)
        image[:] = radiance
        return Environment(image)

    @staticmethod
    def load(path: Path) -> Environment:
        """Read a map from an EXR file: its first layer of three or more channels.

        Parameters
        ----------
        path : Path

        Returns
        -------
        Environment

        Raises
        ------
        EnvironmentMapError
            The file has no colour.
        ExrError
            The file cannot be read.
        """
        for pixels in exr.read(path).values():
            if pixels.shape[-1] >= 3:
                return Environment(np.ascontiguousarray(pixels[..., :3], np.float32))
        raise EnvironmentMapError(f"{path} has no colour: an environment map needs R, G and B")

    @cached_property
    def row_solid_angles(self) -> NDArray[np.float64]:
        """(H,) float64: the steradians of one texel of each row."""
        height, width = self.image.shape[:2]
        edges = np.cos(np.linspace(0, np.pi, height + 1))
        return (edges[:-1] - edges[1:]) * (2 * np.pi / width)

    def at(self, directions: NDArray) -> NDArray[np.float32]:
        """Look up the radiance in some directions.

        Parameters
        ----------
        directions : (..., 3) float
            In the world, of any length.

        Returns
        -------
        (..., 3) float32
            The radiance of the texel that each direction meets.
        """
        height, width = self.image.shape[:2]
        x, y, z = np.moveaxis(directions, -1, 0)
        azimuth = np.arctan2(y, x) + self.turn
        column = np.floor((0.5 - azimuth / (2 * np.pi)) * width).astype(np.intp) % width
        row = np.floor((0.5 - np.arctan2(z, np.hypot(x, y)) / np.pi) * height).astype(np.intp)
        return self.image[np.minimum(row, height - 1), column]

    def coarser(self, scale: int) -> Environment:
        """Make a map with fewer texels, each the mean by solid angle of those that it covers.

        Parameters
        ----------
        scale : int
            How many times fewer texels a side; it divides both sides.

        Returns
        -------
        Environment
        """
        height, width = self.image.shape[:2]
        weights = self.row_solid_angles.reshape(-1, scale)
        blocks = self.image.reshape(height // scale, scale, width // scale, scale, 3)
        rows = np.einsum("hs,hswtc->hwc", weights / weights.sum(axis=1, keepdims=True), blocks)
        return Environment((rows / scale).astype(np.float32), self.turn)

    @property
    def below_zero(self) -> float:
        """The share of negative light in all light of the map, by solid angle, 0 to 1."""
        texels = self.row_solid_angles[:, None] * self.image.sum(axis=-1, dtype=np.float64)
        total = float(np.abs(texels).sum())
        return float(-np.minimum(texels, 0).sum()) / total if total > 0 else 0.0

    def irradiance(self) -> NDArray[np.float64]:
        """Integrate the radiance over all directions.

        Returns
        -------
        (3,) float64
        """
        rows = self.image.sum(axis=1, dtype=np.float64)
        return self.row_solid_angles @ rows


def directions(azimuth: NDArray, latitude: NDArray) -> NDArray[np.float64]:
    """Combine azimuths and latitudes into directions.

    Parameters
    ----------
    azimuth : (W, 2) float
        Unit vectors in the horizontal plane.
    latitude : (H,) float
        Radians above the horizon.

    Returns
    -------
    (H, W, 3) float64
        Unit vectors.
    """
    out = np.empty((len(latitude), len(azimuth), 3))
    out[..., :2] = np.cos(latitude)[:, None, None] * azimuth
    out[..., 2] = np.sin(latitude)[:, None]
    return out


def sample_directions(
    height: int, width: int, finer: int, turn: float = 0.0
) -> tuple[NDArray, NDArray, NDArray]:
    """Give the directions of a grid that is finer than a map.

    Azimuths and latitudes are separate because the grid is the product of the two.

    Parameters
    ----------
    height, width : int
        The size of the map in texels.
    finer : int
        Samples along the side of a texel.
    turn : float
        The map's turn in radians, see `Environment`.

    Returns
    -------
    azimuth : (W * finer, 2) float64
        Unit vectors.
    latitude : (H * finer,) float64
        Radians.
    weight : (H * finer,) float64
        The solid angle of one sample of each row, in steradians.
    """
    rows, columns = height * finer, width * finer
    edges = np.linspace(np.pi / 2, -np.pi / 2, rows + 1)
    latitude = (edges[:-1] + edges[1:]) / 2
    weight = (np.sin(edges[:-1]) - np.sin(edges[1:])) * (2 * np.pi / columns)
    u = (np.arange(columns) + 0.5) / columns
    azimuth = (0.5 - u) * 2 * np.pi - turn
    return np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1), latitude, weight
