"""Open Image Denoise, through the compositor's Denoise node, so that no library ships.

Some builds of Blender have the node without the library: it then hands its input through without a
word. So a picture of known noise is denoised once, and what cannot denoise says so.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ...core.field.field import Field
from ...core.field.tile_writer import write_layer
from ...core.field.writer import write_head
from ..plate.plate import mixed
from ..work import Progress, Steps
from .colour import working_space
from .compositing import choose, studio

_available: list[bool] = []


def known() -> bool | None:
    """Whether this Blender says that it denoises, at once: a panel cannot try it. None where
    nothing is known."""
    try:
        import _cycles
    except ImportError:
        return None
    return getattr(_cycles, "with_openimagedenoise", None)


def available() -> bool:
    """Whether this Blender really denoises."""
    if not _available:
        rng = np.random.default_rng(0)
        noisy = rng.exponential(size=(64, 64, 3)).astype(np.float32)
        _available.append(bool(denoise({}, noisy).std() < 0.5 * noisy.std()))
    return _available[0]


# From so many samples of a capture on, what is left of noise in its guides does no harm
# (docs/accuracy.md).
CLEAN_SAMPLES = 64


def guides_of(field: Field) -> dict[str, NDArray]:
    """The guides that a field carries, by name."""
    names = ("albedo", "normal")
    return {n: field.layer(n) for n in names if field.has_layer(n)}


def clean(field: Field) -> bool:
    """Whether a field's guides have next to no noise."""
    about = field.about
    return about.get("guides") == CLEAN or about.get("samples", 0) >= CLEAN_SAMPLES


# What a field says of guides that were denoised when it was written.
CLEAN = "clean"


def cleaned(scene: bpy.types.Scene, folder: Path) -> Steps:
    """Denoise the guides of a new field, so that no relight has to, where the scene's relights are
    denoised at all."""
    field = Field(folder)
    guides = guides_of(field)
    if not scene.arto.denoise or clean(field) or not guides or not available():
        return
    yield Progress(0.99, "denoising the guides")
    for name, pixels in guides.items():
        # a normal is from -1 to 1, and a denoiser of pictures knows nothing below 0
        low, span = (-1.0, 2.0) if name == "normal" else (0.0, 1.0)
        noisy = ((pixels - low) / span).astype(np.float32)
        better = denoise({}, noisy, like=scene) * span + low
        for tile in field.tiles:
            write_layer(tile.folder, name, better[tile.region.slices])
    field.head["about"]["guides"] = CLEAN
    write_head(folder, field.head)


# Of a scene's render settings, those of the compositor's denoiser.
_DENOISER = ("compositor_denoise_device", "compositor_denoise_final_quality")


def denoise(
    guides: dict[str, NDArray],
    *pictures: NDArray[np.float32],
    clean: bool = False,
    like: bpy.types.Scene | None = None,
) -> NDArray[np.float32]:
    """The sum of pictures (H, W, 3), scene-linear, each denoised by itself.

    Parts of a picture with noise of different size are cleaned better one by one.
    guides: `albedo` and `normal`, (H, W, 3), or neither; clean: they have next to no noise, and
    need not be denoised themselves, which takes longer than the pictures; like: the scene whose
    denoiser it is, by device and quality.
    """
    height, width = pictures[0].shape[:2]
    with studio("ARTO Denoise") as on:
        tree = on.tree

        def source(name: str, pixels: NDArray, space: str) -> Any:
            path = on.folder / f"{name}.exr"
            exr.write(path, {"": pixels})
            image = bpy.data.images.load(str(path))
            on.made.append(image)
            image.colorspace_settings.name = space
            node = tree.nodes.new("CompositorNodeImage")
            node.image = image
            return node.outputs["Image"]

        steer = {}
        if {"albedo", "normal"} <= guides.keys():
            steer = {
                "Albedo": source("albedo", guides["albedo"], "Non-Color"),
                "Normal": source("normal", guides["normal"], "Non-Color"),
            }
        total = None
        for i, picture in enumerate(pictures):
            node = tree.nodes.new("CompositorNodeDenoise")
            node.inputs["HDR"].default_value = True
            choose(node, "Prefilter", "None" if clean else "Accurate")
            noisy = source(f"picture{i}", picture, working_space())
            for name, socket in {"Image": noisy, **steer}.items():
                tree.links.new(socket, node.inputs[name])
            total = node.outputs[0] if total is None else mixed(tree, "ADD", total, node.outputs[0])
        for name in _DENOISER if like else ():
            setattr(on.scene.render, name, getattr(like.render, name))
        return np.ascontiguousarray(on.composite(total, (width, height), "denoising")[..., :3])
