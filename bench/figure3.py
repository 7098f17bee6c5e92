"""Figure 3 of the paper: the unfolded hemicube with the supports of four pixels."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from arto.core.capture.moments import Moments
from arto.core.supports import BOX

from . import scenes
from .models import captured, truth
from .pictures import display, exposure_for
from .worlds import World

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.patches import Rectangle

# Where each face stands in the unfolded cube, and how its x and y lie there.
_PLACES = {"left": (0, 1), "back": (1, 1), "right": (2, 1), "front": (3, 1), "top": (1, 2),
           "bottom": (1, 0)}  # fmt: skip


def pick(index: np.ndarray, materials: dict[str, int]) -> dict[str, tuple[int, int]]:
    """A pixel (row, column) in the middle of each sphere, and one of the floor beside the glass."""
    out = {}
    for name in ("mirror", "glass", "diffuse"):
        rows, columns = np.nonzero(index == materials[name])
        out[name] = (int(np.median(rows)), int(np.median(columns)))
    rows, columns = np.nonzero(index == materials["glass"])
    out["floor beside the glass"] = (int(rows.max()) + 2, int(np.median(columns)))
    return out


def figure3(path: Path, size: tuple[int, int], samples: int) -> None:
    """Draw the box supports of four pixels; lightness is the coefficient, not linear."""
    name = "four_spheres"
    source = captured(name, size, samples, patterns="moments_uv", adaptive=False)
    data = source.read(0)
    _, picture, _ = truth(name, World("courtyard"), size, 256)
    pixels = pick(picture.index, scenes.MATERIALS[name])
    figure, axes = plt.subplots(1, 5, figsize=(20, 4), layout="constrained")
    axes[0].imshow(display(picture.rgb, exposure_for(picture.rgb)), interpolation="nearest")
    axes[0].set_axis_off()
    cube = source.hemicube
    for axis, (title, (row, column)) in zip(axes[1:], pixels.items(), strict=True):
        axes[0].plot(column, row, "o", mfc="none", mec="red")
        axes[0].annotate(title, (column + 1, row), color="red", fontsize=8)
        basis = data.basis[:, :, row, column]
        size_of = basis[:, 0].sum(axis=-1)
        for k in range(len(cube)):
            moments = Moments.from_basis(basis[k][:, None, :], source.patterns, cube.extent(k))
            u0, u1, v0, v1 = BOX.fit(moments)[0]
            face = cube.grid[k][0]
            x, y = _PLACES[face]
            x0, x1, y0, y1 = (cube.extents[k] + 1) / 2
            axis.add_patch(
                Rectangle((x + x0, y + y0), x1 - x0, y1 - y0, fc="black", ec="0.3", lw=0.5)
            )
            if size_of[k] <= 0:
                continue
            shade = (size_of[k] / size_of.max()) ** 0.4
            corner = (x + x0 + (x1 - x0) * u0, y + y0 + (y1 - y0) * v0)
            extent = (max((x1 - x0) * (u1 - u0), 0.01), max((y1 - y0) * (v1 - v0), 0.01))
            axis.add_patch(Rectangle(corner, *extent, color=str(shade)))
        for face, (x, y) in _PLACES.items():
            axis.text(x + 0.5, y + 0.04, face, color="orange", fontsize=7, ha="center")
        axis.set_xlim(0, 4)
        axis.set_ylim(0, 3)
        axis.set_aspect("equal")
        axis.set_title(title)
        axis.set_axis_off()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=80)
    plt.close(figure)
