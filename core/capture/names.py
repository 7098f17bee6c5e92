"""The names that a capture set's files have for basis images and for the layers beside them."""

from __future__ import annotations

import re

from ..shot import safe_name

# After ARTO there may be a number, where a light group of the artist's has the name without.
GROUP = re.compile(r"(?:^|\.)Combined_ARTO(?:-\d+)?_(\d{4})_(\w+)$")
# Layers beside the basis images, by the end of their part's name.
GUIDES = {
    "albedo": "Denoising Albedo",
    "normal": "Denoising Normal",
    "depth": "Depth",
    "position": "Position",
}
# Of them those that are of one ray through a pixel, its first: a mean of two is no place at all.
OF_ONE_RAY = ("depth", "position")
# The light groups of the scene's own lamps, as their artist named them.
OWN_GROUP = re.compile(r"(?:^|\.)Combined_(.+)$")
# The pattern that shows the noise: a patch of grains so fine that no reflection resolves them, half
# of them lit, at random. A light path meets a lit grain or a dark one as a coin falls, so twice
# this image less the white one is a sum of the paths' weights with random signs: its square is, on
# average, the sum of their squares, which is the variance of the white image. It is no polynomial
# and no part of the pattern set; it must share its render, and so its paths, with the others.
GRAIN = "grain"


def group_name(k: int, pattern: str) -> str:
    """The light group of patch k under a pattern."""
    return f"ARTO_{k:04d}_{pattern}"


def own_layer(group: str) -> str:
    """The layer of the light of a group of the scene's own lamps."""
    return f"own_{safe_name(group)}"
