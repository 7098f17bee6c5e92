"""The light of a kit, worked out on arrays: what a direction gets, and the kit as a map.

The nodes in Blender do the same arithmetic. A test compares the two.

Examples
--------
>>> from arto.core.kit.light import Light
>>> lamp = Light("Lamp", azimuth=90.0, width=20.0, height=10.0)
>>> ahead = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])  # towards the lamp, and away
>>> cover, shade = profile(lamp, ahead)
>>> cover.tolist(), shade.tolist()[0]
([1.0, 0.0], 1.0)
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..light.environment import Environment, directions, sample_directions
from .light import Blend, Kind, Light
from .model import Base, BaseKind, Kit

# The least softness, so that a hard edge is one step.
HARD = 1e-4
# A light gets so many samples along its smallest side, at least, where a map is made.
_ACROSS = 24
# The most samples along a side of a texel.
_FINEST = 64


def frame(light: Light) -> NDArray[np.float64]:
    """Give the axes of a light, as seen from the scene.

    Parameters
    ----------
    light : Light

    Returns
    -------
    (3, 3) float64
        Rows: to the right, up, and towards the light. The roll turns right to down.
    """
    azimuth, elevation = math.radians(light.azimuth), math.radians(light.elevation)
    cos, sin = math.cos(elevation), math.sin(elevation)
    ahead = np.array([math.cos(azimuth) * cos, math.sin(azimuth) * cos, sin])
    right = np.array([math.sin(azimuth), -math.cos(azimuth), 0.0])
    up = np.cross(right, ahead)
    roll = math.radians(light.roll)
    return np.stack(
        [
            math.cos(roll) * right - math.sin(roll) * up,
            math.sin(roll) * right + math.cos(roll) * up,
            ahead,
        ]
    )


def aimed(direction: NDArray) -> tuple[float, float]:
    """Give the azimuth and the elevation of a direction.

    Parameters
    ----------
    direction : (3,) float
        Of any length but 0.

    Returns
    -------
    tuple of 2 float
        Degrees.
    """
    x, y, z = (float(part) for part in direction)
    return math.degrees(math.atan2(y, x)), math.degrees(math.atan2(z, math.hypot(x, y)))


def _edge(t: NDArray, softness: float) -> NDArray:
    """1 inside, 0 from 1 on, smooth over the softness."""
    s = np.clip((1 - t) / max(softness, HARD), 0, 1)
    return s * s * (3 - 2 * s)


def placed(light: Light, around: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Where directions meet the plane of a light.

    Parameters
    ----------
    light : Light
    around : (..., 3) float
        Directions.

    Returns
    -------
    x, y : (...) float64
        -1 to 1 within the light, to the right and up.
    there : (...) bool
        Whether the plane is ahead.
    """
    right, up, ahead = np.moveaxis(around @ frame(light).T, -1, 0)
    depth = np.maximum(ahead, 1e-6)
    half_x, half_y = light.sides
    return right / (depth * half_x), up / (depth * half_y), ahead > 1e-6


def profile(light: Light, around: NDArray) -> tuple[NDArray, NDArray]:
    """How much of a light stands in some directions.

    Parameters
    ----------
    light : Light
    around : (..., 3) float
        Directions, of any length but 0.

    Returns
    -------
    cover : (...) float64
        1 inside the shape, 0 outside, between on a soft edge.
    shade : (...) float64
        The brightness by gradient and slope, 0 to 1.
    """
    x, y, there = placed(light, around)
    soft = light.softness
    if light.kind in (Kind.RECTANGLE, Kind.PICTURE, Kind.FLAG):
        out = np.maximum(np.abs(x), np.abs(y))
        cover = _edge(np.abs(x), soft) * _edge(np.abs(y), soft)
    elif light.kind is Kind.STRIP:
        half_x, half_y = light.sides
        r = min(half_x, half_y)
        past_x = np.maximum(np.abs(x) * half_x - (half_x - r), 0)
        past_y = np.maximum(np.abs(y) * half_y - (half_y - r), 0)
        out = np.hypot(past_x, past_y) / r
        cover = _edge(out, soft)
    else:
        out = np.hypot(x, y)
        if light.kind is Kind.RING:
            out = np.abs(2 * out - (1 + light.hole)) / (1 - light.hole)
        cover = _edge(out, soft)
    shade = 1 + min(light.gradient, 0.0) - light.gradient * np.minimum(out, 1) ** 2
    slope = light.slope
    shade = shade * np.clip(1 - abs(slope) / 2 + slope / 2 * y, 0, 1)
    return np.where(there, cover, 0.0), shade


def over(
    under: NDArray, light: Light, around: NDArray, picture: NDArray | None = None
) -> NDArray[np.float64]:
    """Put a light before what is behind it.

    Parameters
    ----------
    under : (..., 3) float
        The radiance behind the light.
    light : Light
    around : (..., 3) float
        The directions.
    picture : (H, W, 4) float, optional
        The pixels of a light of the kind PICTURE, scene-linear, alpha premultiplied, rows top-down.

    Returns
    -------
    (..., 3) float64
    """
    cover, shade = profile(light, around)
    cover, shade = (cover * light.amount)[..., None], shade[..., None]
    emits = shade * np.array(light.radiance)
    if light.kind is Kind.PICTURE and picture is not None:
        found = _looked_up(picture, *placed(light, around)[:2])
        # A picture's colours are premultiplied.
        emits = emits * found[..., :3] / np.maximum(found[..., 3:], 1e-6)
        cover = cover * found[..., 3:]
    if light.blend is Blend.MULTIPLY:
        return under * (1 - cover + cover * emits)
    kept = 1 - cover if light.blend is Blend.OVER else 1.0
    return under * kept + cover * emits


def _looked_up(picture: NDArray, x: NDArray, y: NDArray) -> NDArray:
    """The nearest pixels of a picture; nothing outside."""
    height, width = picture.shape[:2]
    column = np.clip(((x + 1) / 2 * width).astype(int), 0, width - 1)
    row = np.clip(((1 - y) / 2 * height).astype(int), 0, height - 1)
    return picture[row, column]


def gradient(base: Base, around: NDArray) -> NDArray[np.float64]:
    """The colours of a gradient, by the elevation.

    Parameters
    ----------
    base : Base
    around : (..., 3) float
        Directions of length 1.

    Returns
    -------
    (..., 3) float64
    """
    top, horizon, bottom = (np.array(c) for c in (base.top, base.horizon, base.bottom))
    z = around[..., 2:]
    far = np.where(z > 0, top, bottom)
    return (horizon + (far - horizon) * np.abs(z)) * base.strength


def base_map(
    base: Base, height: int, hdri: Environment | None = None, turn: float = 0.0
) -> NDArray[np.float64]:
    """The light of a base as a map.

    Parameters
    ----------
    base : Base
    height : int
        Rows; there are twice as many columns.
    hdri : Environment, optional
        The pixels of the base's HDRI, not turned and not blurred.
    turn : float
        The turn of the whole kit, in degrees.

    Returns
    -------
    (H, 2 H, 3) float64
    """
    if base.kind is BaseKind.HDRI and hdri is not None:
        whole = Environment(hdri.image, hdri.turn + math.radians(base.turn + turn))
        return _blurred(whole, height, base.blur) * base.strength
    if base.kind is BaseKind.GRADIENT:
        azimuth, latitude, _ = sample_directions(height, 2 * height, 1)
        return gradient(base, directions(azimuth, latitude))
    return np.zeros((height, 2 * height, 3))


def _blurred(hdri: Environment, height: int, blur: float) -> NDArray[np.float64]:
    """Means of an HDRI over the texels of a map, and over a disc where it is blurred."""
    finer = max(1, min(4, math.ceil(hdri.image.shape[0] / height)))
    azimuth, latitude, _ = sample_directions(height, 2 * height, finer)
    around = directions(azimuth, latitude)
    if blur <= 0:
        found = hdri.at(around)
    else:
        found = np.mean([hdri.at(around + shift) for shift in _disc(blur)], axis=0)
    blocks = found.reshape(height, finer, 2 * height, finer, 3)
    return blocks.mean(axis=(1, 3), dtype=np.float64)


def _disc(blur: float, count: int = 48) -> NDArray[np.float64]:
    """Points spread evenly in a ball, whose radius is the tangent of the blur."""
    i = np.arange(count) + 0.5
    z, turn = 1 - 2 * i / count, i * math.pi * (1 + math.sqrt(5))
    across = np.sqrt(1 - z * z)
    sphere = np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=-1)
    radius = ((i * 0.618034) % 1) ** (1 / 3)
    return sphere * (radius * math.tan(math.radians(min(blur, 80.0))))[:, None]


def map_of(
    kit: Kit,
    height: int,
    base: NDArray | None = None,
    pictures: dict[str, NDArray] | None = None,
) -> Environment:
    """Work out the light of a kit as an environment map, each texel the mean over its samples.

    Parameters
    ----------
    kit : Kit
        The backdrop is left out: it lights nothing.
    height : int
        Rows; there are twice as many columns.
    base : (H, 2 H, 3) float, optional
        What the base gives, see `base_map`; needed where the base is an HDRI.
    pictures : dict of str to (h, w, 4) float, optional
        The pixels of pictures, by the name of the light.

    Returns
    -------
    Environment
        Its turn is 0: the turn of the kit is in the texels.
    """
    image = base_map(kit.base, height) if base is None else np.array(base, np.float64)
    for light in kit.lit:
        turned = light.__class__(**{**vars(light), "azimuth": light.azimuth - kit.turn})
        rows, columns = _bounds(turned, height)
        finer = _finer(turned, height)
        azimuth, latitude, weight = sample_directions(height, 2 * height, finer)
        columns = np.concatenate([np.arange(c * finer, (c + 1) * finer) for c in columns])
        fine = slice(rows.start * finer, rows.stop * finer)
        around = directions(azimuth[columns], latitude[fine])
        texels = columns[::finer] // finer
        under = image[rows][:, texels]
        behind = np.repeat(np.repeat(under, finer, 0), finer, 1)
        picture = (pictures or {}).get(light.name)
        found = over(behind, turned, around, picture) * weight[fine][:, None, None]
        blocks = found.reshape(len(under), finer, len(texels), finer, 3).sum(axis=(1, 3))
        share = weight[fine].reshape(len(under), finer).sum(axis=1) * finer
        image[rows.start : rows.stop, texels] = blocks / share[:, None, None]
    return Environment((image * kit.strength * np.array(kit.tint)).astype(np.float32))


def _finer(light: Light, height: int) -> int:
    """Samples along the side of a texel."""
    texel = 180 / height
    return int(np.clip(math.ceil(_ACROSS * texel / light.smallest), 2, _FINEST))


def _bounds(light: Light, height: int) -> tuple[slice, NDArray[np.intp]]:
    """The rows and the columns of a map that a light may touch."""
    half_x, half_y = light.sides
    reach = math.degrees(math.atan(math.hypot(half_x, half_y))) + 180 / height
    top, bottom = light.elevation + reach, light.elevation - reach
    first = max(0, math.floor((90 - top) / 180 * height))
    last = min(height, math.ceil((90 - bottom) / 180 * height))
    width = 2 * height
    if top >= 90 or bottom <= -90:
        return slice(first, last), np.arange(width)
    ratio = math.sin(math.radians(reach)) / math.cos(math.radians(light.elevation))
    if ratio >= 1:
        return slice(first, last), np.arange(width)
    across = math.degrees(math.asin(ratio)) / 360 * width + 1
    middle = (0.5 - light.azimuth / 360) * width
    columns = np.arange(math.floor(middle - across), math.ceil(middle + across) + 1)
    return slice(first, last), np.unique(columns % width)
