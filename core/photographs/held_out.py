"""Held out: each lamp's picture, predicted from the pictures of the other lamps.

It says what the lamps of a dome allow. A diffuse thing without shadows is predicted well from few
lamps. Where a lamp is predicted badly, there are highlights or shadows that the dome is too coarse
for, or the lamp's direction or strength is wrong.

Examples
--------
>>> d = np.array([[0, 0, 1], [1, 0, 1], [0, 1, 2], [-1, 0, 2], [0, -1, 1], [1, 1, 1]], float)
>>> d /= np.linalg.norm(d, axis=1, keepdims=True)
>>> pictures = (d @ [0.1, 0.2, 0.9])[:, None, None, None] * np.ones((6, 2, 2, 3))
>>> found = held_out(pictures, d)
>>> max(row.error for row in found.rows) < 1e-6, round(found.rows[4].nearest, 2)
(True, 0.82)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import sphere
from .lamps import Lamps

# Lamps that have to be left to predict one.
FEWEST = 3
# A lamp that next to nothing of is seen is judged by this share of the mean lamp's light.
DIM = 0.1


@dataclass(frozen=True)
class Row:
    """How one lamp was predicted.

    Parameters
    ----------
    lamp : int
    apart : float
        Degrees to the nearest other lamp.
    error : float
        The mean difference, over the mean light of the lamp's picture; of a lamp that is hardly
        seen, over a share of the mean light of all lamps' pictures.
    nearest : float
        The same for the picture of the nearest lamp, taken as it is.
    gain : float
        The light of the lamp's picture over that of its prediction: a lamp that is twice as strong
        as it is said to be has 2.
    """

    lamp: int
    apart: float
    error: float
    nearest: float
    gain: float


@dataclass(frozen=True)
class HeldOut:
    """How all lamps were predicted.

    Parameters
    ----------
    rows : tuple of Row
    worst : (H, 3 W, 3) float32
        Of the lamp that was predicted worst: its picture, its prediction, and their difference,
        side by side.
    """

    rows: tuple[Row, ...]
    worst: NDArray[np.float32]

    @property
    def error(self) -> float:
        """The median error over all lamps."""
        return float(np.median([row.error for row in self.rows]))

    def table(self, names: Mapping[int, str] | None = None) -> str:
        """Write the rows as lines of text, the worst first.

        Parameters
        ----------
        names : dict of int to str, optional
            A name of each lamp.

        Returns
        -------
        str
        """
        lines = ["lamp  to the next  error  nearest lamp's error   gain  photograph"]
        for r in sorted(self.rows, key=lambda r: -r.error):
            name = (names or {}).get(r.lamp, "")
            numbers = f"{r.lamp:4d} {r.apart:9.1f} deg {r.error:6.1%} {r.nearest:21.1%}"
            lines.append(f"{numbers} {r.gain:6.2f}  {name}".rstrip())
        return "\n".join(lines)


def held_out(
    pictures: NDArray, directions: NDArray, weight: NDArray | None = None
) -> HeldOut | None:
    """Predict each lamp's picture from the others.

    Parameters
    ----------
    pictures : (K, H, W, 3) float
        In the light of each lamp, for lamps of one strength.
    directions : (K, 3) float
        Of length 1.
    weight : (H, W) float, optional
        How much a pixel counts; 0 beside the thing.

    Returns
    -------
    HeldOut or None
        None for fewer than four lamps.
    """
    count = len(pictures)
    if count <= FEWEST:
        return None
    where = np.ones(pictures.shape[1:3]) if weight is None else np.asarray(weight, np.float64)
    flat = np.nan_to_num(pictures.reshape(count, -1).astype(np.float64))
    share = np.repeat(where.ravel(), 3)
    rows, worst, most = [], np.zeros((0, 0, 3)), -1.0
    least = max(DIM * float((flat @ share).mean()), 1e-30)
    for k in range(count):
        others = np.delete(np.arange(count), k)
        found = sphere.weights(directions[others], directions[k : k + 1])[0] @ flat[others]
        found = np.maximum(found, 0)
        cosines = directions[others] @ directions[k]
        nearest = flat[others[int(cosines.argmax())]]
        total = max(float(share @ flat[k]), least)
        error = float(share @ np.abs(found - flat[k])) / total
        rows.append(
            Row(
                k,
                float(np.degrees(np.arccos(np.clip(cosines.max(), -1, 1)))),
                error,
                float(share @ np.abs(nearest - flat[k])) / total,
                float(share @ flat[k]) / max(float(share @ found), least),
            )
        )
        if error > most:
            most, shape = error, pictures.shape[1:]
            true, guess = flat[k].reshape(shape), found.reshape(shape)
            worst = np.concatenate([true, guess, np.abs(guess - true)], axis=1)
    return HeldOut(tuple(rows), worst.astype(np.float32))


def of_dome(pictures: NDArray, lamps: Lamps, weight: NDArray | None = None) -> HeldOut | None:
    """Predict each lamp's picture from the others, by what is known of the lamps.

    Parameters
    ----------
    pictures : (K, H, W, 3) float
        The light of the photographs, see `Lamps`.
    lamps : Lamps
    weight : (H, W) float, optional

    Returns
    -------
    HeldOut or None
    """
    each = lamps.strengths / lamps.strengths.mean()
    return held_out(pictures / each[:, None, None, :], lamps.directions, weight)
