"""Where to take out the noise of a capture: in its moments, in the relit picture, or in both."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from arto.arto_addon.blender import denoise
from arto.arto_addon.world.bake import bake
from arto.core import metrics
from arto.core.light import lamps
from arto.core.light.light import PatchLight
from arto.core.patterns import ONE, U, V
from numpy.typing import NDArray

from . import reference
from .machine import write_rows
from .models import captured, truth
from .worlds import World

WORLDS = ("courtyard", "forest", "interior", "sunset")
RADIUS = 3


def _shared(images: NDArray, guides: dict[str, NDArray]) -> NDArray:
    """Every image of the last axes' (H, W, 3) filtered with the same weights: a cross-bilateral
    filter steered by albedo and normal, so that moments stay moments of one transport."""
    height, width = images.shape[-3:-1]
    total, weights = np.zeros(images.shape, np.float32), np.zeros((height, width, 1), np.float32)
    features = np.concatenate([guides["albedo"] / 0.1, guides["normal"] / 0.2], axis=-1)
    for dy in range(-RADIUS, RADIUS + 1):
        for dx in range(-RADIUS, RADIUS + 1):
            here = slice(max(0, -dy), height - max(0, dy)), slice(max(0, -dx), width - max(0, dx))
            there = slice(max(0, dy), height + min(0, dy)), slice(max(0, dx), width + min(0, dx))
            apart = np.square(features[here] - features[there]).sum(axis=-1, keepdims=True)
            w = np.exp(-apart - (dx * dx + dy * dy) / (2.0 * (RADIUS / 2) ** 2))
            total[..., here[0], here[1], :] += w * images[..., there[0], there[1], :]
            weights[here] += w
    return total / weights


def _one_by_one(images: NDArray, guides: dict[str, NDArray]) -> NDArray:
    """Open Image Denoise on every moment image by itself; moments of one patch then no longer
    belong to one transport, so its mean is held inside the patch."""
    flat = images.reshape(-1, *images.shape[-3:])
    out = np.stack([np.maximum(denoise.denoise(guides, image, clean=True), 0) for image in flat])
    out = out.reshape(images.shape)
    out[:, 1:] = np.minimum(out[:, 1:], out[:, :1])
    return out


def noise(
    path: Path, scene_names: Iterable[str], size: tuple[int, int], samples: int, many: int
) -> list[dict[str, Any]]:
    """Errors with 4x4 linear patches, without the light of lamps, by where noise is taken out.

    The reference is lit by the lamps as well, so the worlds are ones that lamps have little of.
    """
    rows = []
    for scene_name in scene_names:
        source = captured(scene_name, size, samples, adaptive=False)
        data = source.read(0)
        guides = {n: data.guides[n] for n in ("albedo", "normal")}

        def final(picture: NDArray, guides: dict[str, NDArray] = guides) -> NDArray:
            return np.maximum(denoise.denoise(guides, picture, clean=True), 0)

        shared = _shared(data.basis, guides)
        single = _one_by_one(data.basis, guides)
        ways: dict[str, tuple[NDArray, Callable[[NDArray], NDArray]]] = {
            "as it is": (data.basis, lambda p: p),
            "moments, shared weights": (shared, lambda p: p),
            "moments, one by one": (single, lambda p: p),
            "picture": (data.basis, final),
            "moments, shared weights; picture": (shared, final),
            "moments, one by one; picture": (single, final),
        }
        for name in WORLDS:
            scene, one, two = truth(scene_name, World(name), size, many)
            environment = bake(scene, scene.arto.environment_width)
            split = lamps.split(environment)
            bright = 0.0
            if split.worth:
                # their light by a render as good as the reference's
                direct = _lamp_picture(scene_name, size, split.lamps, many)
                environment, bright = split.rest, direct
            light = PatchLight(environment, source.hemicube).polynomial((ONE, U, V))
            mean, seen = (one.rgb + two.rgb) / 2, one.alpha > 0.999
            for way, (basis, after) in ways.items():
                picture = np.einsum("kpc,kphwc->hwc", light.astype(np.float32), basis)
                picture = after(picture) + bright
                rows.append(
                    {
                        "scene": scene_name,
                        "hdri": name,
                        "method": way,
                        "samples": samples,
                        "mean_relative_error": metrics.mean_relative_error(picture, mean, seen),
                        "noise_floor": metrics.mean_relative_error(one.rgb, two.rgb, seen),
                    }
                )
            print(f"{scene_name} {name} done", flush=True)
        write_rows(path, rows)
    return rows


def _lamp_picture(
    scene_name: str, size: tuple[int, int], light: Any, samples: int
) -> NDArray[np.float32]:
    """Cycles under a map of lamps alone."""
    from .worlds import _packed, _set_world

    scene = reference.new_scene(scene_name, *size)
    _set_world(scene, _packed("lamps", light.image[::-1]), 0.0, 1.0)
    return reference.render(scene, samples, 4).rgb


def table(rows: list[dict[str, Any]]) -> str:
    """Markdown: ways against worlds, a table a scene."""
    lines = []
    for scene in dict.fromkeys(r["scene"] for r in rows):
        mine = [r for r in rows if r["scene"] == scene]
        names = list(dict.fromkeys(r["hdri"] for r in mine))
        lines += [f"| {scene} | " + " | ".join(names) + " |", "|---" * (len(names) + 1) + "|"]
        floors = [next(r for r in mine if r["hdri"] == n)["noise_floor"] for n in names]
        lines.append("| noise floor | " + " | ".join(f"{f:.3f}" for f in floors) + " |")
        for way in dict.fromkeys(r["method"] for r in mine):
            cells = [f"{r['mean_relative_error']:.3f}" for r in mine if r["method"] == way]
            lines.append(f"| {way} | " + " | ".join(cells) + " |")
        lines.append("")
    return "\n".join(lines)
