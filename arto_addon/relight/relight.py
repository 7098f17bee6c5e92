"""Relighting: the scene's world through the field, into an EXR and the compositor (paper 6)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.catcher import catch_seen, held_out, of_ground
from ...core.errors import FieldError
from ...core.field.field import Field
from ...core.light.environment import Environment
from ...core.light.lamps import Split, split
from ...core.light.light import PatchLight
from ...core.region import Region
from ...core.relight import over, relights
from ..blender import denoise
from ..capture import beside
from ..capture.plan import SAMPLED
from ..plate import plate
from ..plate.footage import footage
from ..plate.present import present
from ..shot import paths
from ..shot.shot import check_same_shot, layer_of
from ..shot.status import changed_since
from ..work import Progress, Steps
from ..world import kept
from ..world.background import background, background_with_holes, holds_out, without_holes
from ..world.check import check_world, differs_by_rays
from ..world.lamp_render import brightness, lamp_light, lamp_samples, region_of
from ..world.own import own_of
from . import files, light_key

# From this share of the light on the lamps are the picture, and what the field adds is denoised
# with them: by themselves, beside darkness, they come out of the denoiser worse (docs/accuracy.md).
NEARLY_ALL = 0.9
# Alpha from which on nothing is seen behind: the rounding of a mean of many ones.
OPAQUE = 1 - 1e-5
# A lamp of more than this share of the light is looked for behind the plate by every pixel.
LEAST_SHARE = 1e-3


@dataclass(frozen=True)
class Light:
    """A light to show a shot in. world: None for the view layer's own; path: of the picture;
    look: what it is called in the picture's header."""

    path: Path
    look: str = ""
    world: bpy.types.World | None = None


class Shown:
    """A shot's field, opened: what all the lights that it is shown in have in common.

    Raises SceneError, CaptureSetError (of another shot), ShotError (another's), FieldError.
    """

    def __init__(self, scene: bpy.types.Scene, view_layer: str, folder: Path | None = None) -> None:
        self.scene, self.layer = scene, view_layer
        if folder is None:
            folder = paths.field_folder(scene, view_layer)
            if not folder.exists() and not paths.capture_folder(scene, view_layer).exists():
                near = paths.nearest(scene, view_layer)
                check_same_shot(scene, near, "the reflectance field", view_layer)
        self.field = Field(folder)
        self._changed: dict[tuple[int, float], list[str]] = {}
        self._split: tuple[NDArray[np.float32], Split] | None = None
        self._filmed: tuple[tuple[int, float], tuple[str, NDArray[np.float32]]] | None = None
        self.held = self.field.about.get("route") == SAMPLED
        # of a shot with shadow catchers: of everything, of the catchers, of the things
        self.takes = [self]
        if self.field.about.get("catchers") and not self.field.about.get("take"):
            self.takes += [self._beside(folder.parent / name / "field") for name in beside.TAKES]

    def _beside(self, folder: Path) -> Shown:
        """Another take of the shot. Raises FieldError."""
        found = Shown(self.scene, self.layer, folder)
        if found.field.about.get(beside.PAIR) != self.field.about.get("key"):
            raise FieldError(
                f"what is in {folder} was captured for another picture: run Capture again, it goes "
                "on where it stopped"
            )
        return found

    def pictures(self, lights: Sequence[PatchLight]) -> list[list[NDArray[np.float32]]]:
        """For each light what each take's field shows in it, (H, W, 4)."""
        # the first two are divided by each other
        cut = [len(self.takes) > 1 and take is not self.takes[-1] for take in self.takes]
        found = [
            relights(t.field, lights, 0.0, cut=c) for t, c in zip(self.takes, cut, strict=True)
        ]
        return [list(each) for each in zip(*found, strict=True)]

    def changed(self) -> list[str]:
        """What of the scene is not as it was captured, at its frame."""
        frame = self.scene.frame_current, self.scene.frame_subframe
        if frame not in self._changed:
            found = changed_since(self.scene, self.layer, self.field.about, now=True)
            self._changed = {frame: found}
        return self._changed[frame]

    def filmed(self) -> tuple[str, NDArray[np.float32]] | None:
        """The name and the picture of the footage that the things of a shot with shadow catchers
        are put into, at its frame; read once for all lights. Raises SceneError."""
        found = footage(self.scene) if len(self.takes) > 1 else None
        if found is None:
            return None
        key = self.scene.frame_current, self.scene.frame_subframe
        if self._filmed is None or self._filmed[0] != key:
            self._filmed = key, (found.name, found.read(self.scene))
        return self._filmed[1]

    def split(self, whole: Environment) -> Split:
        """The lamps cut out of a light. Where patches are all around, a turned map is cut as it was
        before."""
        if not self.field.hemicube.closed:
            return split(whole, self.field.hemicube)
        if self._split is None or self._split[0] is not whole.image:
            self._split = whole.image, split(whole)
        found = self._split[1]
        rest, lamps = (replace(part, turn=whole.turn) for part in (found.rest, found.lamps))
        return Split(rest, lamps, found.share)

    def held_out(self, *alphas: NDArray[np.float32]) -> NDArray[np.float32] | float:
        """How much of each pixel is cut out before the ground, from its takes' alphas, (H, W)."""
        return held_out(*alphas) if holds_out(self.scene, self.layer) else 0.0

    @cached_property
    def guides(self) -> dict[str, NDArray]:
        return denoise.guides_of(self.field)

    def denoised(self, *parts: NDArray[np.float32]) -> NDArray[np.float32]:
        """The sum of pictures of what the field shows, (H, W, 3), each denoised by itself."""
        clean = denoise.clean(self.field)
        found = denoise.denoise(self.guides, *parts, clean=clean, like=self.scene)
        # a denoiser lets outlines glow into what is empty, and footage is seen through that
        nothing = self.field.layer("alpha") == 0
        for part in parts:
            nothing &= ~part.any(axis=-1)
        found[nothing] = 0
        return found


def relight(scene: bpy.types.Scene, view_layer: str | None = None) -> Steps:
    """Relight the scene's field with its world and show it: `compute`, then `present.present`.

    Raises what `compute` raises; nothing of the scene changes but the plate's image and its node in
    the compositor.
    """
    path, seconds = yield from compute(scene, view_layer)
    present(scene, path)
    return path, seconds


def compute(scene: bpy.types.Scene, view_layer: str | None = None) -> Steps:
    """Relight the scene's field with its world; returns (path of the EXR, seconds by part).

    Raises SceneError, CaptureSetError (of another shot), ShotError (another's), FieldError,
    EnvironmentMapError, ExrError, CancelledError; nothing of the scene changes.
    """
    layer = view_layer or layer_of(scene)
    check_world(scene, layer)
    scene.view_layers[layer].update()
    path = paths.relit_file(scene)
    shown = Shown(scene, layer)
    check_same_shot(scene, shown.field.about.get("shot"), "the reflectance field", layer)
    seconds = yield from show(shown, Light(path, scene.arto.look))
    return path, seconds


@dataclass
class Ready:
    """A light, made ready to be shown in: its lamps are rendered, its bins are full.

    whole: its environment; found: that without lamps, and these; rendered: for each take, pictures
    of the lamps, none or one; lamps: what was done with them, in words; together: whether they have
    nearly all light.
    """

    lit: Light
    world: bpy.types.World
    whole: Environment
    found: Split
    rendered: list[list[NDArray[np.float32]]]
    lamps: str
    together: bool
    light: PatchLight
    changed: list[str]
    by_rays: str
    below: str
    laps: Laps


class Laps:
    """Seconds by part."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.go_on()

    def go_on(self) -> None:
        """Count from now."""
        self._last = time.perf_counter()

    def lap(self, name: str) -> None:
        now = time.perf_counter()
        self.seconds[name] = now - self._last
        self._last = now


def show(shown: Shown, lit: Light) -> Steps:
    """Write the picture of a field in a light; returns seconds by part. Raises as `compute`."""
    ready = yield from make_ready(shown, lit)
    yield Progress(0.6, "relighting")
    return (yield from finish(shown, ready, shown.pictures([ready.light])[0]))


def make_ready(shown: Shown, lit: Light) -> Steps:
    """Bring a light to the patches -> `Ready`. Raises as `compute`."""
    scene, layer, field = shown.scene, shown.layer, shown.field
    settings = scene.arto
    world = lit.world or check_world(scene, layer)
    laps = Laps()
    changed = shown.changed()
    if changed:
        # allowed: it is the artist who knows whether it shows
        yield Progress(0.0, f"the scene is not the captured one: {'; '.join(changed[:3])}")
    # what cannot be read or written is said before the long work
    plate.window_of(scene).check(field.shape)
    shown.filmed()
    yield Progress(0.0, "bringing the world to an environment map")
    if by_rays := differs_by_rays(world):
        yield Progress(0.0, f"the world is {by_rays}")
    whole = kept.environment(scene, settings.environment_width, layer, lit.world)
    below = ""
    if whole.below_zero > LEAST_SHARE:
        below = f"{whole.below_zero:.1%} of its light is below 0"
        yield Progress(0.0, f"the world is no light: {below}, which no layer and no shadow has")
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
    return Ready(
        lit, world, whole, found, rendered, lamps, together, light, changed, by_rays, below, laps
    )


def finish(shown: Shown, ready: Ready, pictures: list[NDArray[np.float32]]) -> Steps:
    """Make the plate of what the fields of a shot show in a light, (H, W, 4) each, and write it;
    returns seconds by part. Raises as `compute`."""
    scene, lit = shown.scene, ready.lit
    settings, path = scene.arto, lit.path
    lap = ready.laps.lap
    summed = []
    for take, picture, parts in zip(shown.takes, pictures, ready.rendered, strict=True):
        summed.append((yield from _with_own(take, ready, picture, parts)))
    by, held = shown.takes, 0.0
    if len(by) > 1:
        # of the first two what is divided by each other, and alike denoised: `of_ground`
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
            summed = [[t.denoised(*parts)] for t, parts in zip(by, summed, strict=True)]
            denoised = "Open Image Denoise"
        else:
            # said here, in the file's header and in the last line
            denoised = "no: this Blender was built without Open Image Denoise"
            yield Progress(0.7, f"denoising: {denoised}")
        lap("denoise")
    for picture, parts in zip(pictures, summed, strict=True):
        picture[..., :3] = sum(parts)
    picture, caught = pictures[-1], None
    # a plane laid through a sun beside darkness undershoots; a picture has no negative light, while
    # what is left of two is off to both sides
    np.maximum(picture, 0, out=picture)
    if len(pictures) > 1:
        left, bare, apart = pictures
        caught = catch_seen(left[..., :3], bare[..., :3], apart, bare[..., 3], held)
        picture = caught.plate
        lap("catcher")
    things = picture[..., :3].copy()
    if not scene.render.film_transparent:
        yield Progress(0.8, "adding the world behind")
        _behind(shown, lit, picture, ready.found.share > LEAST_SHARE)
        lap("background")
    about = {"scene": scene.name, "world": ready.world.name, "denoised": denoised}
    about[light_key.HEADER.removeprefix("arto.")] = light_key.light_key(scene, ready.world)
    yield from files.write(shown, ready, files.Made(picture, things, caught), about)
    lap("write")
    say = f" (denoised: {denoised})" if settings.denoise else ""
    yield Progress(1.0, f"wrote {path}{say}")
    return ready.laps.seconds


def _with_own(
    shown: Shown, ready: Ready, picture: NDArray[np.float32], parts: list[NDArray[np.float32]]
) -> Steps:
    """The pictures that a take's plate is the sum of: of what its field shows, (H, W, 4), with the
    scene's own lamps, and of the lamps of the world."""
    if shown.held:
        yield from _hold(shown, ready.whole, picture, parts)
    picture[..., :3] += own_of(shown.scene, shown.field)
    parts = [*parts, picture[..., :3]]
    return [sum(parts)] if ready.together else parts


def _lamps(shown: Shown, found: Split) -> Steps:
    """The light of the world's lamps, rendered by itself -> (pictures, none or one; what was done,
    in words; whether they have nearly all the light)."""
    settings, about = shown.scene.arto, shown.field.about
    if not settings.lamps or not found.worth:
        return [], "no", False
    if not about.get("far", True):
        lamps = "no: lamps at infinity would not stand where a near hemicube has them"
    elif "view_layer" not in about:
        lamps = "no: the field does not say of which view layer it is; capture again"
    else:
        samples = lamp_samples(shown.scene, found.share)
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
) -> Steps:
    """Hold a picture to the brightness that a small render of its light has: of light that only
    shadow rays bring, Cycles lets hang on the whole world how much of it there is."""
    region = region_of(shown.field).slices
    expected = yield from brightness(shown.scene, shown.field, whole, 0.65)
    for rendered in parts:  # the lamps' light, which is Cycles' already
        expected = np.maximum(expected - rendered[region].mean(axis=(0, 1)), 0)
    found = picture[region][..., :3].mean(axis=(0, 1), dtype=np.float64)
    picture[..., :3] *= np.divide(expected, found, out=np.ones(3), where=found > 0)


def _behind(shown: Shown, lit: Light, picture: NDArray[np.float32], has_lamps: bool) -> None:
    """Add the world as the camera sees it behind everything."""
    scene, layer = shown.scene, shown.layer
    captured = region_of(shown.field)
    if holds_out(scene, layer):
        if len(shown.takes) > 1:
            # what is behind is seen through the shadows, and in the holes not at all
            solid = without_holes(scene, captured, layer, lit.world)
            there = background(scene, captured, layer, has_lamps, lit.world)
            seen = np.clip(solid - picture[..., 3], 0, 1)
            picture[..., :3] += seen[..., None] * there
            picture[..., 3] = solid
            return
        behind = background_with_holes(scene, captured, layer, lit.world)
        picture[..., :3] += behind[..., :3]
        picture[..., 3] = behind[..., 3]
        return
    # outside a render region Cycles leaves a picture empty
    inside = picture[captured.slices]
    rows, columns = np.nonzero(inside[..., 3] < OPAQUE)
    if len(rows):
        seen = Region.around(rows + captured.y, columns + captured.x)
        there = background(scene, seen, layer, has_lamps, lit.world)[captured.slices]
        picture[captured.slices] = over(inside, there)
