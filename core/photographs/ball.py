"""A chrome ball in the pictures: where it is, and the directions of the lamps that shine in it.

Examples
--------
>>> y, x = np.mgrid[:200, :240]
>>> inside = np.hypot(x - 120, y - 90) < 50
>>> picture = np.where(inside, 0.05, 0.4).astype(np.float32)
>>> circle = find(picture)
>>> [round(v) for v in circle]
[120, 90, 50]
>>> picture[88:93, 134:139] = 9.0
>>> [abs(round(float(v), 2)) for v in direction(picture, circle)]
[0.61, 0.0, 0.79]
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import PhotographsError
from .description import Point

# Pixels a side of the picture in which the ball is looked for.
SMALL = 320
# Of the circle's rim, so much must be an edge whose light changes towards the middle.
RIM = 0.72
# Radii that are looked for, as shares of the picture's shorter side.
LEAST, MOST = 0.02, 0.5


def find(grey: NDArray) -> Point:
    """Find the circle of a ball in a picture.

    Parameters
    ----------
    grey : (H, W) float
        Light. The mean over all lamps shows the ball best.

    Returns
    -------
    tuple of float
        x, y and radius in pixels.

    Raises
    ------
    PhotographsError
        There is no circle.
    """
    step = max(1, round(max(grey.shape) / SMALL))
    height, width = (n // step for n in grey.shape)
    if min(height, width) < 16:
        raise PhotographsError("the picture is too small to look for a ball in it")
    small = grey[: height * step, : width * step].reshape(height, step, width, step).mean((1, 3))
    log = np.log(np.maximum(small, 0) + 0.02 * float(np.percentile(small, 99)) + 1e-9)
    down, across = np.gradient(log)
    size = np.hypot(down, across)
    strong = size > max(float(np.percentile(size, 90)), 1e-6)
    ys, xs = np.nonzero(strong)
    gx, gy = across[strong] / size[strong], down[strong] / size[strong]
    if len(ys) > 20000:
        some = np.argsort(-size[strong])[:20000]
        ys, xs, gx, gy = ys[some], xs[some], gx[some], gy[some]
    best, found = RIM, None
    shorter = min(height, width)
    for radius in np.arange(max(3.0, LEAST * shorter), MOST * shorter + 1):
        votes = np.zeros((height, width))
        for side in (-1.0, 1.0):  # the ball is brighter or darker than what is behind it
            x = np.rint(xs + side * radius * gx).astype(int)
            y = np.rint(ys + side * radius * gy).astype(int)
            inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
            np.add.at(votes, (y[inside], x[inside]), 1.0)
        around = _blurred(votes)
        for at in np.argsort(around, axis=None)[-3:].tolist():
            y, x = divmod(at, width)
            rim = _rim(xs - x, ys - y, gx, gy, radius)
            # of two circles that are as whole, the larger is the rim and the smaller lies in it
            if rim * radius**0.1 > best * (found[2] if found else radius) ** 0.1:
                best, found = rim, (float(x), float(y), float(radius))
    if found is None:
        raise PhotographsError(
            "no ball is seen in the photographs: say where it is in photographs.json ('ball': its "
            "x, y and radius in pixels), or say the lamps' directions"
        )
    return _refined(grey, found, step)


def _rim(x: NDArray, y: NDArray, gx: NDArray, gy: NDArray, radius: float) -> float:
    """The share of a circle that is an edge along it. x, y: the edges' places about the middle."""
    away = np.hypot(x, y)
    on = np.abs(away - radius) < 1.5
    along = np.abs(x[on] * gx[on] + y[on] * gy[on]) > 0.93 * away[on]
    turn = np.arctan2(y[on], x[on])[along]
    # parts so short that edges by chance are in few of them
    parts = max(12, int(2 * np.pi * radius / 3))
    met = np.unique(((turn / (2 * np.pi) + 0.5) * parts).astype(int) % parts)
    return len(met) / parts


def _blurred(votes: NDArray) -> NDArray[np.float64]:
    out = np.zeros_like(votes)
    padded = np.pad(votes, 1)
    for dy in range(3):
        for dx in range(3):
            out += padded[dy : dy + votes.shape[0], dx : dx + votes.shape[1]]
    return out


def _refined(grey: NDArray, found: Point, step: int) -> Point:
    """The circle by the strongest edges along its rays, in the pixels of the whole picture."""
    x, y, radius = ((v + 0.5) * step - 0.5 for v in found)
    radius = found[2] * step
    turn = np.linspace(0, 2 * np.pi, 180, endpoint=False)
    for _ in range(3):
        reach = max(2.5 * step, 0.03 * radius)
        r = np.arange(radius - reach, radius + reach, 0.5)
        px = np.rint(x + r * np.cos(turn)[:, None]).astype(int)
        py = np.rint(y + r * np.sin(turn)[:, None]).astype(int)
        there = ((px >= 1) & (px < grey.shape[1] - 1) & (py >= 1) & (py < grey.shape[0] - 1)).all(1)
        if there.sum() < 30:
            return x, y, radius
        rays = grey[py[there], px[there]].astype(np.float64)
        rays = np.log(np.maximum(rays, 0) + 0.02 * float(np.percentile(rays, 99)) + 1e-9)
        slope = np.abs(rays[:, 3:] - rays[:, :-3])
        best = slope.argmax(axis=1)
        strong = slope[np.arange(len(best)), best] > 0.5 * np.median(slope.max(axis=1))
        at = r[best[strong] + 1] + 0.25
        cos, sin = np.cos(turn[there][strong]), np.sin(turn[there][strong])
        # (x - a)^2 + (y - b)^2 = r^2 is linear in a, b and a^2 + b^2 - r^2
        ex, ey = at * cos, at * sin
        fit = np.linalg.lstsq(
            np.stack([2 * ex, 2 * ey, np.ones_like(ex)], axis=1), ex * ex + ey * ey, rcond=None
        )[0]
        radius = float(np.sqrt(max(fit[2] + fit[0] ** 2 + fit[1] ** 2, 1.0)))
        x, y = float(x + fit[0]), float(y + fit[1])
    return x, y, radius


def direction(grey: NDArray, circle: Point, shape: tuple[int, int] | None = None) -> Point:
    """Find the direction of the lamp whose highlight is in a ball.

    The camera is far away: it sees the ball along one direction.

    Parameters
    ----------
    grey : (H, W) float
        Light of the picture in which only this lamp shines.
    circle : tuple of float
        x, y and radius of the ball.
    shape : tuple of int, optional
        (height, width) of the picture, of which `grey` has the rows around the ball.

    Returns
    -------
    tuple of float
        x to the right, y up, z towards the camera, of length 1.

    Raises
    ------
    PhotographsError
        The ball leaves the picture, or there is no highlight in it.
    """
    x, y, radius = circle
    height, width = grey.shape
    if not (radius >= 3 and radius <= x < width - radius and radius <= y < height - radius):
        raise PhotographsError(
            f"the ball of radius {radius:.0f} about column {x:.0f} is not all in the picture of "
            f"{(shape or grey.shape)[1]} x {(shape or grey.shape)[0]}: say where it is in "
            "photographs.json ('ball')"
        )
    top, left = int(y - radius), int(x - radius)
    piece = grey[top : int(y + radius) + 2, left : int(x + radius) + 2].astype(np.float64)
    py, px = np.mgrid[: piece.shape[0], : piece.shape[1]]
    nx, ny = (px + left - x) / radius, -(py + top - y) / radius
    # the outermost rim shows what is behind the ball
    on = nx * nx + ny * ny < 0.95**2
    inside = np.where(on, piece, 0)
    most, usual = float(inside.max()), float(np.median(piece[on]))
    if most <= 3 * max(usual, 0) or most <= 0:
        raise PhotographsError(
            "the ball shows no highlight of the lamp: say the lamp's direction instead"
        )
    bright = on & (piece > 0.5 * (most + usual))
    weight = piece[bright] - usual
    a, b = (float((n[bright] * weight).sum() / weight.sum()) for n in (nx, ny))
    c = float(np.sqrt(max(1 - a * a - b * b, 0.0)))
    # the view along z is mirrored at the normal
    return 2 * c * a, 2 * c * b, 2 * c * c - 1
