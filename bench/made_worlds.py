"""Worlds that are made up to be hard on shadows: what is small and bright, what is dark, what has
edges. Equirectangular radiance (height, 2 * height, 3), float32, linear Rec.709, rows bottom-up."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np


def angles(height: int) -> tuple[np.ndarray, np.ndarray]:
    """Azimuth (1, 2 * height) and height above the horizon (height, 1) of a map's texels."""
    azimuth = (0.5 - (np.arange(2 * height) + 0.5) / (2 * height)) * 2 * np.pi
    up = ((np.arange(height) + 0.5) / height - 0.5)[:, None] * np.pi
    return azimuth[None], up


def checker_map(height: int = 512) -> np.ndarray:
    """Fields of 15 degrees, bright and nearly black in turn: edges everywhere."""
    azimuth, up = angles(height)
    field = math.radians(15)
    odd = (np.floor(azimuth / field) + np.floor(up / field)) % 2
    return (0.02 + odd[..., None] * (1.6, 1.4, 1.2)).astype(np.float32)


def town_map(height: int = 512) -> np.ndarray:
    """A town at night: four hundred windows and lamps of many brightnesses around the horizon,
    under a sky that is nearly black."""
    rng = np.random.default_rng(7)
    light = np.full((height, 2 * height, 3), 0.004)
    light[: height // 2] = 0.002
    for _ in range(400):
        row = height // 2 + int(abs(rng.normal(0, 0.06)) * height)
        column = int(rng.integers(0, 2 * height))
        tall, wide = rng.integers(1, 4, 2)
        warm = np.array([1.0, 0.75, 0.45]) if rng.random() < 0.7 else np.array([0.6, 0.8, 1.0])
        light[row : row + tall, column : column + wide] = warm * 10 ** rng.uniform(0, 2.5)
    return light.astype(np.float32)


def dusk_map(height: int = 512) -> np.ndarray:
    """A sky after sunset: an orange band in one direction that fades to a dark blue, smoothly."""
    azimuth, up = angles(height)
    towards = 0.5 + 0.5 * np.cos(azimuth - 2.2)
    band = np.exp(-np.maximum(up, 0) / 0.12) * towards**4
    light = band[..., None] * (4.0, 1.3, 0.35) + (0.02 + 0.03 * np.exp(-np.abs(up)))[
        ..., None
    ] * np.array([0.5, 0.7, 1.3])
    below = np.broadcast_to(up < 0, band.shape)
    light[below] = (0.01, 0.009, 0.008)
    return light.astype(np.float32)


def point_map(height: int = 512) -> np.ndarray:
    """One texel of light, a third of a degree, 35 degrees high, in black."""
    light = np.zeros((height, 2 * height, 3))
    light[int(height * (0.5 + 35 / 180)), int(2 * height * 0.64)] = 80_000.0
    return light.astype(np.float32)


def slit_map(height: int = 512) -> np.ndarray:
    """A dark hall with a door ajar: an upright slit of a degree and a half, and its dim light."""
    azimuth, up = angles(height)
    across = np.abs(np.angle(np.exp(1j * (azimuth + 0.9))))
    inside = (across < math.radians(0.75)) & (up > 0) & (up < math.radians(55))
    light = np.full((*inside.shape, 3), 0.006)
    light[inside] = (60.0, 62.0, 70.0)
    return light.astype(np.float32)


MADE: dict[str, Callable[[], np.ndarray]] = {
    "checker": checker_map,
    "town": town_map,
    "dusk": dusk_map,
    "point": point_map,
    "slit": slit_map,
}
