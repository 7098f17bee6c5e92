"""A finish: a plate and samples of the truth put together, each by how far it can be believed.

The samples are kept as two renders with independent noise, and each may be denoised. How much of
the plate brings one of them, as it was denoised, nearest to the *other*, as it was rendered, is a
regression. The other render is the truth with noise that neither the plate nor the first one knows,
so that this noise takes no side. It says nothing but which mean of the two is nearest to the truth.

Examples
--------
>>> rng = np.random.default_rng(0)
>>> truth = np.full((64, 64, 3), 0.5)
>>> plate = truth + np.where(np.arange(64) < 32, 0.01, 0.3)[:, None]
>>> one, two = (truth + rng.normal(0, 0.1, truth.shape) for _ in range(2))
>>> share = plate_share(plate, (one, two), (one, two))
>>> bool(share[:, :24].mean() > 0.7), bool(share[:, 44:].mean() < 0.1)
(True, True)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import FieldError

# Pixels from a square's middle to its side, over which errors are averaged.
REACH = 6
# How far shares differ from place to place, as a deviation.
SPREAD = 0.3
# Of the picture's mean, what counts as dark: errors are told relative to a pixel's light.
DARK = 0.02
# By how much the squared error falls from half of the samples to all. Denoised it falls less; but
# a plate that is believed too much does more harm than one that is believed too little.
FALLS = 2.0


@dataclass(frozen=True)
class Samples:
    """Two renders of the truth with independent noise, and of how many samples a pixel each is.

    Parameters
    ----------
    one, two : (H, W, 4) float32
        Scene-linear, premultiplied.
    count : int
        Samples a pixel of each.
    guides : (H, W, 6) float32, optional
        Albedo and normal of all samples, which steer a denoiser.
    """

    one: NDArray[np.float32]
    two: NDArray[np.float32]
    count: int
    guides: NDArray[np.float32] | None = None

    @property
    def mean(self) -> NDArray[np.float32]:
        """The render of all samples, (H, W, 4)."""
        return ((self.one + self.two) / 2).astype(np.float32)

    def more(self, other: Samples) -> Samples:
        """The samples of both.

        Parameters
        ----------
        other : Samples
            Of the same picture, with other noise.

        Returns
        -------
        Samples

        Raises
        ------
        FieldError
            The pictures have two sizes.
        """
        if other.one.shape != self.one.shape:
            raise FieldError(f"samples of {self.one.shape} and of {other.one.shape} pixels")
        count = self.count + other.count

        def mean(old: NDArray, new: NDArray) -> NDArray[np.float32]:
            return ((self.count * old.astype(np.float64) + other.count * new) / count).astype("f4")

        guides = None
        if self.guides is not None and other.guides is not None:
            guides = mean(self.guides, other.guides)
        return Samples(mean(self.one, other.one), mean(self.two, other.two), count, guides)


def plate_share(
    plate: NDArray,
    renders: tuple[NDArray, NDArray],
    clean: tuple[NDArray, NDArray],
) -> NDArray[np.float32]:
    """How much of each pixel the plate gets, beside what all samples show.

    Parameters
    ----------
    plate : (H, W, 3) float
        Scene-linear, premultiplied.
    renders : two (H, W, 3) float
        Renders of the same picture with independent noise.
    clean : two (H, W, 3) float
        The same, each denoised by itself; or the renders themselves.

    Returns
    -------
    (H, W) float32
        In [0, 1].
    """
    # The plate alone tells how bright a pixel is. A pixel of a noisy render would count for more
    # where it happens to be dark.
    light = np.abs(plate).mean(axis=-1, dtype=np.float64)
    weight = 1 / (light + DARK * light.mean() + 1e-30) ** 2
    along = np.zeros(light.shape)
    apart, noise = along.copy(), along.copy()
    for own, other in ((0, 1), (1, 0)):
        to_plate = plate.astype(np.float64) - clean[own]
        missed = renders[other].astype(np.float64) - clean[own]
        along += (missed * to_plate).mean(axis=-1) * weight
        apart += (to_plate**2).mean(axis=-1) * weight
        noise += (missed**2).mean(axis=-1) * weight
    near, size, noise = (_around(a, REACH) for a in (along, apart, noise))
    # Where a square's values are noise rather than a difference they say less than most of the
    # picture does, which then counts as so many values more.
    lit = size > 0
    most = float(np.clip(np.median(near[lit] / size[lit]), 0, 1)) if lit.any() else 0.0
    more = noise / (SPREAD * (2 * REACH + 1)) ** 2
    share = np.clip(_ratio(near + more * most, size + more), 0, 1)
    return (share / (share + FALLS * (1 - share))).astype(np.float32)


def together(
    plate: NDArray,
    samples: Samples,
    clean: tuple[NDArray, NDArray, NDArray] | None = None,
) -> tuple[NDArray[np.float32], float]:
    """Put a plate and samples of the truth together.

    Parameters
    ----------
    plate : (H, W, 4) float
        Scene-linear, premultiplied.
    samples : Samples
    clean : three (H, W, 3) float, optional
        Both renders and their mean, each denoised by itself.

    Returns
    -------
    picture : (H, W, 4) float32
        Alpha is weighed as light is.
    share : float
        How much of the picture is the plate's on the mean, 0 to 1.

    Raises
    ------
    FieldError
        The pictures have two sizes.
    """
    if plate.shape != samples.one.shape:
        raise FieldError(f"the plate has {plate.shape} pixels and the samples {samples.one.shape}")
    renders = samples.one[..., :3], samples.two[..., :3]
    render = samples.mean.copy()
    if clean is None:
        share = plate_share(plate[..., :3], renders, renders)
    else:
        share = plate_share(plate[..., :3], renders, clean[:2])
        render[..., :3] = clean[2]
    by = share[..., None]
    return (by * plate + (1 - by) * render).astype(np.float32), float(share.mean())


def _ratio(over: NDArray, under: NDArray) -> NDArray[np.float64]:
    """A quotient; 0 where nothing is divided by nothing."""
    return np.divide(over, under, out=np.zeros_like(under), where=under > 0)


def _around(image: NDArray[np.float64], reach: int) -> NDArray[np.float64]:
    """The mean of the square around each pixel, cut at the picture's edges, (H, W)."""
    return _along(_along(image, 0, reach), 1, reach)


def _along(image: NDArray[np.float64], axis: int, reach: int) -> NDArray[np.float64]:
    n = image.shape[axis]
    sums = np.concatenate([np.zeros_like(image.take([0], axis)), image.cumsum(axis)], axis)
    first = np.maximum(np.arange(n) - reach, 0)
    last = np.minimum(np.arange(n) + reach + 1, n)
    count = (last - first).reshape((-1, 1) if axis == 0 else (1, -1))
    return (sums.take(last, axis) - sums.take(first, axis)) / count
