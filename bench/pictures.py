"""Pictures of results, for eyes: exposure, display transform, error maps."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

mpl.use("Agg")
import matplotlib.pyplot as plt


def exposure_for(picture: NDArray, mask: NDArray | None = None) -> float:
    """A factor that brings the picture's bright parts just under white."""
    shown = picture if mask is None else picture[mask]
    return 0.8 / max(float(np.percentile(shown, 95)), 1e-9)


def display(picture: NDArray, exposure: float) -> NDArray[np.float64]:
    """Scene-linear light -> sRGB values in [0, 1], after `exposure`."""
    x = np.clip(picture.astype(np.float64) * exposure, 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def comparison(
    path: Path,
    reference: NDArray,
    relit: NDArray,
    error: NDArray,
    titles: tuple[str, str, str],
    most: float = 0.2,
) -> None:
    """Reference, relit and relative error side by side.

    reference, relit: (H, W, 3) scene-linear; error: (H, W), NaN where it does not count; most: the
    error at the end of the colour scale.
    """
    height, width = reference.shape[:2]
    exposure = exposure_for(reference, ~np.isnan(error))
    figure, axes = plt.subplots(1, 3, figsize=(15, 5 * height / width + 0.6), layout="constrained")
    for axis, picture, title in zip(axes, (reference, relit), titles, strict=False):
        axis.imshow(display(picture, exposure), interpolation="nearest")
        axis.set_title(title)
    shown = axes[2].imshow(error, vmin=0, vmax=most, cmap="magma", interpolation="nearest")
    axes[2].set_title(titles[2])
    figure.colorbar(shown, ax=axes[2], fraction=0.035)
    for axis in axes:
        axis.set_axis_off()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)
    plt.close(figure)
