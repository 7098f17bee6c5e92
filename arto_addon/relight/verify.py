"""Verify: compare the plate with a few samples of a path-traced render of the scene."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from ...core import exr
from ...core.errors import SceneError
from ...core.field.field import Field
from ...core.verify import Verdict, marked, verify
from ..plate import marks, plate
from ..plate.marks import PLATE
from ..plate.names import relit_file
from ..shot import paths
from ..shot.shot import layer_of
from ..work import Progress, Steps
from ..world.own import gains_of
from .samples import FIRST, keep, kept, key_now, render, truth

# The most samples of each of the two renders that a look at a plate adds.
MOST = 256


def verify_file(path: Path) -> Path:
    """The path of the verification, beside a plate: where it differs from a render."""
    return path.with_name(f"{path.stem}_verify.exr")


def verify_plate(scene: bpy.types.Scene, view_layer: str | None = None) -> Steps[Path]:
    """Render the scene twice with a few samples, and compare the plate with both renders.

    The samples are kept: the next time there are twice as many, as long as the light is the same.
    Returns the path of a picture that marks where the plate is off by more than noise. The header
    of the picture has the result in words. Raises SceneError where there is no plate, where its
    size differs from a render's, or where pixels are not finite; CancelledError.
    """
    layer = view_layer or layer_of(scene)
    if scene.arto.photographs:
        raise SceneError(
            f"the scene '{scene.name}' is of photographs, and cannot be rendered: held_out.txt in "
            "the shot's folder says how well the lamps are predicted"
        )
    path = relit_file(scene)
    if not path.is_file():
        raise SceneError(f"there is no plate {path} to verify: press Relight first")
    out = verify_file(path)
    marks.check(out, path, scene.arto.overwrite)
    there = next(iter(exr.read(path).values()))
    key = key_now(scene, layer)
    found = kept(path, key)
    # each time the verdict is of twice the samples
    more = min(found.count, MOST) if found else FIRST
    with truth(scene, layer) as on:
        seed = scene.cycles.seed
        fresh = yield from render(on, seed, found.count if found else 0, more, 0.0, 0.95)
    samples = found.more(fresh) if found else fresh
    keep(scene, path, key, samples)
    if samples.one.shape[:2] != there.shape[:2]:
        raise SceneError("the plate has another size than a render now: press Relight first")
    if bad := int((~np.isfinite(there)).any(axis=-1).sum()):
        raise SceneError(
            f"the plate has {bad} pixels that are infinite or not a number, and cannot be compared"
        )
    yield Progress(0.95, "comparing")
    captured = Field(paths.field_folder(scene, layer)).about.samples or samples.count
    ratio = 2 * samples.count / captured
    verdict = verify(there[..., :3], samples.one[..., :3], samples.two[..., :3], own=ratio)
    told = {"verify": said(scene, verdict), "samples": f"2 x {samples.count}"}
    told[PLATE.removeprefix("arto.")] = path.name
    # All pixels are written, whatever the plate's windows: only Blender shows this file.
    exr.write(out, {"": marked(there, verdict)}, *plate.header_of(scene, told))
    yield Progress(1.0, told["verify"])
    return out


def said(scene: bpy.types.Scene, found: Verdict) -> str:
    """Say in a sentence or two what was found, in words that do not gainsay each other."""
    text = found.line
    settings = scene.arto
    if settings.own_lamps != 1 or any(gain != 1 for gain in gains_of(scene).values()):
        text += ". The plate has the scene's lamps at other gains than a render"
    return text
