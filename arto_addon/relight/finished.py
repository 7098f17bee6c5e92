"""Finish: a plate made better by samples of the truth, until it is told to stop.

Plate and denoised samples are put together, each by how far it can be believed. Where the
plate is off by more than noise, the render takes its place; where the render is noise alone, the
plate. With each round there are more samples, and the picture comes nearer to a long render's.
"""

from __future__ import annotations

import time
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ...core.errors import SceneError
from ...core.finish import Samples, together
from ..blender import denoise
from ..plate import marks, plate
from ..plate.marks import PLATE
from ..plate.names import relit_file
from ..shot.shot import layer_of
from ..work import Steps, Wrote
from ..world.own import gains_of
from . import light_key
from .outputs import check_beside
from .relight import check_finite
from .samples import FIRST, keep, kept, key_now, render, samples_file, truth
from .shown import Shown

# Seconds after which at the latest the picture is written again, as far as samples go that fast.
OFTEN = 60.0
# What the name of the image in Blender ends with.
FINISHED = "Finished"
# In the header: how many samples a pixel there are in all, and in words what was done.
SAMPLES, SAID = "arto.finish samples", "arto.finished"


def finished_file(path: Path) -> Path:
    """The path of the finished picture, beside a plate."""
    return path.with_name(f"{path.stem}_finished.exr")


def finish_plate(scene: bpy.types.Scene, view_layer: str | None = None) -> Steps[Path]:
    """Put the plate and samples of a render together, round by round.

    Each round writes the finished picture and the samples, so that nothing is lost when the work is
    told to stop. It ends by itself at the scene's `finish_samples`, if these are not 0. Returns the
    path of the picture. Raises SceneError where there is no plate, where the plate is out of date,
    has the scene's lamps at other gains, or has shadow catchers; CancelledError.
    """
    layer = view_layer or layer_of(scene)
    path = relit_file(scene)
    if not path.is_file():
        raise SceneError(f"there is no plate {path} to finish: press Relight first")
    out, header, key = finished_file(path), exr.header(path), key_now(scene, layer)
    _check(scene, header, key)
    for file in (out, samples_file(path)):
        check_beside(scene, file, path)
    shown = Shown(scene, layer)
    there = next(iter(exr.read(plate.shown_file(path, header)).values()))
    check_finite(there, f"the plate {path}")
    samples, most = kept(path, key), scene.arto.finish_samples
    if samples is not None:
        yield from _written(shown, path, key, there, samples, 0.0)
    with truth(scene, layer) as on:
        seed, fast = scene.cycles.seed, FIRST / OFTEN
        while samples is None or not most or 2 * samples.count < most:
            done = samples.count if samples else 0
            # twice as many each round, and no more than a minute's
            wanted = max(1, min(done or FIRST, round(fast * OFTEN)))
            if most:
                wanted = max(1, min(wanted, -(-most // 2) - done))
            begun = time.perf_counter()
            part = (2 * done / most, 2 * wanted / most) if most else (0.0, 0.0)
            fresh = yield from render(on, seed, done, wanted, *part)
            fast = wanted / max(time.perf_counter() - begun, 1e-3)
            if fresh.one.shape != there.shape:
                raise SceneError("the plate has another size than a render now: Relight first")
            samples = samples.more(fresh) if samples else fresh
            keep(scene, path, key, samples)
            share = 2 * samples.count / most if most else 0.0
            yield from _written(shown, path, key, there, samples, min(share, 1.0))
    return out


def _check(scene: bpy.types.Scene, header: dict[str, object], key: str) -> None:
    """Raise SceneError where a plate is not what a render of the scene shows now."""
    if header.get(light_key.HEADER) != key:
        raise SceneError(
            "the light, the scene or the settings have changed since this plate: press Relight "
            "first, then Finish"
        )
    if plate.CATCHER in header:
        raise SceneError(
            "Finish knows no shadow catchers: their shadows are a quotient of two renders, which "
            "cannot be added up sample by sample"
        )
    if scene.arto.own_lamps != 1 or any(gain != 1 for gain in gains_of(scene).values()):
        raise SceneError(
            "the plate has the scene's lamps at other gains than a render has: set them to 1, or "
            "change the lamps themselves and capture again"
        )


def _written(
    shown: Shown, path: Path, key: str, there: NDArray[np.float32], samples: Samples, share: float
) -> Steps[None]:
    """Put the plate and the denoised samples together, and write the picture."""
    scene, out = shown.scene, finished_file(path)
    clean, denoised = None, "no"
    if scene.arto.denoise and denoise.available():
        # what is behind the things is sharp, and the guides do not know it
        alpha = shown.field.layer("alpha")[..., None]
        noisy = (picture[..., :3] for picture in (samples.one, samples.two, samples.mean))
        steer = shown.guides
        if samples.guides is not None:
            steer = {"albedo": samples.guides[..., :3], "normal": samples.guides[..., 3:]}
        one, two, both = (
            alpha * denoise.denoise(steer, p, like=scene) + (1 - alpha) * p for p in noisy
        )
        clean, denoised = (one, two, both), "Open Image Denoise"
    picture, of_plate = together(there, samples, clean)
    said = f"{2 * samples.count} samples and the plate, which has {of_plate:.0%} of the picture"
    about = {
        light_key.HEADER: key, SAMPLES: str(2 * samples.count), SAID: said, PLATE: path.name,
        "arto.denoised": denoised,
    }  # fmt: skip
    marks.check(out, path, scene.arto.overwrite)
    plate.write(scene, out, picture, {k.removeprefix("arto."): v for k, v in about.items()})
    yield Wrote(share, f"finished with {said}", out)
