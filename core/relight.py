"""Relighting: I(p) = sum over patches k of R(p, k) <S(p, k), L_k> (paper 3 and 6)."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from .field import Field, Tile
from .light import PatchLight
from .supports import REST

# Patches are added up in so many sums, each in a thread. As many on every machine: the order of a
# sum is in its last digits, and the same field gives the same picture everywhere.
SUMS = 8


def relight(field: Field, light: PatchLight, own: float = 1.0) -> NDArray[np.float32]:
    """The picture under `light`.

    own: how much of the scene's own lamps to add. -> (H, W, 4) float32, scene-linear radiance with
    premultiplied alpha; transparent outside the captured region. Linear in the light.
    """
    out = np.zeros((*field.shape, 4), np.float32)
    for tile in field.tiles:
        colour = _light(tile, light)
        picture = colour.reshape(tile.region.height, tile.region.width, 3)
        if own:
            picture = picture + np.float32(own) * tile.layer("own")
        out[tile.region.slices] = np.dstack([picture, tile.layer("alpha")])
    return out


def _light(tile: Tile, light: PatchLight) -> NDArray[np.float32]:
    """The light of all patches on the pixels of a tile -> (n, 3)."""
    tile.open()  # which may fail: here, and not in the threads
    rest = tile.rest
    weights = np.zeros(tile.patches) if rest is None else rest[1]
    # of each patch in the rest: its weight times its mean radiance, and its weight
    weighted = weights[:, None] * np.append(light.whole, np.ones((tile.patches, 1)), axis=1)

    def some(first: int) -> NDArray[np.float32]:
        # channel by channel: numpy is three times as fast at adding into a row as into columns
        out = np.zeros((7, tile.region.pixels), np.float32)
        for k in range(first, tile.patches, SUMS):
            if weights[k]:
                # times 0 or 1: numpy is slow at adding only where a mask is
                here = (tile.codes[k] == REST).astype(np.float32)
                for row, value in zip(out[3:], weighted[k].astype(np.float32), strict=True):
                    row += here * value
            for e in tile.entries(k):
                radiance = e.support.average(light, k, e.parameters)
                light_of = e.coefficient * radiance.astype(np.float32, copy=False)
                for channel, values in zip(out[:3], light_of.T, strict=True):
                    channel[e.pixels] += values
        return out

    with ThreadPoolExecutor(min(SUMS, os.cpu_count() or 1)) as pool:
        total, *others = pool.map(some, range(SUMS))
    for other in others:
        total += other
    picture, dropped, weight = total[:3], total[3:6], total[6]
    if rest is not None:
        # the mean radiance of the patches that were dropped there, each counting as much as was
        # dropped of it in all the tile
        np.divide(dropped, weight, out=dropped, where=weight > 0)
        picture += rest[0].T * dropped
    return picture.T


def over(plate: NDArray, background: NDArray) -> NDArray[np.float32]:
    """The plate (premultiplied RGBA) over an opaque background (H, W, 3) -> opaque RGBA."""
    out = plate.astype(np.float32, copy=True)
    out[..., :3] += (1 - plate[..., 3:]) * background
    out[..., 3] = 1
    return out
