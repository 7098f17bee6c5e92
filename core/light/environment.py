"""Environment maps: light from every direction, as an equirectangular image (paper 6).

Rows run top-down (up first) and the directions are those of Cycles: u = 0.5 - atan2(y, x) / 2 pi,
v = 0.5 + atan2(z, hypot(x, y)) / pi, with v counted from the bottom row. Scene-linear radiance.
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
    """An equirectangular map: `image` is (H, W, 3) float32, scene-linear.

    turn: radians by which a direction is turned about the vertical, counterclockwise from above,
    before it is looked up: turning an HDRI moves no texel.
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
        """The same radiance from everywhere."""
        image = np.empty((height, 2 * height, 3), np.float32)
        image[:] = radiance
        return Environment(image)

    @staticmethod
    def load(path: Path) -> Environment:
        """An environment map from an EXR file (its first part of three or more channels)."""
        for pixels in exr.read(path).values():
            if pixels.shape[-1] >= 3:
                return Environment(np.ascontiguousarray(pixels[..., :3], np.float32))
        raise EnvironmentMapError(f"{path} has no colour: an environment map needs R, G and B")

    @cached_property
    def row_solid_angles(self) -> NDArray[np.float64]:
        """(H,): steradians of one texel of each row."""
        height, width = self.image.shape[:2]
        edges = np.cos(np.linspace(0, np.pi, height + 1))
        return (edges[:-1] - edges[1:]) * (2 * np.pi / width)

    def at(self, directions: NDArray) -> NDArray[np.float32]:
        """(..., 3) directions, any length -> (..., 3) radiance of the texels that they meet."""
        height, width = self.image.shape[:2]
        x, y, z = np.moveaxis(directions, -1, 0)
        azimuth = np.arctan2(y, x) + self.turn
        column = np.floor((0.5 - azimuth / (2 * np.pi)) * width).astype(np.intp) % width
        row = np.floor((0.5 - np.arctan2(z, np.hypot(x, y)) / np.pi) * height).astype(np.intp)
        return self.image[np.minimum(row, height - 1), column]

    def coarser(self, scale: int) -> Environment:
        """The map with `scale` times fewer texels a side, each the mean over its solid angle; both
        sides must be multiples of it."""
        height, width = self.image.shape[:2]
        weights = self.row_solid_angles.reshape(-1, scale)
        blocks = self.image.reshape(height // scale, scale, width // scale, scale, 3)
        rows = np.einsum("hs,hswtc->hwc", weights / weights.sum(axis=1, keepdims=True), blocks)
        return Environment((rows / scale).astype(np.float32), self.turn)

    @property
    def below_zero(self) -> float:
        """How much of all that the texels have, by solid angle, is below 0: 0 to 1."""
        texels = self.row_solid_angles[:, None] * self.image.sum(axis=-1, dtype=np.float64)
        total = float(np.abs(texels).sum())
        return float(-np.minimum(texels, 0).sum()) / total if total > 0 else 0.0

    def irradiance(self) -> NDArray[np.float64]:
        """(3,): radiance integrated over all directions."""
        rows = self.image.sum(axis=1, dtype=np.float64)
        return self.row_solid_angles @ rows


def directions(azimuth: NDArray, latitude: NDArray) -> NDArray[np.float64]:
    """Unit vectors (H, W, 3) of azimuths (W, 2, unit vectors) and latitudes (H,)."""
    out = np.empty((len(latitude), len(azimuth), 3))
    out[..., :2] = np.cos(latitude)[:, None, None] * azimuth
    out[..., 2] = np.sin(latitude)[:, None]
    return out


def sample_directions(
    height: int, width: int, finer: int, turn: float = 0.0
) -> tuple[NDArray, NDArray, NDArray]:
    """Directions of a grid `finer` times as fine as a map of height x width, turned by `turn`.

    -> azimuth unit vectors (W * finer, 2), latitudes (H * finer,), solid angle of one sample of
    each row (H * finer,). Separate, because a map is a product of the two.
    """
    rows, columns = height * finer, width * finer
    edges = np.linspace(np.pi / 2, -np.pi / 2, rows + 1)
    latitude = (edges[:-1] + edges[1:]) / 2
    weight = (np.sin(edges[:-1]) - np.sin(edges[1:])) * (2 * np.pi / columns)
    u = (np.arange(columns) + 0.5) / columns
    azimuth = (0.5 - u) * 2 * np.pi - turn
    return np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1), latitude, weight
