"""Whether photographs agree with the directions of their lamps, if their values are light.

Of most things a pixel's light, where no shadow and no highlight is, is a linear function of the
lamp's direction. If values are taken for light by a wrong curve, it is not.

Examples
--------
>>> rng = np.random.default_rng(0)
>>> d = rng.normal(size=(12, 3)) * (0.6, 0.6, 0.0) + (0, 0, 1)
>>> d /= np.linalg.norm(d, axis=1, keepdims=True)
>>> normals = rng.normal(size=(50, 3)) * (0.4, 0.4, 0.0) + (0, 0, 1)
>>> light = np.maximum(d @ normals.T, 0)
>>> disagreement(light, d) < 1e-6, disagreement(light**0.45, d) > 0.01
(True, True)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .curve import FULL, Curve, srgb

# The lamps that are looked at in a pixel: not the darkest, nor the brightest, as shares of all.
DARK, BRIGHT = 0.4, 0.1
# The fewest lamps, and how much better linear values must agree to be taken for light.
FEWEST, BETTER = 6, 0.8
# How a lamp's direction and the middle of its light go together, where an axis is turned round.
TURNED = -0.7
# The most of the picture's rim that is of a thing that stands alone.
ALONE = 0.02
# Pixels that have to tell, and how bright they are in some lamp's light.
PIXELS, SEEN = 100, 0.1


def disagreement(light: NDArray, directions: NDArray) -> float:
    """Compute how far pixels are from linear functions of the lamps' directions.

    Parameters
    ----------
    light : (K, n) float
        Of n pixels in the light of each lamp, for lamps of one strength.
    directions : (K, 3) float
        Of length 1.

    Returns
    -------
    float
        The median over pixels of the error over the pixel's light.
    """
    count = len(light)
    place = light.argsort(axis=0, kind="stable").argsort(axis=0, kind="stable")
    use = (place >= int(DARK * count)) & (place < max(4, int(np.ceil((1 - BRIGHT) * count))))
    weight = use.astype(np.float64)
    matrix = np.einsum("kn,ki,kj->nij", weight, directions, directions)
    matrix += 1e-9 * np.eye(3)
    asked = np.einsum("kn,ki,kn->ni", weight, directions, light)
    found = np.linalg.solve(matrix, asked[..., None])[..., 0]
    off = (weight * (light - directions @ found.T) ** 2).sum(axis=0)
    whole = (weight * light * light).sum(axis=0)
    seen = whole > 1e-2 * float(whole.max(initial=0))
    return float(np.median(np.sqrt(off[seen] / whole[seen]))) if seen.any() else np.inf


def why_light(values: NDArray, directions: NDArray, strengths: NDArray) -> str:
    """Say why the values of photographs are taken for light, and not for those of a display.

    Parameters
    ----------
    values : (K, n, 3) float
        Of n pixels in the light of each lamp, from 0 to 1.
    directions : (K, 3) float
        Of length 1.
    strengths : (K, 1, 3) float
        Of the lamps.

    Returns
    -------
    str
        Empty where sRGB's curve agrees as well, or too few pixels tell.
    """
    most = values.max(axis=(0, 2))
    some = values[:, (most < FULL) & (most > SEEN)]
    if some.shape[1] < PIXELS:
        return ""
    as_light, as_srgb = (
        disagreement((curve.light(some) / strengths).sum(axis=-1), directions)
        for curve in (Curve(None), srgb())
    )
    if as_light > BETTER * as_srgb:
        return ""
    return (
        "the photographs' values are taken for light, without a curve: so they agree with the "
        f"lamps' directions to {as_light:.1%}, and with the curve of sRGB to {as_srgb:.1%}"
    )


def turned(pictures: NDArray, directions: NDArray, weight: NDArray) -> str:
    """Say whether directions look as if an axis of theirs were turned round.

    A thing that stands alone is brighter on the side of the lamp. Without a mask nothing is said.

    Parameters
    ----------
    pictures : (K, H, W, 3) float
        The light of each lamp.
    directions : (K, 3) float
        Of length 1: x right, y up, z towards the camera.
    weight : (H, W) float
        How much a pixel is the thing.

    Returns
    -------
    str
        Empty where they look right, or too few lamps tell.
    """
    rim = np.concatenate([weight[0], weight[-1], weight[:, 0], weight[:, -1]])
    if float(rim.mean()) > ALONE:  # a ground is brighter below, where lamps are above
        return ""
    grey = np.nan_to_num(pictures.sum(axis=-1)) * weight
    total = grey.sum(axis=(1, 2))
    lit = total > 0.1 * max(float(total.max(initial=0)), 1e-30)
    if lit.sum() < FEWEST:
        return ""
    y, x = np.mgrid[: grey.shape[1], : grey.shape[2]]
    for name, where, there in (("x", x, directions[lit, 0]), ("y", -y, directions[lit, 1])):
        middle = (grey[lit] * where).sum(axis=(1, 2)) / total[lit]
        if there.std() > 0.1 and middle.std() > 1e-6:
            alike = float(np.corrcoef(middle, there)[0, 1])
            if alike < TURNED:
                return (
                    f"the lamps' directions look turned round in {name}: the side away from a lamp "
                    "is the brighter one. x is to the right of the picture, y up in it"
                )
    return ""
