"""Reference renders: what Cycles itself shows under a world, kept by content.

A reference is named by a hash of everything that decides it (the scene's script, the world, the
size, samples and seed, Blender's version), so none is rendered twice and none is used for another.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from arto.arto_addon.blender.output import float_exr
from arto.core import exr
from arto.core.files import whole
from numpy.typing import NDArray

from . import building, hard_scenes, scenes, worlds
from .worlds import World

CACHE = Path("out/references")


@dataclass(frozen=True)
class Picture:
    """A finished render: rgb (H, W, 3) with the world behind, alpha and material index (H, W)."""

    rgb: NDArray[np.float32]
    alpha: NDArray[np.float32]
    index: NDArray[np.int32]
    seconds: float


def new_scene(name: str, width: int, height: int) -> bpy.types.Scene:
    """One of `scenes.SCENES`, from nothing, with ARTO's settings on it."""
    scene = scenes.SCENES[name](width=width, height=height)
    registered()
    scene.arto.keep = "always"  # they are looked at in many ways
    return scene


def registered() -> None:
    """ARTO's settings on every scene."""
    if not hasattr(bpy.types.Scene, "arto"):
        import arto

        arto.register()


def render(scene: bpy.types.Scene, samples: int, seed: int, denoise: bool = False) -> Picture:
    """Render the scene as it is, with that many samples, transparent, without clamping."""
    parts, seconds = render_passes(scene, samples, seed, denoise)
    combined = parts["Combined"]
    # Blender 4.5 names it otherwise
    number = parts["Object Index"] if "Object Index" in parts else parts["IndexOB"]
    index = np.rint(number[..., 0]).astype(np.int32)
    return Picture(combined[..., :3], combined[..., 3], index, seconds)


def render_passes(
    scene: bpy.types.Scene, samples: int, seed: int, denoise: bool = False
) -> tuple[dict[str, NDArray[np.float32]], float]:
    """The passes of such a render by name, and its seconds."""
    cycles, settings = scene.cycles, scene.render
    cycles.samples, cycles.seed = samples, seed
    cycles.use_denoising = denoise
    cycles.use_adaptive_sampling = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    layer = scene.view_layers[0]
    layer.use_pass_object_index = True
    settings.film_transparent = True
    settings.use_compositing = False
    float_exr(settings)
    path = Path(bpy.app.tempdir) / "reference.exr"
    settings.filepath, settings.use_file_extension = str(path), False
    begun = time.perf_counter()
    bpy.ops.render.render(write_still=True, scene=scene.name)
    seconds = time.perf_counter() - begun
    return {name.rsplit(".", 1)[-1]: pixels for name, pixels in exr.read(path).items()}, seconds


def content_key(**decides: Any) -> str:
    """A name for what these values, the scripts of scene and world and Blender's version decide."""
    made = inspect.getsourcefile(scenes.SCENES[decides["scene"]])
    files = {building.__file__, worlds.__file__, made or ""}
    if made and not Path(made).samefile(hard_scenes.__file__):
        files.add(scenes.__file__)  # others may build on what is there
    script = b"".join(Path(f).read_bytes() for f in sorted(files, key=lambda f: Path(f).name))
    text = json.dumps([bpy.app.version_string, decides], sort_keys=True).encode()
    return hashlib.sha256(script + text).hexdigest()[:20]


def reference(
    scene_name: str,
    world: World,
    size: tuple[int, int],
    samples: int,
    seed: int,
    make: Callable[[], bpy.types.Scene],
    denoise: bool = False,
) -> Picture:
    """The picture of a scene under a world, from the cache or rendered now (`make` the scene)."""
    key = content_key(
        scene=scene_name, world=world.label, size=size, samples=samples, seed=seed, denoise=denoise
    )
    path = CACHE / f"{scene_name}_{world.label}_{samples}_{key}.npz"
    if path.is_file():
        with np.load(path) as f:
            return Picture(f["rgb"], f["alpha"], f["index"], float(f["seconds"]))
    scene = make()
    world.apply(scene)
    picture = render(scene, samples, seed, denoise)
    with whole(path) as partial, partial.open("wb") as file:
        np.savez(
            file,
            rgb=picture.rgb,
            alpha=picture.alpha,
            index=picture.index,
            seconds=np.float64(picture.seconds),
        )
    return picture
