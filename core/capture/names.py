"""The names of basis images in a capture set's files, and of the layers beside them.

Examples
--------
>>> group_name(7, "white"), own_layer("Key light")
('ARTO_0007_white', 'own_Key light')
>>> GROUP.search("ViewLayer.Combined_ARTO_0007_white").groups()
('0007', 'white')
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TypeVar

from ..file_names import safe_name

Pixels = TypeVar("Pixels")
# The layer of the whole picture, with its alpha.
COMBINED = "Combined"
# A number follows ARTO where one of the artist's light groups has the name without a number.
GROUP = re.compile(r"(?:^|\.)Combined_ARTO(?:-\d+)?_(\d{4})_(\w+)$")
# Layers beside the basis images, by the end of their part's name.
GUIDES = {
    "albedo": "Denoising Albedo",
    "normal": "Denoising Normal",
    "depth": "Depth",
    "position": "Position",
}
# The layer of what the camera sees of the world behind all things: an image of a white world that
# only the camera sees, straight or through what is clear. Blender's versions name it differently.
BEHIND = ("Environment", "Env")
# The radiance of that white world. It is so small that no other layer shows it, and a power of two,
# so that dividing by it is exact.
BEHIND_LIGHT = 2.0**-40
# Guides of the first ray through a pixel. A mean of two places would be neither of them.
OF_ONE_RAY = ("depth", "position")
# The light groups of the scene's own lamps, as their artist named them.
OWN_GROUP = re.compile(r"(?:^|\.)Combined_(.+)$")
# The pattern that shows the noise: grains so fine that no reflection resolves them, of which a
# random half is lit. A light path meets a lit or a dark grain by chance. So twice this image minus
# the white one is the sum of the paths' weights with random signs. Its square is, on average, the
# sum of the squared weights, which is the variance of the white image. This pattern is no
# polynomial and does not belong to the pattern set. It must be captured in the same render as the
# others, so that it has the same paths.
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


def is_behind(layer: str) -> bool:
    """Whether a layer of a render is that of the world behind, see `BEHIND`.

    Parameters
    ----------
    layer
        Its name.

    Returns
    -------
    bool

    Examples
    --------
    >>> [is_behind(n) for n in ("ViewLayer.Environment", "Env", "Combined_Env")]
    [True, True, False]
    """
    return layer.rpartition(".")[2] in BEHIND


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
    """Name the light group of a patch under a pattern.

    Parameters
    ----------
    k : int
        The number of the patch.
    pattern : str

    Returns
    -------
    str
    """
    return f"ARTO_{k:04d}_{pattern}"


def own_layer(group: str) -> str:
    """Name the layer that holds the light of one of the scene's own light groups.

    Parameters
    ----------
    group : str
        The light group's name in the scene.

    Returns
    -------
    str
    """
    return f"own_{safe_name(group)}"
