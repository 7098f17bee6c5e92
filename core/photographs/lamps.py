"""The lamps of a dome: where they are, how strong they are, and what each gives to a pixel.

A lamp stands for its cell of the sphere. A picture in its light, over the light that it sends to
the thing, times the cell's solid angle, is the picture in a cell whose radiance is 1.

Examples
--------
>>> lamps = Lamps(np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]]), np.ones((2, 3)))
>>> lamps.hemicube("ahead", None).lamps[0]
(0.0, -1.0, 0.0)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..dome import own_reach
from ..errors import HemicubeError, PhotographsError
from ..hemicube import Hemicube
from . import ball, sphere
from .description import Description, Kind
from .opened import Photographs
from .screens import to_hemicube

# A target that a lamp grazes tells nothing: the least cosine between the lamp and the camera.
GRAZES = 0.15
# The direction to a near lamp is taken for one in a block: so many across the picture, of at least
# so many pixels a side.
ACROSS, BLOCK = 32, 8
# Pixels in which a ball is looked for, and that are read at a time where few are kept.
LOOKED, STRIP = 1 << 21, 1 << 22

Rows = Callable[[int, int, int], tuple[NDArray, NDArray[np.bool_]]]


@dataclass(frozen=True)
class Lamps:
    """The lamps of a dome.

    Parameters
    ----------
    directions : (K, 3) float64
        From the thing's middle, of length 1: x right, y up, z towards the camera.
    strengths : (K, 3) float64
        What the lamp sends to a surface that faces it at the thing's middle, relative to others.
    places : (K, 3) float64, optional
        Of near lamps, in the unit of `span`.
    span : float
        The width of what the picture shows.
    absolute : bool
        Whether strengths are in the unit of the pictures, as a white target tells.
    """

    directions: NDArray[np.float64]
    strengths: NDArray[np.float64]
    places: NDArray[np.float64] | None = None
    span: float = 1.0
    absolute: bool = False

    def hemicube(self, view: str, reach: float | None) -> Hemicube:
        """Cut the sphere into the lamps' cells.

        Parameters
        ----------
        view : str
            See `screens.to_hemicube`.
        reach : float, optional
            Degrees; by default as the lamps' spacing has it.

        Returns
        -------
        Hemicube

        Raises
        ------
        PhotographsError
            Two lamps have one direction.
        """
        there = to_hemicube(self.directions, view)
        try:
            return Hemicube(
                lamps=tuple((float(x), float(y), float(z)) for x, y, z in there + 0.0),
                reach=own_reach(there) if reach is None else reach,
            )
        except HemicubeError as e:
            raise PhotographsError(f"these lamps are no dome: {e}") from e

    def near(self, shape: tuple[int, int], first: int, last: int) -> Iterator[Near]:
        """Say what the lamps' nearness does to each block of some rows.

        Parameters
        ----------
        shape : tuple of int
            (height, width) of the whole picture.
        first, last : int
            The rows.

        Yields
        ------
        Near
            Nothing, where the lamps are far.
        """
        if self.places is None:
            return
        height, width = shape
        unit, block = self.span / width, max(BLOCK, -(-width // ACROSS))
        for top in range(first, last, block):
            rows = slice(top, min(top + block, last))
            for left in range(0, width, block):
                columns = slice(left, min(left + block, width))
                x = (np.arange(columns.start, columns.stop) + 0.5 - width / 2) * unit
                y = (height / 2 - np.arange(rows.start, rows.stop) - 0.5) * unit
                across, up, out = (self.places[:, i, None, None] for i in range(3))
                far = (across - x) ** 2 + (up - y[:, None]) ** 2 + out * out
                falls = far / (self.places**2).sum(axis=1)[:, None, None]
                away = self.places - np.array([x.mean(), y.mean(), 0.0])
                away /= np.linalg.norm(away, axis=1, keepdims=True)
                turned = sphere.weights(away, self.directions)
                yield Near(rows, columns, falls.astype(np.float32), turned)


@dataclass(frozen=True)
class Near:
    """What the nearness of lamps does to a block of pixels.

    Parameters
    ----------
    rows, columns : slice
        Of the whole picture.
    falls : (K, h, w) float32
        By how much less light comes to each pixel than to the thing's middle.
    turned : (K, K) float64
        What each lamp would show, if it were far away in its direction, by what all show.
    """

    rows: slice
    columns: slice
    falls: NDArray[np.float32]
    turned: NDArray[np.float64]


def found(photos: Photographs, rows: Rows) -> Lamps:
    """Find where the lamps are and how strong.

    Parameters
    ----------
    photos : Photographs
    rows : callable
        Gives the light of a lamp's photographs in rows from a first to a last, which is left out,
        without what is there without the lamp; and where it is saturated.

    Returns
    -------
    Lamps

    Raises
    ------
    PhotographsError
        The ball shows no lamp, the target is not in the picture, or places have no unit.
    """
    said = photos.said
    count = len(said.lamps)
    given = [lamp.place or lamp.direction for lamp in said.lamps]
    if any(where is None for where in given):
        given = [where or one for where, one in zip(given, _by_ball(photos, rows), strict=True)]
    directions = np.array(given, np.float64)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    places = None
    if any(lamp.place for lamp in said.lamps):
        if said.span is None or not all(lamp.place for lamp in said.lamps):
            raise PhotographsError(
                "the places of near lamps need a unit, and a place of each: say 'span', the width "
                "of what the picture shows at the thing"
            )
        places = np.array([lamp.place for lamp in said.lamps], np.float64)
    strengths = np.array([lamp.strength for lamp in said.lamps], np.float64)
    out = Lamps(directions, strengths, places, said.span or 1.0)
    if said.white is None:
        return out
    x, y, w, h = said.white
    height, width = photos.shape
    if x + w > width or y + h > height:
        raise PhotographsError(
            f"the white target at {x}, {y} of {w} x {h} is not in the picture of {width} x {height}"
        )
    target = np.stack([_median(*rows(k, y, y + h), x, x + w) for k in range(count)])
    # the target faces the camera
    middle = np.array([x + w / 2 - width / 2, height / 2 - y - h / 2, 0]) * out.span / width
    away = directions if places is None else places - middle
    far = np.linalg.norm(away, axis=1)
    cosines = away[:, 2] / far
    if (cosines < GRAZES).any():
        k = int(cosines.argmin())
        raise PhotographsError(
            f"lamp {k} shines past the white target, which faces the camera: say the lamps' "
            "strengths instead ('strength')"
        )
    if not (target > 0).all():
        k = int(target.min(axis=1).argmin())
        raise PhotographsError(f"the white target is black in the light of lamp {k}")
    sent = np.pi * target / cosines[:, None]
    if places is not None:
        sent *= (far**2 / (places * places).sum(axis=1))[:, None]
    return replace(out, strengths=sent, absolute=True)


def _median(
    light: NDArray, bright: NDArray[np.bool_], first: int, last: int
) -> NDArray[np.float64]:
    """The light (3,) of some columns. Raises PhotographsError where it is saturated."""
    if bright[:, first:last].mean() > 0.5:
        raise PhotographsError("the white target is saturated: photograph with a shorter exposure")
    return np.median(light[:, first:last][~bright[:, first:last]], axis=0)


def _by_ball(photos: Photographs, rows: Rows) -> list[tuple[float, ...]]:
    """The lamps' directions by their highlights in a chrome ball."""
    count, (height, width) = len(photos.said.lamps), photos.shape
    circle = photos.said.ball
    if circle is None:
        step = max(1, int(np.sqrt(height * width / LOOKED)))
        mean = sum(small(rows, k, photos.shape, step)[0].sum(axis=-1) for k in range(count))
        x, y, radius = ball.find(np.asarray(mean))
        circle = (x * step, y * step, radius * step)
    x, y, radius = circle
    first, last = max(0, int(y - radius) - 2), min(height, int(y + radius) + 4)
    inside = (x, y - first, radius)
    # a highlight that is saturated is as bright as anything
    return [
        ball.direction(rows(k, first, last)[0].sum(axis=-1), inside, (height, width))
        for k in range(count)
    ]


def small(
    rows: Rows, k: int, shape: tuple[int, int], step: int
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Read every n-th pixel of every n-th row, without more memory than some rows take.

    Parameters
    ----------
    rows : callable
        As of `found`.
    k : int
        The number of the lamp.
    shape : tuple of int
        (height, width) of the picture.
    step : int

    Returns
    -------
    light : (h, w, 3) float32
    saturated : (h, w) bool
    """
    at_once = max(1, STRIP // (shape[1] * step)) * step
    parts = [rows(k, y, min(y + at_once, shape[0])) for y in range(0, shape[0], at_once)]
    light, bright = zip(*((a[::step, ::step], b[::step, ::step]) for a, b in parts), strict=True)
    return np.concatenate(light), np.concatenate(bright)


def check_lit(said: Description) -> None:
    """Check that every lamp has a photograph.

    Parameters
    ----------
    said : Description

    Raises
    ------
    PhotographsError
        A lamp has none.
    """
    there = {p.lamp for p in said.of(Kind.LIGHT)}
    if missing := [k for k in range(len(said.lamps)) if k not in there]:
        raise PhotographsError(f"lamp {missing[0]} has no photograph: add it, or take the lamp out")
