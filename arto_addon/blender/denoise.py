"""Open Image Denoise, through the compositor's Denoise node, so that no library ships.

Some builds of Blender have the node without the library: it then hands its input through without a
word. So a picture of known noise is denoised once, and what cannot denoise says so.
"""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from .colour import working_space
from .compositing import choose, darkroom, mixed

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
    with darkroom("ARTO Denoise") as on:
        tree = on.tree

        def source(name: str, pixels: NDArray, space: str) -> bpy.types.NodeSocket:
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
        if like is not None:
            for name in _DENOISER:
                setattr(on.scene.render, name, getattr(like.render, name))
        return np.ascontiguousarray(on.composite(total, (width, height), "denoising")[..., :3])
