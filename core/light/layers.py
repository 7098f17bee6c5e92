"""Layers: a relit picture taken apart by where its light comes from.

Each part of the light can then be dimmed or tinted without relighting. Light adds up: an
environment is cut into parts that sum to it texel by texel, and the picture under each part is a
layer. Layers without noise sum to the picture. Denoised layers nearly do, and their difference
from the picture is shared out among them.

Examples
--------
>>> key, fill = np.full((1, 1, 3), 0.6), np.full((1, 1, 3), 0.2)
>>> whole = np.full((1, 1, 3), 1.0)
>>> [round(float(part.mean()), 3) for part in share_out([key, fill], whole)]
[0.75, 0.25]
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..hemicube import Hemicube
from .environment import Environment, directions, sample_directions

# The part of an environment that no other has.
REST = "rest"


def _looked_up(environment: Environment) -> NDArray[np.float64]:
    """The direction of each texel's middle, (H, W, 3)."""
    height, width = environment.image.shape[:2]
    azimuth, latitude, _ = sample_directions(height, width, 1, environment.turn)
    return directions(azimuth, latitude)


def by_faces(environment: Environment, hemicube: Hemicube) -> dict[str, NDArray[np.float32]]:
    """Cut an environment by the faces of a hemicube.

    Parameters
    ----------
    environment : Environment
    hemicube : Hemicube

    Returns
    -------
    dict of str to (H, W) float32
        For each face its share of each texel, 0 or 1.
    """
    patch = hemicube.locate(_looked_up(environment))[0]
    faces = np.array([hemicube.faces.index(face) for face, *_ in hemicube.grid])
    face = np.where(patch >= 0, faces[patch], -1)
    return {name: (face == i).astype(np.float32) for i, name in enumerate(hemicube.faces)}


def disc(
    environment: Environment, azimuth: float, elevation: float, radius: float, soft: float = 0.1
) -> NDArray[np.float32]:
    """Make a round part of an environment.

    Parameters
    ----------
    environment : Environment
    azimuth, elevation : float
        Its middle in radians, counterclockwise from +X and up from the horizon.
    radius : float
        Radians.
    soft : float
        The share of the radius over which the rim fades.

    Returns
    -------
    (H, W) float32
        1 inside, 0 outside.
    """
    across = np.cos(elevation)
    middle = (across * np.cos(azimuth), across * np.sin(azimuth), np.sin(elevation))
    angle = np.arccos(np.clip(_looked_up(environment) @ np.array(middle), -1, 1))
    rim = max(radius * soft, 1e-6)
    return np.clip((radius - angle) / rim + 0.5, 0, 1).astype(np.float32)


def shares(masks: Mapping[str, NDArray]) -> dict[str, NDArray[np.float32]]:
    """Turn masks into parts of an environment that sum to 1.

    Masks may overlap: each takes its share of what the earlier ones left.

    Parameters
    ----------
    masks : dict of str to (H, W) float
        Between 0 and 1, by name.

    Returns
    -------
    dict of str to (H, W) float32
        The parts by name; `REST` is what all masks leave.
    """
    out: dict[str, NDArray[np.float32]] = {}
    left: NDArray | float = 1.0
    for name, mask in masks.items():
        out[name] = (mask * left).astype(np.float32)
        left = left * (1 - mask)
    out[REST] = np.broadcast_to(np.asarray(left, np.float32), next(iter(masks.values())).shape)
    return out


def part_of(environment: Environment, share: NDArray) -> Environment:
    """Take a share of each texel of an environment.

    Parameters
    ----------
    environment : Environment
    share : (H, W) float
        0 to 1.

    Returns
    -------
    Environment
    """
    return Environment((environment.image * share[..., None]).astype(np.float32), environment.turn)


def share_out(
    layers: Sequence[NDArray], whole: NDArray, signed: Collection[int] = ()
) -> list[NDArray[np.float32]]:
    """Change layers so that they sum to a picture and none is below 0.

    The difference is shared in proportion to the layers, channel by channel. Light that no layer
    has is given to all in equal parts. A layer that takes light away stays as it is, and the others
    sum to the picture without it.

    Parameters
    ----------
    layers : sequence of (H, W, 3) float
        Scene-linear.
    whole : (H, W, 3) float
        The picture.
    signed : collection of int
        The numbers of the layers that may take light away.

    Returns
    -------
    list of (H, W, 3) float32
    """
    apart = {i for i in signed if (layers[i] < 0).any()}
    if apart and len(apart) < len(layers):
        left = whole - np.sum([layers[i] for i in apart], axis=0)
        there = share_out([part for i, part in enumerate(layers) if i not in apart], left)
        others = iter(there)
        return [
            part.astype(np.float32) if i in apart else next(others) for i, part in enumerate(layers)
        ]
    parts = [np.maximum(layer, 0).astype(np.float64) for layer in layers]
    total = np.sum(parts, axis=0)
    there = total > 0
    scale = np.divide(whole, total, out=np.zeros_like(total), where=there)
    even = np.where(there, 0, np.maximum(whole, 0) / len(parts))
    return [(part * scale + even).astype(np.float32) for part in parts]


def residual(layers: Sequence[NDArray], whole: NDArray) -> float:
    """Compute the largest difference between the sum of layers and their picture.

    Parameters
    ----------
    layers : sequence of (H, W, 3) float
    whole : (H, W, 3) float
        The picture.

    Returns
    -------
    float
        Relative to the largest value of the picture.
    """
    off = np.abs(np.sum([layer.astype(np.float64) for layer in layers], axis=0) - whole)
    return float(off.max(initial=0) / max(float(np.max(whole, initial=0)), 1e-12))
