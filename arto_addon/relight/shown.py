"""What a relight works with: a light, the opened field of a shot, and a light made ready."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.capture.kinds import Route
from ...core.catcher import held_out
from ...core.cryptomatte import Mattes
from ...core.errors import ArtoError, FieldError, SceneError
from ...core.field.field import Field
from ...core.light.environment import Environment
from ...core.light.lamps import Split, split
from ...core.light.light import PatchLight
from ...core.relight import relights
from ..blender import denoise
from ..fit import guides
from ..plate import mattes
from ..plate.footage import footage
from ..shot import paths, status, watch
from ..shot.fingerprint import Fingerprint, changes, key_of
from ..shot.shot import check_same_shot
from ..stage import takes
from ..world.background import holds_out


class Laps:
    """A stopwatch: the seconds that each part of the work took."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.go_on()

    def go_on(self) -> None:
        """Let the next part begin now."""
        self._last = time.perf_counter()

    def lap(self, name: str) -> None:
        now = time.perf_counter()
        self.seconds[name] = now - self._last
        self._last = now


@dataclass(frozen=True)
class Light:
    """A light to show a shot in.

    path: of the picture to write; look: the light's name in the picture's header; world: None for
    the view layer's own world; frames: of a sequence whose first picture this is, first and last.
    """

    path: Path
    look: str = ""
    world: bpy.types.World | None = None
    frames: tuple[int, int] | None = None


def check_film(scene: bpy.types.Scene, field: Field) -> None:
    """Raise SceneError where a field has, or lacks, what Ray Portals show of the world.

    Cycles shows it before an opaque film, and it is in the light of such a capture. Over a
    transparent film the portal is clear.
    """
    seen, clear = field.about.portals, scene.render.film_transparent
    if seen is not None and seen == clear:
        was, back = ("an opaque", "off") if seen else ("a transparent", "on")
        raise SceneError(
            f"the shot has Ray Portals and was captured for {was} film, on which it depends what "
            f"they show: turn Transparent {back} (Render properties, Film), or capture again"
        )


def newest(scene: bpy.types.Scene, view_layer: str) -> Path:
    """The folder of the field that a shot is looked at in, which may be a draft.

    It is the shot's field where that is of the scene as it is. Else it is the draft of a capture
    that is not complete, where there is one of this shot. Raises SceneError, ShotError.
    """
    folder = paths.field_folder(scene, view_layer)
    line = status.field_line(scene, view_layer)
    if line is not None and line[1]:
        return folder
    there = status.draft_of(folder.parent)
    if there is None:
        return folder
    with contextlib.suppress(ArtoError):
        check_same_shot(scene, there.about.shot, "the draft", view_layer)
        return there.folder
    return folder


class Shown:
    """The opened field of a shot, shared by all the lights that the shot is shown in.

    Raises SceneError, CaptureSetError (captured for another camera, frame or size), ShotError
    (captured for another file or scene), FieldError.
    """

    def __init__(self, scene: bpy.types.Scene, view_layer: str, folder: Path | None = None) -> None:
        self.scene, self.layer = scene, view_layer
        if folder is None:
            folder = paths.field_folder(scene, view_layer)
            if not folder.exists() and (left := status.unfinished(folder.parent)):
                raise FieldError(
                    f"the capture is not complete ({left[0]}), and no plate is made of its draft: "
                    "run Capture again, it goes on from there"
                )
            if not folder.exists() and not paths.capture_folder(scene, view_layer).exists():
                near = paths.nearest(scene, view_layer)
                check_same_shot(scene, near, "the reflectance field", view_layer)
                other = paths.alike(scene, view_layer) if near is None else None
                if other:
                    raise FieldError(
                        f"there is no reflectance field of this shot. What is in {other} was "
                        f"captured of a scene of the same name: if that is this scene, use it by "
                        f"--command arto adopt --from '{other}'; else capture this one"
                    )
        self.field = Field(folder)
        self._looked: dict[tuple[int, float], Fingerprint | None] = {}
        self._split: tuple[NDArray[np.float32], Split] | None = None
        self._filmed: tuple[tuple[int, float], tuple[str, NDArray[np.float32]]] | None = None
        self._mattes: tuple[Path | None, Mattes | None] | None = None
        self.held = self.field.about.route == Route.SAMPLED
        self._others: list[Shown] = []
        if self.field.about.catchers and not self.field.about.take:
            self._others = [self._beside(folder.parent / name / "field") for name in takes.TAKES]

    @property
    def size(self) -> tuple[int, int]:
        """Height and width of the shot's picture, also where the field is a smaller draft."""
        shot = self.field.about.shot
        return (shot.height, shot.width) if self.field.about.draft and shot else self.field.shape

    def pixel(self, x: int, y: int) -> tuple[int, int]:
        """The field's pixel that shows a pixel of the shot's picture, from the left and the top."""
        (height, width), (h, w) = self.size, self.field.shape
        return x * w // width, y * h // height

    @property
    def takes(self) -> list[Shown]:
        """The takes of the shot; with shadow catchers: everything, the catchers, the things."""
        # a new list each time: a kept list holds itself, and its fields would stay mapped in memory
        return [self, *self._others]

    def _beside(self, folder: Path) -> Shown:
        """Another take of the shot. Raises FieldError."""
        found = Shown(self.scene, self.layer, folder)
        if found.field.about.pair != self.field.about.key:
            raise FieldError(
                f"what is in {folder} was captured for another picture: run Capture again, it goes "
                "on where it stopped"
            )
        return found

    def pictures(self, lights: Sequence[PatchLight]) -> list[list[NDArray[np.float32]]]:
        """What each take's field shows in each light: a list by light, then take, of (H, W, 4)."""
        # the first two are divided by each other
        takes = self.takes
        cut = [len(takes) > 1 and take is not takes[-1] for take in takes]
        found = [relights(t.field, lights, 0.0, cut=c) for t, c in zip(takes, cut, strict=True)]
        return [list(each) for each in zip(*found, strict=True)]

    def changed(self) -> list[str]:
        """What has changed in the scene since the capture, at the scene's frame, in words."""
        then, found = self.field.about.fingerprint, self._fingerprint()
        return changes(dict(then), found) if then is not None and found is not None else []

    def scene_key(self) -> str:
        """A digest of what the scene shows at its frame; "" for a field without a fingerprint."""
        found = self._fingerprint()
        return key_of(found) if found is not None else ""

    def _fingerprint(self) -> Fingerprint | None:
        """The scene's fingerprint at its frame, made once; None where the field has none."""
        frame = self.scene.frame_current, self.scene.frame_subframe
        if frame not in self._looked:
            then = self.field.about.fingerprint
            found = watch.latest(self.scene, self.layer, dict(then), True) if then else None
            self._looked = {frame: found}
        return self._looked[frame]

    def filmed(self) -> tuple[str, NDArray[np.float32]] | None:
        """The name and the picture of the footage that the things are put over, at this frame.

        Only a shot with shadow catchers has footage. It is read once for all lights. Raises
        SceneError.
        """
        found = footage(self.scene) if len(self.takes) > 1 else None
        if found is None:
            return None
        key = self.scene.frame_current, self.scene.frame_subframe
        if self._filmed is None or self._filmed[0] != key:
            self._filmed = key, (found.shown(self.scene), found.read(self.scene))
        return self._filmed[1]

    def footage_warning(self) -> str:
        """What to warn of in the footage at this frame, in words; "" for nothing."""
        found = footage(self.scene) if len(self.takes) > 1 else None
        return found.check(self.scene) if found else ""

    def mattes(self) -> Mattes | None:
        """The artist's Cryptomattes of this shot; None where the settings ask for none.

        They are read once for all lights of a frame. Raises SceneError, ExrError.
        """
        path = mattes.file_of(self.scene, self.field)
        if self._mattes is None or self._mattes[0] != path:
            self._mattes = path, mattes.read(self.scene, self.field)
        return self._mattes[1]

    def split(self, whole: Environment) -> Split:
        """Cut the lamps out of a light.

        Where patches are all around, the cut does not depend on the light's turn and is reused.
        """
        if not self.field.hemicube.closed:
            return split(whole, self.field.hemicube)
        if self._split is None or self._split[0] is not whole.image:
            self._split = whole.image, split(whole)
        found = self._split[1]
        rest, lamps = (replace(part, turn=whole.turn) for part in (found.rest, found.lamps))
        return Split(rest, lamps, found.share)

    def held_out(self, *alphas: NDArray[np.float32]) -> NDArray[np.float32] | float:
        """How much of each pixel holdouts cut out in front of the ground, (H, W).

        alphas: of the pictures of all takes, (H, W) each.
        """
        return held_out(*alphas) if holds_out(self.scene, self.layer) else 0.0

    @cached_property
    def guides(self) -> dict[str, NDArray]:
        return guides.guides_of(self.field)

    def denoised(self, *parts: NDArray[np.float32], signed: bool = False) -> NDArray[np.float32]:
        """Denoise pictures of what the field shows, (H, W, 3), one by one -> their sum.

        signed: whether light is taken away, so that there are values below 0. The denoiser knows
        none, and gets them by themselves.
        """
        if signed and any((part < 0).any() for part in parts):
            taken = self.denoised(*(np.maximum(-part, 0) for part in parts))
            return self.denoised(*(np.maximum(part, 0) for part in parts)) - taken
        clean = guides.clean(self.field)
        # of a shot with catchers these are differences of two takes, which may be below 0
        lamps_apart = len(parts) == 2 and len(self.takes) == 1
        way = denoise.with_lamps if lamps_apart else denoise.denoise
        found = way(self.guides, *parts, clean=clean, like=self.scene)
        # a denoiser lets light at outlines spill into empty pixels, where it would brighten footage
        nothing = self.field.layer("alpha") == 0
        for part in parts:
            nothing &= ~part.any(axis=-1)
        found[nothing] = 0
        return found


@dataclass
class Ready:
    """A light made ready: its lamps are rendered and it is brought to the patches.

    whole: the light's environment; found: the environment without the lamps, and the lamps;
    rendered: for each take, pictures of the lamps, none or one; lamps: what was done with the
    lamps, in words; together: whether the lamps have nearly all the light.
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
