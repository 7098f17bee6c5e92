"""Samples of the truth: renders of the scene as it is, in pairs with independent noise, kept.

*Verify* compares a plate with them, and *Finish* puts plate and samples together. They lie beside
the plate with the key of the light they are of, so each goes on where the other stopped.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ...core.capture.names import combined
from ...core.errors import ArtoError, SceneError
from ...core.finish import Samples
from ..plate import marks, plate
from ..plate.marks import PLATE
from ..stage.small import parts_of
from ..stage.stage import Stage, stage
from ..work import Steps
from ..world.check import check_world
from . import light_key

# Samples of each of the two renders of the first round.
FIRST = 16
# Attributes of the file: samples a pixel of each render; what the samples are of.
COUNT, OF = "arto.samples", "arto.samples of"
# Seeds that Blender takes.
_SEEDS = 1 << 31


def samples_file(path: Path) -> Path:
    """The path of the samples, beside a plate: two renders with independent noise."""
    return path.with_name(f"{path.stem}_samples.exr")


def kept(path: Path, key: str) -> Samples | None:
    """The samples that are kept beside a plate; None where there are none of this light.

    key: of the light that they have to be of (`key_now`). What cannot be read counts as none: the
    samples are rendered anew.
    """
    file = samples_file(path)
    try:
        if not marks.is_of(file, path):
            return None
        header = exr.header(file)
        if header.get(OF) != key:
            return None
        parts = exr.read(file)
        guides = np.dstack([parts["albedo"], parts["normal"]])
        return Samples(parts["one"], parts["two"], int(str(header[COUNT])), guides)
    except (ArtoError, OSError, KeyError, ValueError):
        return None


def keep(scene: bpy.types.Scene, path: Path, key: str, samples: Samples) -> None:
    """Keep samples beside a plate. Raises ExrError, SceneError for a file of others there."""
    file = samples_file(path)
    marks.check(file, path, scene.arto.overwrite)
    about = {COUNT: str(samples.count), OF: key, PLATE: path.name}
    told = {name.removeprefix("arto."): said for name, said in about.items()}
    parts = {"one": samples.one, "two": samples.two}
    if samples.guides is not None:
        parts |= {"albedo": samples.guides[..., :3], "normal": samples.guides[..., 3:]}
    exr.write(file, parts, *plate.header_of(scene, told))


def key_now(scene: bpy.types.Scene, view_layer: str) -> str:
    """The key of the light, the things and the settings as they are. Raises SceneError."""
    return light_key.light_key(scene, check_world(scene, view_layer), view_layer)


@contextmanager
def truth(scene: bpy.types.Scene, view_layer: str) -> Iterator[Stage]:
    """A stage that renders the scene as it is, without what hides light or noise."""
    with stage(scene, view_layer) as on:
        on.change("render.engine", "CYCLES")
        on.change("cycles.use_animated_seed", False)
        on.change("cycles.use_layer_samples", "IGNORE")
        on.change("cycles.use_adaptive_sampling", False)
        on.change("cycles.use_denoising", False)
        on.change("cycles.time_limit", 0.0)
        # The plate has all light. A clamped render would leave light out and differ by that.
        on.change("cycles.sample_clamp_direct", 0.0)
        on.change("cycles.sample_clamp_indirect", 0.0)
        on.change("render.use_crop_to_border", False)
        on.change("cycles.use_sample_subset", False)
        for layer in on.scene.view_layers:
            layer.cycles.denoising_store_passes = True
        on.keep_prepared()
        yield on


def render(
    on: Stage, seed: int, before: int, count: int, share: float, span: float
) -> Steps[Samples]:
    """Render `count` samples of each of two renders on the stage of `truth`.

    seed: of the scene; before: how many samples of each there are already, which these go on after;
    share, span: of the whole work. Raises SceneError where a render is not finite.
    """
    found: list[NDArray[np.float32]] = []
    guides: list[NDArray[np.float32]] = []
    cycles = on.scene.cycles
    for number in (1, 2):
        # A seed of its own for each render: which samples of a sequence are the next ones hangs on
        # how many there are in all.
        cycles.samples, cycles.seed = count, (seed + 7919 * number + 104729 * before) % _SEEDS
        text = f"rendering {count} samples to compare with, {number} of 2"
        parts = yield from parts_of(on, text, share + span * (number - 1) / 2, span / 2)
        picture = combined(parts)
        if bad := int((~np.isfinite(picture)).any(axis=-1).sum()):
            raise SceneError(
                f"the render has {bad} pixels that are infinite or not a number, and cannot be "
                "compared"
            )
        found.append(picture)
        guides.append(np.dstack([_pass(parts, "Albedo"), _pass(parts, "Normal")]))
    return Samples(found[0], found[1], count, ((guides[0] + guides[1]) / 2).astype(np.float32))


def _pass(parts: dict[str, NDArray], name: str) -> NDArray[np.float32]:
    """One of the passes that Cycles renders for a denoiser, (H, W, 3)."""
    (found,) = (p for n, p in parts.items() if n.endswith(f"Denoising {name}"))
    return np.asarray(found[..., :3])
