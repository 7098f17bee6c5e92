"""The shadow catcher: what a scene does to the light of a ground that is not in the picture.

A ground stands in for the place that was filmed. It is captured twice: with the scene's things on
it, and alone. The ratio of the two is what the things do to the footage: below 1 in their shadows,
above 1 where they mirror light. The things alone are a third picture. All three are relit by the
same light.

Examples
--------
>>> ground = np.full((1, 1, 3), 0.5)
>>> things = np.zeros((1, 1, 4))  # nothing stands in this pixel
>>> caught = catch(0.4 * ground, ground, things)  # but a shadow falls there
>>> [round(float(x), 3) for x in caught.over(np.full((1, 1, 3), 0.8))[0, 0]]
[0.32, 0.32, 0.32]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Added on both sides of the ratio, as a share of the ground's median light. Without it, dark places
# are all noise. A thousandth costs nothing, a hundredth would be visible.
FLOOR = 1e-3
# The most that things may multiply the light of the ground by.
MOST = 10.0
# A shadow is believed in part from the first share of visible ground in a pixel, and wholly from
# the second. With less ground the ratio is the noise of outlines.
HIDDEN, TRUSTED = 0.1, 0.5
# Smaller holes are the rounding of alphas, which are kept as half floats.
ROUNDED = 4e-3


@dataclass(frozen=True)
class Caught:
    """What things do to the footage that they are put into. All is scene-linear.

    Parameters
    ----------
    colour : (H, W, 3) float32
        The things alone, premultiplied by `alpha`.
    alpha : (H, W) float32
        Their coverage.
    share : (H, W, 3) float32
        The factor for the footage: how much of it is seen beside the things and in their shadows.
    light : (H, W, 3) float32
        The light that the things add to the visible ground; negative in shadows.
    """

    colour: NDArray[np.float32]
    alpha: NDArray[np.float32]
    share: NDArray[np.float32]
    light: NDArray[np.float32]

    @property
    def plate(self) -> NDArray[np.float32]:
        """(H, W, 4) float32, premultiplied: a plate like that of Cycles, with grey shadows in its
        alpha.
        """
        grey = np.clip(1 - self.share.mean(axis=-1), 0, 1)
        return np.dstack([self.colour, grey]).astype(np.float32)

    def over(self, footage: NDArray) -> NDArray[np.float32]:
        """Put the things into footage, as Cycles' shadow catcher pass does: by multiplication.

        Parameters
        ----------
        footage : (H, W, 3) float
            Scene-linear.

        Returns
        -------
        (H, W, 3) float32
        """
        return (self.colour + self.share * footage).astype(np.float32)

    def added_to(self, footage: NDArray) -> NDArray[np.float32]:
        """Put the things into footage by adding the light that they give to the ground, or take
        from it.

        This is right where the footage looks like the modelled ground.

        Parameters
        ----------
        footage : (H, W, 3) float
            Scene-linear.

        Returns
        -------
        (H, W, 3) float32

        Source
        ------
        Debevec 1998, "Rendering synthetic objects into real scenes", differential rendering.
        """
        seen = (1 - self.alpha)[..., None]
        return np.maximum(self.colour + seen * footage + self.light, 0).astype(np.float32)


def catch(
    whole: NDArray,
    ground: NDArray,
    things: NDArray,
    there: NDArray | None = None,
    held: NDArray | float = 0.0,
) -> Caught:
    """Compute how things and their shadows go into footage.

    The pictures must be free of noise, because their ratio has all of it.

    Parameters
    ----------
    whole : (H, W, 3) float
        Ground and things, premultiplied, scene-linear.
    ground : (H, W, 3) float
        The ground alone.
    things : (H, W, 4) float
        The things alone, where the ground does not hide them.
    there : (H, W) float, optional
        The coverage of the ground by itself; by default 1.
    held : (H, W) float
        The holes in front of the ground, see `held_out`.

    Returns
    -------
    Caught
    """
    return catch_seen(*of_ground(whole, ground, things, held), things, there, held)


def held_out(whole: NDArray, ground: NDArray, things: NDArray) -> NDArray[np.float32]:
    """Compute the holes that holdout objects cut into the picture in front of the ground.

    The ground alone is captured without these objects, so it is complete. In the picture of
    everything, the missing part of the ground is the holes. This is meant for scenes with such
    objects: in other scenes the three alphas differ by noise.

    Parameters
    ----------
    whole, ground, things : (H, W) float
        The alphas of the three takes.

    Returns
    -------
    (H, W) float32
        The share of a pixel that is cut out.
    """
    left = 1 - things.astype(np.float64)
    seen = np.divide(whole - things, ground, out=left.copy(), where=ground > 0)
    held = np.clip(left - seen, 0, left)
    return np.where(held > ROUNDED, held, 0).astype(np.float32)


def of_ground(
    whole: NDArray, ground: NDArray, things: NDArray, held: NDArray | float = 0.0
) -> tuple[NDArray, NDArray]:
    """Compute the visible part of the ground, with and without the shadows of things.

    These two pictures are denoised in place of the whole and the ground. A denoiser lets a bright
    thing glow over its outline, which would be light on the ground. These two have the same
    outlines, so a glow has the same share in both.

    Parameters
    ----------
    whole, ground : (H, W, 3) float
        As for `catch`.
    things : (H, W, 4) float
    held : (H, W) float

    Returns
    -------
    left, bare : (H, W, 3) float
        With and without shadows, premultiplied by what things and holes leave visible.
    """
    return whole - things[..., :3], (1 - things[..., 3] - held)[..., None] * ground


def catch_seen(
    left: NDArray,
    bare: NDArray,
    things: NDArray,
    there: NDArray | None = None,
    held: NDArray | float = 0.0,
) -> Caught:
    """Compute the same as `catch` from the pictures that `of_ground` gives.

    Parameters
    ----------
    left, bare : (H, W, 3) float
        The visible ground with shadows and without.
    things : (H, W, 4) float
    there : (H, W) float, optional
    held : (H, W) float

    Returns
    -------
    Caught
    """
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
    """The median light of the visible ground; a tiny number for a black ground."""
    grey = bare.mean(axis=-1)
    known = (grey > 0) & (seen > TRUSTED)
    if there is not None:
        known &= there > 0.5
    return float(np.median(grey[known] / seen[known])) if known.any() else 1e-6


def spread(values: NDArray, weights: NDArray) -> NDArray[np.float32]:
    """Fill in unknown values smoothly from the known values around them.

    Sums over ever larger squares give coarse values everywhere; each finer level keeps what it
    knows (a pull-push pyramid).

    Parameters
    ----------
    values : (H, W, C) float
    weights : (H, W, 1) float
        From 0, unknown, to 1, kept as it is.

    Returns
    -------
    (H, W, C) float32
        1 where nothing is known at all.

    Source
    ------
    Gortler et al. 1996, "The Lumigraph", pull-push.
    """
    weights = weights.astype(np.float64)
    if (weights == 1).all():
        return values.astype(np.float32)
    levels = [(np.where(weights > 0, values * weights, 0), weights)]
    while levels[-1][1].shape[0] > 1 or levels[-1][1].shape[1] > 1:
        sums, weights = (_halved(part) for part in levels[-1])
        # four known pixels weigh as much as one, so that far squares do not outweigh near ones
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
