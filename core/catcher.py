"""The shadow catcher: what a scene does to the light of a ground that is not in the picture.

A ground stands in for what was filmed. It is lit twice, with the scene's things on it and alone,
and how much the first is of the second is what the things do to the footage: shadows make it less,
mirrored light more. All three are pictures of one light, so this is no matter of how they were lit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Of a ground's median light: what is added on both sides of the ratio. A thousandth costs nothing,
# a hundredth can be seen; without it, what is dark is all noise.
FLOOR = 1e-3
# No more than so many times as much light comes from a ground beside things as without them.
MOST = 10.0
# A pixel that the things cover less of shows the ground alone: the rounding of a mean of many.
BARE = 1e-4


@dataclass(frozen=True)
class Caught:
    """What things do to a picture that they are put into. All (H, W, ...), scene-linear.

    colour: (..., 3), the things by themselves, premultiplied by `alpha` (H, W), their coverage;
    share: (..., 3), how much of what is behind is seen, in their shadows and under them; under:
    (..., 3), how much of the ground alone is seen.
    """

    colour: NDArray[np.float32]
    alpha: NDArray[np.float32]
    share: NDArray[np.float32]
    under: NDArray[np.float32]

    @property
    def plate(self) -> NDArray[np.float32]:
        """(H, W, 4), premultiplied: as Cycles' own plate, in which shadows are grey."""
        grey = np.clip(1 - self.share.mean(axis=-1), 0, 1)
        return np.dstack([self.colour, grey]).astype(np.float32)

    def colour_of(self, whole: NDArray, ground: NDArray) -> NDArray[np.float32]:
        """The things by themselves in a part of the light, from both pictures of that part."""
        things = np.maximum(whole - self.under * ground, 0)
        return np.where(self.alpha[..., None] <= BARE, 0, things).astype(np.float32)

    def over(self, footage: NDArray) -> NDArray[np.float32]:
        """The things in the footage (H, W, 3), as Cycles' shadow catcher pass multiplies it."""
        return (self.colour + self.share * footage).astype(np.float32)


def catch(whole: NDArray, ground: NDArray, things: NDArray, there: NDArray | None = None) -> Caught:
    """Tell the things from the ground that they stand on.

    whole: (H, W, 3), ground and things; ground: (H, W, 3), the ground alone; both premultiplied,
    and without noise, or the ratio has all of it. things: (H, W), how much of a pixel they cover;
    there: (H, W), how much of it the ground covers by itself (default: all).
    """
    floor = FLOOR * _median(ground, there)
    ratio = np.clip((whole + floor) / (ground + floor), 0, MOST)
    bare = things <= BARE
    ratio = spread(ratio, bare if there is None else bare & (there > 0))
    seen = (1 - things)[..., None]
    # no thing is darker than black: where the shadow is deeper than it is around
    ratio = np.minimum(ratio, (whole + floor) / (seen * ground + floor))
    colour = np.where(bare[..., None], 0, np.maximum(whole - seen * ratio * ground, 0))
    covered = np.ones_like(things) if there is None else there
    share = seen * (1 + covered[..., None] * (ratio - 1))
    found = (colour, things, share, seen * ratio)
    return Caught(*(part.astype(np.float32) for part in found))


def _median(ground: NDArray, there: NDArray | None) -> float:
    """The median light of the ground where it is seen; as good as nothing of a black one."""
    grey = ground.mean(axis=-1)
    lit = grey[(grey > 0) if there is None else (there > 0.5) & (grey > 0)]
    return float(np.median(lit)) if lit.size else 1e-6


def spread(values: NDArray, known: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Fill values (H, W, C) in where they are not known from what is known around, smoothly.

    Sums over ever larger squares say what is there on the whole; each finer level keeps what it
    knows. Where nothing is known at all, 1.
    """
    if known.all():
        return values.astype(np.float32)
    weights = known.astype(np.float64)[..., None]
    levels = [(np.where(known[..., None], values, 0).astype(np.float64), weights)]
    while levels[-1][1].shape[0] > 1 or levels[-1][1].shape[1] > 1:
        sums, weights = (_halved(part) for part in levels[-1])
        # four that are known weigh no more than one: else far squares would pull at near ones
        scale = np.minimum(weights, 1) / np.maximum(weights, 1e-30)
        levels.append((sums * scale, weights * scale))
    sums, weights = levels.pop()
    filled = np.where(weights > 0, sums / np.maximum(weights, 1e-30), 1.0)
    while levels:
        sums, weights = levels.pop()
        filled = sums + (1 - weights) * _doubled(filled)[: sums.shape[0], : sums.shape[1]]
    return filled.astype(np.float32)


def _halved(part: NDArray) -> NDArray:
    """Sums of squares of four pixels."""
    height, width = part.shape[:2]
    part = np.pad(part, ((0, height % 2), (0, width % 2), (0, 0)))
    return part[::2, ::2] + part[1::2, ::2] + part[::2, 1::2] + part[1::2, 1::2]


def _doubled(part: NDArray) -> NDArray:
    """Twice as large, linearly between the pixels' centres."""
    for axis in (0, 1):
        first, last = part.take([0], axis), part.take([-1], axis)
        inner = range(part.shape[axis] - 1)
        before = np.concatenate([first, part.take(inner, axis)], axis)
        after = np.concatenate([part.take(range(1, part.shape[axis]), axis), last], axis)
        pair = np.stack([0.75 * part + 0.25 * before, 0.75 * part + 0.25 * after], axis + 1)
        shape = list(part.shape)
        shape[axis] *= 2
        part = pair.reshape(shape)
    return part
