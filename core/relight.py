"""Relighting: I(p) = sum over patches k of R(p, k) <S(p, k), L_k> (paper 3 and 6)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .field import Field
from .light import PatchLight


def relight(field: Field, light: PatchLight, own: float = 1.0) -> NDArray[np.float32]:
    """The picture under `light`.

    own: how much of the scene's own lamps to add. -> (H, W, 4) float32, scene-linear radiance with
    premultiplied alpha; transparent outside the captured region. Linear in the light.
    """
    out = np.zeros((*field.shape, 4), np.float32)
    for tile in field.tiles:
        colour = np.zeros((tile.region.pixels, 3), np.float32)
        for k, found in tile.entries():
            for e in found:
                radiance = e.support.average(light, k, e.parameters)
                colour[e.pixels] += e.coefficient * radiance.astype(np.float32, copy=False)
        picture = colour.reshape(tile.region.height, tile.region.width, 3)
        if own:
            picture = picture + np.float32(own) * tile.layer("own")
        out[tile.region.slices] = np.dstack([picture, tile.layer("alpha")])
    return out


def over(plate: NDArray, background: NDArray) -> NDArray[np.float32]:
    """The plate (premultiplied RGBA) over an opaque background (H, W, 3) -> opaque RGBA."""
    out = plate.astype(np.float32, copy=True)
    out[..., :3] += (1 - plate[..., 3:]) * background
    out[..., 3] = 1
    return out
