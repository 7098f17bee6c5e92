"""How a page shows scene-linear light: a table of colours, read by tetrahedra.

The table is what the artist's view transform makes of colours on a grid. The grid is even in stops,
and near black it is even in light.

Examples
--------
>>> grid = grid_of(5)
>>> grid.shape, grid[0, 0, 0].tolist(), grid[4, 4, 4].round(2).tolist()
((5, 5, 5, 3), [0.0, 0.0, 0.0], [16.29, 16.29, 16.29])
>>> table = (np.stack([shaped(grid[..., c]) for c in range(3)], axis=-1) * 255).round()
>>> shown(table.astype(np.uint8), np.array([[0.0, grid[2, 2, 2, 1], 50.0]])).round(2).tolist()
[[0.0, 0.5, 1.0]]
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Middle grey stands so many stops above where the grid becomes even in light, and so many below
# its end.
GREY, BELOW, ALL = 0.18, 10.0, 16.5
# Places along a side of the table.
SIDE = 33
_END = np.log2(2.0**ALL + 1)


def shaped(light: NDArray) -> NDArray:
    """Bring light to where it is along the grid.

    Parameters
    ----------
    light : array of float
        Scene-linear.

    Returns
    -------
    array of float
        0 to 1.
    """
    at = np.log2(np.maximum(light, 0) / GREY * 2.0**BELOW + 1) / _END
    return np.clip(at, 0, 1)


def grid_of(side: int = SIDE) -> NDArray[np.float64]:
    """Give the colours of the grid.

    Parameters
    ----------
    side : int

    Returns
    -------
    (side, side, side, 3) float64
        Scene-linear; the axes are blue, green and red.
    """
    along = (2.0 ** (np.linspace(0, 1, side) * _END) - 1) * GREY / 2.0**BELOW
    blue, green, red = np.meshgrid(along, along, along, indexing="ij")
    return np.stack([red, green, blue], axis=-1)


def shown(table: NDArray[np.uint8] | None, light: NDArray) -> NDArray[np.float64]:
    """Show light.

    Parameters
    ----------
    table : (side, side, side, 3) uint8, optional
        What the colours of the grid look like; without it light is shown by the curve of sRGB.
    light : (n, 3) float
        Scene-linear.

    Returns
    -------
    (n, 3) float64
        Of the screen, 0 to 1.
    """
    if table is None:
        x = np.clip(light, 0, 1)
        return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
    last = len(table) - 1
    at = shaped(light) * last
    low = np.minimum(at.astype(np.intp), last - 1)
    part = at - low
    # along the axes in the order of how far the place is from the cell's lowest corner
    order = np.argsort(-part, axis=-1, kind="stable")
    sizes = np.take_along_axis(part, order, axis=-1)
    corner = low.copy()
    rows = np.arange(len(light))
    out = table[corner[:, 2], corner[:, 1], corner[:, 0]] * (1 - sizes[:, :1])
    for i in range(3):
        corner[rows, order[:, i]] += 1
        after = sizes[:, i + 1] if i < 2 else 0
        step = (sizes[:, i] - after)[:, None]
        out = out + table[corner[:, 2], corner[:, 1], corner[:, 0]] * step
    return out / 255
