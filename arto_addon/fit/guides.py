"""The guides of a field: its albedo and normals, which steer the denoiser of relit pictures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.errors import FieldError
from ...core.field.field import Field
from ...core.field.writer import replace_layers, write_head
from ..blender import denoise
from ..work import Progress, Steps

# With so many samples of a capture or more, the noise of its guides does no harm. In glass, where a
# guide shows what is behind, 64 samples leave a screen of dots (docs/measurements.md).
CLEAN_SAMPLES = 1024


def guides_of(field: Field) -> dict[str, NDArray]:
    """The guides that a field carries, by name.

    Raises FieldError where one is no number somewhere: a denoiser would spread it.
    """
    names = ("albedo", "normal")
    found = {n: field.layer(n) for n in names if field.has_layer(n)}
    for name, pixels in found.items():
        if not np.isfinite(pixels).all():
            raise FieldError(
                f"'{name}' in {field.folder} is infinite or not a number in some pixels: capture "
                "again, or turn Denoise off"
            )
    return found


def clean(field: Field) -> bool:
    """Whether a field's guides have next to no noise, by their samples or as they were denoised."""
    about = field.about
    return about.guides == CLEAN or (about.samples or 0) >= CLEAN_SAMPLES


# What a field's description says of guides that were denoised when the field was written.
CLEAN = "clean"


def cleaned(scene: bpy.types.Scene, folder: Path) -> Steps[None]:
    """Denoise the guides of a new field, so that no relight has to.

    Nothing is done where the setting `denoise` is off or this Blender cannot denoise.
    """
    field = Field(folder)
    if not scene.arto.denoise or clean(field) or not denoise.available():
        return
    guides = guides_of(field)
    if not guides:
        return
    yield Progress(0.99, "denoising the guides")
    replace_layers(field, denoised(guides, scene))
    write_head(folder, replace(field.head, about=replace(field.about, guides=CLEAN)))


def denoised(guides: dict[str, NDArray], like: bpy.types.Scene | None) -> dict[str, NDArray]:
    """Denoise guides, by name. like: the scene whose settings of the denoiser are used."""
    found = {}
    for name, pixels in guides.items():
        # A normal is from -1 to 1, and the denoiser of pictures takes no numbers below 0.
        low, span = (-1.0, 2.0) if name == "normal" else (0.0, 1.0)
        noisy = ((pixels - low) / span).astype(np.float32)
        found[name] = denoise.denoise({}, noisy, like=like) * span + low
    return found
