"""The picture of a capture that is not complete: its draft, and over it the fitted tiles."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ...core.field.field import Field
from ...core.light.light import PatchLight
from ...core.preview import Preview


class Growing(Preview):
    """A preview of the size of the shot, whatever the size of the draft.

    draft: a small field of the whole picture; size: (height, width) of the shot's picture; tiles:
    the field of the tiles that are fitted, by the draft's patches; None before the first.
    """

    def __init__(self, draft: Field, size: tuple[int, int], tiles: Field | None) -> None:
        super().__init__([draft])
        self.size = size
        self._tiles = Preview([tiles]) if tiles else None
        # so many times smaller than the shot the draft is about as large as its field
        self._least = max(1, round(size[0] / draft.shape[0]))
        if self._tiles:
            self.factors = [f for f in self._tiles.factors if f <= self._least]
        else:
            self.factors = [self._least]

    def shape(self, factor: int) -> tuple[int, int]:
        return -(-self.size[0] // factor), -(-self.size[1] // factor)

    def through(self, factor: int) -> NDArray[np.float32] | None:
        return None

    def factor_for(self, seconds: float) -> int:
        return self._tiles.factor_for(seconds) if self._tiles else self._least

    def picture(
        self,
        light: PatchLight,
        factor: int = 1,
        own: float = 1.0,
        gains: Mapping[str, float] | None = None,
    ) -> NDArray[np.float32]:
        shape = self.shape(factor)
        out = enlarged(super().picture(light, 1, own, gains), shape)
        if self._tiles and factor in self._tiles.factors:
            found = self._tiles.picture(light, factor, own, gains)
            for tile in self._tiles.level(factor)[0].tiles:
                out[tile.region.slices] = found[tile.region.slices]
            for field in self._tiles.takes:
                field.close()  # a capture that ends puts the tiles in their place
        return out


def enlarged(picture: NDArray[np.float32], shape: tuple[int, int]) -> NDArray[np.float32]:
    """A picture (h, w, C) at another size: between its pixels on a straight line, (H, W, C)."""
    out = picture
    for axis, size in enumerate(shape):
        have = out.shape[axis]
        at = np.clip((np.arange(size, dtype=np.float32) + 0.5) * have / size - 0.5, 0, have - 1)
        low = np.minimum(at.astype(np.intp), max(have - 2, 0))
        share = (at - low).astype(np.float32).reshape((-1,) + (1,) * (2 - axis))
        high = np.minimum(low + 1, have - 1)
        out = out.take(low, axis) * (1 - share) + out.take(high, axis) * share
    return out
