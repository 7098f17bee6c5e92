"""Open Image Denoise, through the compositor's Denoise node, so that ARTO ships no library.

Some builds of Blender have the node without the library. The node then hands its input through and
gives no error. So `available` denoises a picture of known noise once and looks at the result.
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
    """Whether this Blender says that it can denoise; None where it says nothing.

    This takes no time, so a panel can ask it. `available` renders to find out.
    """
    try:
        import _cycles
    except ImportError:
        return None
    return getattr(_cycles, "with_openimagedenoise", None)


def available() -> bool:
    """Whether this Blender really denoises, tried once."""
    if not _available:
        rng = np.random.default_rng(0)
        noisy = rng.exponential(size=(64, 64, 3)).astype(np.float32)
        _available.append(bool(denoise({}, noisy).std() < 0.5 * noisy.std()))
    return _available[0]


# A pixel shows a lamp from so many times as much light of the lamps as of the rest on.
SHOWS_LAMP = 2.0


def with_lamps(
    guides: dict[str, NDArray],
    lamps: NDArray[np.float32],
    rest: NDArray[np.float32],
    clean: bool = False,
    like: bpy.types.Scene | None = None,
) -> NDArray[np.float32]:
    """Denoise a picture of the world's lamps and one of the rest, (H, W, 3), and return their sum.

    Each picture by itself is cleaner. But alone in darkness the mirror image of a lamp, a point, is
    a firefly to the denoiser, and comes out as a smear. Where lamps outshine the rest, the sum of
    both pictures is denoised instead.
    """
    each = [np.maximum(denoise(guides, p, clean=clean, like=like), 0) for p in (lamps, rest)]
    by = [p.sum(axis=-1) for p in each]
    times = by[0] / np.maximum(by[1], 1e-9 * max(float(by[1].max()), 1e-30))
    shows = np.clip(np.log2(np.maximum(times, 1e-6) / SHOWS_LAMP) + 0.5, 0, 1)[..., None]
    out = each[0] + each[1]
    if not shows.any():
        return out
    both = np.maximum(denoise(guides, lamps + rest, clean=clean, like=like), 0)
    return np.asarray(out + shows.astype(np.float32) * (both - out))


# The render settings of a scene that the compositor's denoiser reads.
DENOISER = ("compositor_denoise_device", "compositor_denoise_final_quality")


def denoise(
    guides: dict[str, NDArray],
    *pictures: NDArray[np.float32],
    clean: bool = False,
    like: bpy.types.Scene | None = None,
) -> NDArray[np.float32]:
    """Denoise pictures (H, W, 3), scene-linear, each by itself, and return their sum.

    Parts of a picture whose noise differs in size are cleaned better one by one.
    guides: `albedo` and `normal`, (H, W, 3), or neither; clean: whether the guides have next to no
    noise, so that the denoiser need not clean the guides first, which takes longer than the
    pictures; like: the scene whose device and quality of the denoiser are used.
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
            for name in DENOISER:
                setattr(on.scene.render, name, getattr(like.render, name))
        return np.ascontiguousarray(on.composite(total, (width, height), "denoising")[..., :3])
