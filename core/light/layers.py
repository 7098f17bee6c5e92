"""Layers: a relit picture taken apart by where its light comes from, so that each part of the light
can be dimmed or tinted afterwards without relighting.

Light adds up: an environment is cut into parts that sum to it, texel by texel, and a picture under
each part is a layer. The layers of a picture without noise sum to it. Denoised ones nearly do, and
what they are off by is shared out among them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

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
    """What of each texel (H, W) is a face's light, for each face of a hemicube."""
    patch = hemicube.locate(_looked_up(environment))[0]
    faces = np.array([hemicube.faces.index(face) for face, *_ in hemicube.grid])
    face = np.where(patch >= 0, faces[patch], -1)
    return {name: (face == i).astype(np.float32) for i, name in enumerate(hemicube.faces)}


def disc(
    environment: Environment, azimuth: float, elevation: float, radius: float, soft: float = 0.1
) -> NDArray[np.float32]:
    """A round part of an environment, (H, W): 1 inside, 0 outside.

    azimuth, elevation: of its middle, in radians, counterclockwise from +X and up from the horizon;
    radius: in radians; soft: the share of the radius over which its rim fades.
    """
    across = np.cos(elevation)
    middle = (across * np.cos(azimuth), across * np.sin(azimuth), np.sin(elevation))
    angle = np.arccos(np.clip(_looked_up(environment) @ np.array(middle), -1, 1))
    rim = max(radius * soft, 1e-6)
    return np.clip((radius - angle) / rim + 0.5, 0, 1).astype(np.float32)


def shares(masks: Mapping[str, NDArray]) -> dict[str, NDArray[np.float32]]:
    """Parts of an environment from masks (H, W) in [0, 1], which may overlap: each takes what those
    before it left, and `REST` what is left of all. They sum to 1."""
    out: dict[str, NDArray[np.float32]] = {}
    left: NDArray | float = 1.0
    for name, mask in masks.items():
        out[name] = (mask * left).astype(np.float32)
        left = left * (1 - mask)
    out[REST] = np.broadcast_to(np.asarray(left, np.float32), next(iter(masks.values())).shape)
    return out


def part_of(environment: Environment, share: NDArray) -> Environment:
    """An environment with a share (H, W) of each texel's light."""
    return Environment((environment.image * share[..., None]).astype(np.float32), environment.turn)


def share_out(layers: Sequence[NDArray], whole: NDArray) -> list[NDArray[np.float32]]:
    """Layers (H, W, 3) that sum to `whole`, none below 0, each as near to what it was as it may be.

    What they are off by is shared in proportion, channel by channel; light that no layer has is
    given to all alike.
    """
    parts = [np.maximum(layer, 0).astype(np.float64) for layer in layers]
    total = np.sum(parts, axis=0)
    there = total > 0
    scale = np.divide(whole, total, out=np.zeros_like(total), where=there)
    even = np.where(there, 0, np.maximum(whole, 0) / len(parts))
    return [(part * scale + even).astype(np.float32) for part in parts]


def residual(layers: Sequence[NDArray], whole: NDArray) -> float:
    """The largest that a sum of layers differs from the picture, of its largest light."""
    off = np.abs(np.sum([layer.astype(np.float64) for layer in layers], axis=0) - whole)
    return float(off.max(initial=0) / max(float(np.max(whole, initial=0)), 1e-12))
