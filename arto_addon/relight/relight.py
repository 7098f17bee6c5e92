"""Relighting: the scene's world through the field, into an EXR and the compositor (paper 6)."""

from __future__ import annotations

import math
import time

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.field import Field
from ...core.lamps import split
from ...core.light import PatchLight
from ...core.region import Region
from ...core.relight import over
from ...core.relight import relight as relight_field
from ..capture.plan import SAMPLED
from ..shot import paths
from ..shot.shot import check_same_shot, layer_of
from ..shot.status import changed_since
from ..work import Progress, Steps
from ..world.background import background, background_with_holes, holds_out
from ..world.bake import bake
from ..world.check import check_world, differs_by_rays
from ..world.lamp_render import brightness, lamp_light, region_of
from . import denoise, plate

# From this share of the light on the lamps are the picture, and what the field adds is denoised
# with them: by themselves, beside darkness, they come out of the denoiser worse (docs/accuracy.md).
NEARLY_ALL = 0.9
# Alpha from which on nothing is seen behind: the rounding of a mean of many ones.
OPAQUE = 1 - 1e-5
# Fewer samples of the lamps than this have no time to smooth an edge.
LEAST_SAMPLES = 4


def lamp_samples(scene: bpy.types.Scene, share: float) -> int:
    """Samples of the render of lamps that have this share of the light."""
    return max(LEAST_SAMPLES, math.ceil(scene.arto.lamp_samples * share))


def relight(scene: bpy.types.Scene, view_layer: str | None = None) -> Steps:
    """Relight the scene's field with its world and show it: `compute`, then `plate.present`.

    Raises what `compute` raises; nothing of the scene changes but the plate's image and its node in
    the compositor.
    """
    path, seconds = yield from compute(scene, view_layer)
    plate.present(scene, path)
    return path, seconds


def compute(scene: bpy.types.Scene, view_layer: str | None = None) -> Steps:
    """Relight the scene's field with its world; returns (path of the EXR, seconds by part).

    Raises SceneError, CaptureSetError (of another shot), ShotError (another's), FieldError,
    EnvironmentMapError, ExrError, CancelledError; nothing of the scene changes.
    """
    layer = view_layer or layer_of(scene)
    world = check_world(scene, layer)
    scene.view_layers[layer].update()
    settings = scene.arto
    path = paths.relit_file(scene)
    folder = paths.field_folder(scene, layer)
    if not folder.exists() and not paths.capture_folder(scene, layer).exists():
        check_same_shot(scene, paths.nearest(scene, layer), "the reflectance field", layer)
    field = Field(folder)
    check_same_shot(scene, field.about.get("shot"), "the reflectance field", layer)
    changed = changed_since(scene, layer, field.about, now=True)
    if changed:
        # allowed: it is the artist who knows whether it shows
        yield Progress(0.0, f"the scene is not the captured one: {'; '.join(changed[:3])}")
    seconds: dict[str, float] = {}
    last = time.perf_counter()

    def lap(name: str) -> None:
        nonlocal last
        now = time.perf_counter()
        seconds[name] = now - last
        last = now

    yield Progress(0.0, "bringing the world to an environment map")
    if by_rays := differs_by_rays(world):
        yield Progress(0.0, f"the world is {by_rays}")
    environment = whole = bake(scene, settings.environment_width, layer)
    lap("world")
    parts: list[NDArray[np.float32]] = []
    lamps, together = "no", False
    found = split(environment, None if field.hemicube.closed else field.hemicube)
    has_lamps = found.worth
    if settings.lamps:
        if found.worth and not field.about.get("far", True):
            lamps = "no: lamps at infinity would not stand where a near hemicube has them"
            yield Progress(0.3, f"the world's lamps: {lamps}")
        elif found.worth and "view_layer" not in field.about:
            lamps = "no: the field does not say of which view layer it is; capture again"
            yield Progress(0.3, f"the world's lamps: {lamps}")
        elif found.worth:
            samples = lamp_samples(scene, found.share)
            lamps = f"{found.share:.0%} of the world's light, {samples} samples"
            yield Progress(0.2, f"the world's lamps: {lamps}")
            parts.append((yield from lamp_light(scene, field, found.lamps, samples, 0.3)))
            environment, together = found.rest, found.share >= NEARLY_ALL
        lap("lamps")
    yield Progress(0.5, "bringing the environment to the patches")
    light = PatchLight(environment, field.hemicube)
    lap("light")
    yield Progress(0.6, "relighting")
    held = field.about.get("route") == SAMPLED
    picture = relight_field(field, light, 0.0 if held else settings.own_lamps)
    if held:
        # light that only shadow rays bring: how much of it, Cycles lets hang on the whole world
        region = region_of(field).slices
        expected = yield from brightness(scene, field, whole, 0.65)
        for rendered in parts:  # the lamps' light, which is Cycles' already
            expected = np.maximum(expected - rendered[region].mean(axis=(0, 1)), 0)
        found = picture[region][..., :3].mean(axis=(0, 1), dtype=np.float64)
        picture[..., :3] *= np.divide(expected, found, out=np.ones(3), where=found > 0)
        picture[..., :3] += np.float32(settings.own_lamps) * field.layer("own")
    parts.append(picture[..., :3])
    if together:
        parts = [sum(parts)]
    lap("relight")
    denoised = "no"
    if settings.denoise:
        yield Progress(0.7, "denoising")
        if denoise.available():
            clean = field.about.get("samples", 0) >= denoise.CLEAN_SAMPLES
            parts = [denoise.denoise(denoise.guides_of(field), *parts, clean=clean)]
            denoised = "Open Image Denoise"
        else:
            # said here, in the file's header and in the last line
            denoised = "no: this Blender was built without Open Image Denoise"
            yield Progress(0.7, f"denoising: {denoised}")
        lap("denoise")
    picture[..., :3] = sum(parts)
    # a plane laid through a sun beside darkness undershoots; a picture has no negative light
    np.maximum(picture, 0, out=picture)
    if not scene.render.film_transparent:
        yield Progress(0.8, "adding the world behind")
        captured = region_of(field)
        if holds_out(scene, layer):
            behind = background_with_holes(scene, captured, layer)
            picture[..., :3] += behind[..., :3]
            picture[..., 3] = behind[..., 3]
        else:
            # outside a render region Cycles leaves a picture empty
            inside = picture[captured.slices]
            rows, columns = np.nonzero(inside[..., 3] < OPAQUE)
            if len(rows):
                seen = Region.around(rows + captured.y, columns + captured.x)
                there = background(scene, seen, layer, has_lamps)[captured.slices]
                picture[captured.slices] = over(inside, there)
        lap("background")
    yield Progress(0.9, f"writing {path}")
    about = {"scene": scene.name, "world": world.name, "denoised": denoised, "lamps": lamps}
    if scene.render.film_transparent and scene.cycles.film_transparent_glass:
        glass = "opaque: what is seen through it is in it, whatever Transparent Glass says"
        about["glass"] = glass
        yield Progress(0.9, f"glass: {glass}")
    about |= {
        "look": settings.look,
        "world by rays": by_rays,
        "changed since capture": "; ".join(changed),
    }
    plate.write(path, picture, {name: text for name, text in about.items() if text})
    lap("write")
    say = f" (denoised: {denoised})" if settings.denoise else ""
    yield Progress(1.0, f"wrote {path}{say}")
    return path, seconds
