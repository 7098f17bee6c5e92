"""The names that a capture set's files have for basis images and for the layers beside them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TypeVar

from ..shot import safe_name

Pixels = TypeVar("Pixels")
# The layer of the whole picture, with its alpha.
COMBINED = "Combined"
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


def is_combined(layer: str) -> bool:
    """Whether a layer of a render is the whole picture.

    Parameters
    ----------
    layer
        Its name. A file of layers has the view layer's name and a dot before it.

    Returns
    -------
    bool

    Examples
    --------
    >>> [is_combined(n) for n in ("Combined", "ViewLayer.Combined", "Combined_lamps")]
    [True, True, False]
    """
    return layer == COMBINED or layer.endswith(f".{COMBINED}")


def combined(layers: Mapping[str, Pixels]) -> Pixels:
    """The whole picture among the layers of a render.

    Parameters
    ----------
    layers
        Pixels (H, W, C) by name, scene-linear. One of them is the whole picture.

    Returns
    -------
    Pixels
        The pixels of the whole picture.

    Examples
    --------
    >>> combined({"ViewLayer.Depth": 1.0, "ViewLayer.Combined": 2.0})
    2.0
    """
    return next(pixels for name, pixels in layers.items() if is_combined(name))


def group_name(k: int, pattern: str) -> str:
    """The light group of patch k under a pattern."""
    return f"ARTO_{k:04d}_{pattern}"


def own_layer(group: str) -> str:
    """The layer of the light of a group of the scene's own lamps."""
    return f"own_{safe_name(group)}"
