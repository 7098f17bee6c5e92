"""Relighting: the scene's world through the field, into an EXR and the compositor (paper 6)."""

from __future__ import annotations

import time
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.capture.kinds import Route
from ...core.catcher import Caught, catch_seen, of_ground
from ...core.errors import FieldError
from ...core.field.field import Field
from ...core.field.through import ROUNDED, opaque
from ...core.light.environment import Environment
from ...core.light.lamps import Split
from ...core.light.light import PatchLight
from ...core.region import Region
from ...core.relight import over
from ..blender import denoise
from ..capture.drawn import check_drawn
from ..plate import plate
from ..plate.names import relit_file
from ..plate.present import present
from ..shot.shot import check_same_shot, layer_of
from ..work import Progress, Steps, Warned
from ..world import kept
from ..world.background import background, background_with_holes, holds_out, without_holes
from ..world.check import check_given, check_world, differs_by_rays
from ..world.lamp_render import brightness, lamp_light, lamp_samples
from ..world.own import own_of
from . import ahead, files, light_key
from .outputs import check_picture
from .shown import Laps, Light, Ready, Shown, check_film

# From this share of the light on, the lamps' picture and the field's are denoised as a single sum.
# The lamps alone, with darkness beside their light, come out of the denoiser worse
# (docs/accuracy.md).
NEARLY_ALL = 0.9
# From this alpha on nothing is seen behind: a mean of many samples of alpha 1 is rounded to less.
OPAQUE = 1 - 1e-5
# If the lamps have more than this share of the light, every pixel behind the plate looks for them.
# If light below 0 has more than this share, the artist is told.
LEAST_SHARE = 1e-3
# Half of the sphere lies behind a surface, so light that fills half of it loses no samples. Where
# the light has less than the part NARROW of the capture's samples, and fewer than ENOUGH, the
# artist is told.
BEHIND_A_SURFACE, NARROW, ENOUGH = 0.5, 0.2, 64


def relight(
    scene: bpy.types.Scene, view_layer: str | None = None
) -> Steps[tuple[Path, dict[str, float]]]:
    """Relight the scene's field with its world and show it: `compute`, then `present.present`.

    In the scene only the plate's image and the plate's node in the compositor change. Raises what
    `compute` raises.
    """
    path, seconds = yield from compute(scene, view_layer)
    present(scene, path)
    return path, seconds


def compute(
    scene: bpy.types.Scene, view_layer: str | None = None
) -> Steps[tuple[Path, dict[str, float]]]:
    """Relight the scene's field with its world; returns (path of the EXR, seconds by part).

    The scene does not change. Raises SceneError, CaptureSetError (captured for another camera,
    frame or size), ShotError (captured for another file or scene), FieldError, EnvironmentMapError,
    ExrError, CancelledError.
    """
    layer = view_layer or layer_of(scene)
    check_world(scene, layer)
    check_drawn(scene, layer)
    scene.view_layers[layer].update()
    path = relit_file(scene)
    shown = Shown(scene, layer)
    check_same_shot(scene, shown.field.about.shot, "the reflectance field", layer)
    seconds = yield from show(shown, Light(path, scene.arto.look))
    return path, seconds


def show(shown: Shown, lit: Light) -> Steps[dict[str, float]]:
    """Make and write the plate of a field in a light; returns seconds by part of the work.

    Raises what `compute` raises.
    """
    ready = yield from make_ready(shown, lit)
    yield Progress(0.6, "relighting")
    return (yield from finish(shown, ready, shown.pictures([ready.light])[0]))


def make_ready(shown: Shown, lit: Light) -> Steps[Ready]:
    """Prepare a light: bake its map, render its lamps, bring it to the patches -> `Ready`.

    Raises what `compute` raises.
    """
    scene, layer, field = shown.scene, shown.layer, shown.field
    settings = scene.arto
    world = lit.world or check_world(scene, layer)
    check_given(scene, world)
    laps = Laps()
    changed, by_rays = shown.changed(), differs_by_rays(world)
    # raise before the long work what would be raised after it
    plate.window_of(scene).check(field.shape)
    check_film(scene, field)
    check_picture(shown, lit.path)
    shown.mattes()
    shown.filmed()
    for said in ahead.warnings(shown, world):
        yield Warned(0.0, said)
    yield Progress(0.0, "bringing the world to an environment map")
    whole = kept.environment(scene, settings.environment_width, layer, lit.world)
    below = ""
    if whole.below_zero > LEAST_SHARE:
        below = f"{whole.below_zero:.1%} of its light is below 0"
        yield Warned(0.0, f"the world is no light: {below}, which no layer and no shadow has")
    laps.lap("world")
    found = shown.split(whole)
    parts, lamps, together = yield from _lamps(shown, found)
    rendered = [parts]
    for take in shown.takes[1:]:
        rendered.append((yield from _lamps(take, found))[0] if parts else [])
    laps.lap("lamps")
    yield Progress(0.5, "bringing the environment to the patches")
    light = PatchLight(found.rest if parts else whole, field.hemicube)
    laps.lap("light")
    if said := narrow(field, light, found.share if parts else 0.0):
        yield Warned(0.55, said)
    return Ready(
        lit, world, whole, found, rendered, lamps, together, light, changed, by_rays, below, laps
    )


def narrow(field: Field, light: PatchLight, rendered: float) -> str:
    """Say that a light is noisy because few of the capture's samples show it, or "".

    rendered: the share of the world's light that lamps bring, which are rendered by themselves.
    """
    captured, left = field.about.samples, 1 - rendered
    if not captured or field.about.route == Route.PHOTOGRAPHS or left < LEAST_SHARE:
        return ""
    part = min(light.spread / BEHIND_A_SURFACE, 1.0) / left**2
    if not 0 < part < NARROW or part * captured >= ENOUGH:
        return ""
    return (
        f"the world's light comes from few directions: of the capture's {captured:g} samples about "
        f"{part * captured:.0f} show it. More Samples makes the plate cleaner"
    )


def finish(
    shown: Shown, ready: Ready, pictures: list[NDArray[np.float32]]
) -> Steps[dict[str, float]]:
    """Make the plate and write it; returns seconds by part of the work.

    pictures: for each take what its field shows in the light, (H, W, 4). Raises what `compute`
    raises.
    """
    scene, lit = shown.scene, ready.lit
    settings, path = scene.arto, lit.path
    lap = ready.laps.lap
    summed, least, signed = [], 0.0, False
    for take, picture, parts in zip(shown.takes, pictures, ready.rendered, strict=True):
        parts, least, signed = yield from with_own(take, ready, picture, parts)
        summed.append(parts)
    by, held = shown.takes, 0.0
    if len(by) > 1:
        # The first two takes are divided by each other. The visible ground of each is denoised in
        # their place (`of_ground`), with the same guides.
        whole, ground, apart = summed
        apart = [np.maximum(part, 0) for part in apart]
        held = shown.held_out(*(picture[..., 3] for picture in pictures))
        things = [np.dstack([part, pictures[-1][..., 3]]) for part in apart]
        divided = [of_ground(*parts, held) for parts in zip(whole, ground, things, strict=True)]
        summed, by = [*map(list, zip(*divided, strict=True)), apart], [by[0], by[0], by[-1]]
    lap("relight")
    denoised = "no"
    if settings.denoise:
        yield Progress(0.7, "denoising")
        if denoise.available():
            signed = signed and len(by) == 1
            summed = [
                [t.denoised(*parts, signed=signed)] for t, parts in zip(by, summed, strict=True)
            ]
            denoised = "Open Image Denoise"
        else:
            # three places say this: this message, the file's header and the last message
            denoised = ahead.NO_DENOISER
            yield Progress(0.7, f"denoising: {denoised}")
        lap("denoise")
    for picture, parts in zip(pictures, summed, strict=True):
        picture[..., :3] = sum(parts)
    picture, caught = pictures[-1], None
    # A plane fitted through a sun beside darkness falls below 0, which no light does but that of
    # negative lamps. The pictures of the ground keep their negative values, since their noise is on
    # both sides.
    picture[..., :3] = np.maximum(picture[..., :3], least)
    if len(pictures) > 1:
        left, bare, apart = pictures
        caught = catch_seen(left[..., :3], bare[..., :3], apart, bare[..., 3], held)
        picture = caught.plate
        lap("catcher")
    things = picture[..., :3].copy()
    if not scene.render.film_transparent:
        yield Progress(0.8, "adding the world behind")
        _behind(shown, lit, picture, ready.found.share > LEAST_SHARE, caught)
        lap("background")
        check_finite(picture, f"the world '{ready.world.name}' behind the scene")
    check_finite(picture, "the sum of the picture's parts")
    about = {"scene": scene.name, "world": ready.world.name, "denoised": denoised}
    key = light_key.light_key(scene, ready.world, shown.layer, shown.field, shown.scene_key())
    about[light_key.HEADER.removeprefix("arto.")] = key
    yield from files.write(shown, ready, files.Made(picture, things, caught), about)
    lap("write")
    say = f" (denoised: {denoised})" if settings.denoise else ""
    yield Progress(1.0, f"wrote {path}{say}")
    return ready.laps.seconds


def check_finite(picture: NDArray | float, name: str) -> None:
    """Raise FieldError where a picture, (H, W, C), has a value that is infinite or not a number.

    name: the picture's, for the message, which has to say where the value comes from.
    """
    good = np.isfinite(picture)
    if good.all():
        return
    bad = np.argwhere(~good.all(axis=-1)) if good.ndim == 3 else np.argwhere(~good)
    at = f", the first at row {bad[0][0]}, column {bad[0][1]}" if bad.shape[1] > 1 else ""
    raise FieldError(
        f"{name} is infinite or not a number in {len(bad)} pixels{at}, so no picture was written: "
        "if it is a field, fit or capture again; else look at what is so bright there"
    )


def with_own(
    shown: Shown, ready: Ready, picture: NDArray[np.float32], parts: list[NDArray[np.float32]]
) -> Steps[tuple[list[NDArray[np.float32]], NDArray[np.float32] | float, bool]]:
    """Add the scene's own lamps to a take's picture.

    -> (the pictures that sum to the take's plate; the least that the plate can be, a number or (H,
    W, 3); whether light is taken away, by lamps or by the world)

    picture: what the take's field shows, (H, W, 4); parts: pictures of the world's lamps, none or
    one. Raises FieldError where a value is not finite.
    """
    check_finite(picture, f"what the reflectance field in {shown.field.folder} shows")
    for part in parts:
        check_finite(part, "the render of the world's lamps")
    if shown.held:
        yield from _hold(shown, ready.whole, picture, parts)
    own = own_of(shown.scene, shown.field)
    check_finite(own, f"the scene's own lamps in the field {shown.field.folder}")
    dark = bool((own < -LEAST_SHARE * np.abs(picture[..., :3])).any())
    picture[..., :3] += own
    parts = [*parts, picture[..., :3]]
    least = -np.inf if ready.below else np.minimum(own, 0) if dark else 0.0
    signed = dark or bool(ready.below)
    if ready.together or signed:
        # what is below 0 in one of them may be light in their sum
        parts = [sum(parts, np.zeros_like(picture[..., :3]))]
    return parts, least, signed


def _lamps(shown: Shown, found: Split) -> Steps[tuple[list[NDArray[np.float32]], str, bool]]:
    """Render the light of the world's lamps by itself.

    -> (pictures, none or one; what was done, in words; whether the lamps have nearly all the light)
    """
    settings, about = shown.scene.arto, shown.field.about
    photographed = about.route == Route.PHOTOGRAPHS
    if not found.worth or not (settings.lamps or photographed):
        return [], "no", False
    if photographed:
        lamps = "no: a photographed thing cannot be rendered; suns shine by the patches they are in"
    elif about.far is False:
        lamps = "no: lamps at infinity would not stand where a near hemicube has them"
    elif about.view_layer is None:
        lamps = "no: the field does not say of which view layer it is; capture again"
        yield Warned(0.3, f"the world's lamps: {lamps}")
        return [], lamps, False
    else:
        samples = lamp_samples(shown.scene, found.share, about.samples)
        lamps = f"{found.share:.0%} of the world's light, {samples} samples"
        yield Progress(0.2, f"the world's lamps: {lamps}")
        begun = time.perf_counter()
        light = yield from lamp_light(shown.scene, shown.field, found.lamps, samples, 0.3)
        lamps += f", {time.perf_counter() - begun:.0f} s"
        return [light], lamps, found.share >= NEARLY_ALL
    yield Progress(0.3, f"the world's lamps: {lamps}")
    return [], lamps, False


def _hold(
    shown: Shown, whole: Environment, picture: NDArray[np.float32], parts: list[NDArray]
) -> Steps[None]:
    """Scale a picture to the mean brightness that a small render in the same light has.

    Some light reaches the picture by shadow rays alone. How much of it Cycles gives depends on the
    whole world, and is not the sum over its patches.
    """
    region = shown.field.region.slices
    expected = yield from brightness(shown.scene, shown.field, whole, 0.65)
    for rendered in parts:  # Cycles has rendered the lamps: their brightness is right already
        expected = np.maximum(expected - rendered[region].mean(axis=(0, 1)), 0)
    found = picture[region][..., :3].mean(axis=(0, 1), dtype=np.float64)
    picture[..., :3] *= np.divide(expected, found, out=np.ones(3), where=found > 0)


def _behind(
    shown: Shown,
    lit: Light,
    picture: NDArray[np.float32],
    has_lamps: bool,
    caught: Caught | None,
) -> None:
    """Add the world as the camera sees it behind everything. caught: with shadow catchers."""
    scene, layer, field = shown.scene, shown.layer, shown.field
    captured = field.region
    through = field.through()
    holes = holds_out(scene, layer)
    # captures of before did not look through the holes
    unknown = holes and through is None and not field.about.behind
    tint = _tint(through)
    if caught and (holes or tint is not None):
        # the world behind shows through the shadows, but not in the holes
        solid = _solid(field, through)
        if unknown:
            solid = without_holes(scene, captured, layer, lit.world)
        there = background(scene, captured, layer, has_lamps, lit.world)
        seen = (solid - picture[..., 3])[..., None]
        if tint is not None:
            seen = caught.share - (1 - solid)[..., None] + tint
        picture[..., :3] += np.clip(seen, 0, 1) * there
        picture[..., 3] = solid
        return
    if caught:
        through = None  # the shadows are in the alpha of the plate
    elif unknown:
        behind = background_with_holes(scene, captured, layer, lit.world)
        picture[..., :3] += behind[..., :3]
        picture[..., 3] = behind[..., 3]
        return
    # outside a render region Cycles leaves a picture empty
    inside = picture[captured.slices]
    through = None if through is None else through[captured.slices]
    rows, columns = np.nonzero(inside[..., 3] < OPAQUE if through is None else through.any(axis=-1))
    if len(rows):
        seen = Region.around(rows + captured.y, columns + captured.x)
        there = background(scene, seen, layer, has_lamps, lit.world)[captured.slices]
        picture[captured.slices] = over(inside, there, through)


def _tint(through: NDArray[np.float32] | None) -> NDArray[np.float32] | None:
    """By how much more the world is seen in a channel than in all -> (H, W, 3); None where not."""
    if through is None:
        return None
    tint = through - through.mean(axis=-1, keepdims=True)
    return tint if np.abs(tint).max(initial=0) > ROUNDED else None


def _solid(field: Field, through: NDArray[np.float32] | None) -> NDArray[np.float32]:
    """The alpha of a field's picture with the world behind it, 0 outside its region -> (H, W)."""
    out = np.zeros(field.shape, np.float32)
    region = field.region.slices
    out[region] = 1
    if through is not None:
        out[region] = opaque(field.layer("alpha")[region], through[region])
    return out
