"""The shadow catcher: what a scene does to the light of a ground that is not in the picture.

A ground stands in for what was filmed. It is lit twice, with the scene's things on it and alone,
and how much the first is of the second is what the things do to the footage: shadows make it less,
mirrored light more. The things by themselves are a third picture. All three are of one light, so
this is no matter of how they were lit.
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
# The share of a pixel that is left of the ground from which on its shadow is believed in part, and
# wholly: below, the outlines' noise is all there is.
HIDDEN, TRUSTED = 0.1, 0.5
# Holes of less than this are the rounding of alphas, which are kept as half floats.
ROUNDED = 4e-3


@dataclass(frozen=True)
class Caught:
    """What things do to a picture that they are put into. All (H, W, ...), scene-linear.

    colour: (..., 3), the things by themselves, premultiplied by `alpha` (H, W), their coverage;
    share: (..., 3), how much of what is behind is seen, in their shadows and under them; light:
    (..., 3), what of light they add to the ground that is seen, or take from it, below 0.
    """

    colour: NDArray[np.float32]
    alpha: NDArray[np.float32]
    share: NDArray[np.float32]
    light: NDArray[np.float32]

    @property
    def plate(self) -> NDArray[np.float32]:
        """(H, W, 4), premultiplied: as Cycles' own plate, in which shadows are grey."""
        grey = np.clip(1 - self.share.mean(axis=-1), 0, 1)
        return np.dstack([self.colour, grey]).astype(np.float32)

    def over(self, footage: NDArray) -> NDArray[np.float32]:
        """The things in the footage (H, W, 3), as Cycles' shadow catcher pass multiplies it."""
        return (self.colour + self.share * footage).astype(np.float32)

    def added_to(self, footage: NDArray) -> NDArray[np.float32]:
        """The things in the footage (H, W, 3), their shadows as the light that they take from the
        ground as it was modelled: right where footage and ground are alike (Debevec 1998)."""
        seen = (1 - self.alpha)[..., None]
        return np.maximum(self.colour + seen * footage + self.light, 0).astype(np.float32)


def catch(
    whole: NDArray,
    ground: NDArray,
    things: NDArray,
    there: NDArray | None = None,
    held: NDArray | float = 0.0,
) -> Caught:
    """How things and their shadows go into footage.

    whole: (H, W, 3), ground and things; ground: (H, W, 3), the ground alone; things: (H, W, 4),
    these alone, where the ground does not hide them. All premultiplied, and without noise, or the
    ratio has all of it. there: (H, W), how much of a pixel the ground covers by itself (default:
    all); held: (H, W), how much is cut out before the ground, see `held_out`.
    """
    return catch_seen(*of_ground(whole, ground, things, held), things, there, held)


def held_out(whole: NDArray, ground: NDArray, things: NDArray) -> NDArray[np.float32]:
    """How much of a pixel is cut out before the ground by what holds out, from the alphas of the
    three takes, (H, W) each -> (H, W).

    The ground is alone without what holds out, so that all of it is there; with everything in the
    picture, what is missing of it is the holes. For a scene that has such things: where coverage is
    a matter of chance, what the three of them differ by is noise.
    """
    left = 1 - things.astype(np.float64)
    seen = np.divide(whole - things, ground, out=left.copy(), where=ground > 0)
    held = np.clip(left - seen, 0, left)
    return np.where(held > ROUNDED, held, 0).astype(np.float32)


def of_ground(
    whole: NDArray, ground: NDArray, things: NDArray, held: NDArray | float = 0.0
) -> tuple[NDArray, NDArray]:
    """What is seen of the ground beside things, and what would be without their shadows, (H, W, 3)
    each, premultiplied by what the things, and holes, leave.

    A denoiser is given these, not the whole and the ground: it lets what is bright glow over its
    outline, and beside a thing that would be light on the ground. In these two the outline is the
    same, and what glows of it is the same share of both.
    """
    return whole - things[..., :3], (1 - things[..., 3] - held)[..., None] * ground


def catch_seen(
    left: NDArray,
    bare: NDArray,
    things: NDArray,
    there: NDArray | None = None,
    held: NDArray | float = 0.0,
) -> Caught:
    """As `catch`, of what `of_ground` gives: what is seen of the ground, and without shadows."""
    colour, alpha = things[..., :3], things[..., 3]
    seen = (1 - alpha - held)[..., None]
    floor = FLOOR * _median(bare, seen[..., 0], there)
    ratio = np.clip((left + floor * seen) / (bare + floor * seen + 1e-30), 0, MOST)
    trusted = np.clip((seen - HIDDEN) / (TRUSTED - HIDDEN), 0, 1)
    ratio = spread(ratio, trusted if there is None else trusted * (there > 0)[..., None])
    covered = 1.0 if there is None else there[..., None]
    # through a hole the footage is seen as it is
    share = (1 - alpha)[..., None] + seen * covered * (ratio - 1)
    light = left - bare
    return Caught(*(part.astype(np.float32) for part in (colour, alpha, share, light)))


def _median(bare: NDArray, seen: NDArray, there: NDArray | None) -> float:
    """The median light of the ground where it is seen; as good as nothing of a black one."""
    grey = bare.mean(axis=-1)
    known = (grey > 0) & (seen > TRUSTED)
    if there is not None:
        known &= there > 0.5
    return float(np.median(grey[known] / seen[known])) if known.any() else 1e-6


def spread(values: NDArray, weights: NDArray) -> NDArray[np.float32]:
    """Fill values (H, W, C) in where they are not known from what is known around, smoothly.

    weights: (H, W, 1), from 0, not known, to 1, kept as it is. Sums over ever larger squares say
    what is there on the whole; each finer level keeps what it knows. Where nothing is known at all,
    1.
    """
    weights = weights.astype(np.float64)
    if (weights == 1).all():
        return values.astype(np.float32)
    levels = [(np.where(weights > 0, values * weights, 0), weights)]
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
