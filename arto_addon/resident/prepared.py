"""The artist's scene, prepared in the resident renderer, and pictures of a world's suns in it.

The scene is opened from a snapshot once, and Cycles keeps what it has prepared. From one picture to
the next only the world changes, so a picture takes the time of its paths.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import arrays, marked
from ...core.capture.names import is_combined
from ...core.errors import FieldError, SceneError
from ...core.field.field import Field, proxy_folder
from ...core.field.head import HEADER
from ...core.light.environment import Environment
from ...core.region import Region
from ..blender import denoise
from ..blender.scratch import temporary
from ..fit import guides
from ..job.run import opened
from ..job.task import Task
from ..stage.small import parts_of
from ..stage.stage import Stage, set_region
from ..work import Progress, Render, run
from ..world.lamp_render import Sky, light_in, lit_by
from . import making, sent

# The width of a map of suns while the light moves, and while it rests. A texel of 1024 is a third
# of a degree, and the sun half a degree.
MOVING, RESTING = 1024, 2048
# Seconds a pixel that a denoiser takes, and seconds besides, until it was timed.
_CLEANS = 0.1, 3e-6
# The most bytes of a picture on its way: 16384 x 8192 pixels.
MOST_BYTES = 16384 * 8192 * 3 * 4
# Cycles looks at the file of an image only where its name is another.
_numbers = itertools.count(1)


@dataclass(frozen=True)
class File:
    """A snapshot of the artist's file.

    blend: the .blend; task: the file beside it that says which scene it is of; scripts: whether
    its Python may run.
    """

    blend: str
    task: str
    scripts: bool


@dataclass(frozen=True)
class Question:
    """What the window asks for.

    file: the snapshot; field: the folder of the shot's field; key, full: of the map whose suns are
    asked for; map: a file with it, where the window has made it; turn: of the map, in radians;
    resting: whether the light rests; factor: how many times smaller the picture is at the least;
    samples: the most; seconds: that it may take; clean: whether it is denoised where there is time;
    picture: the file of what the field shows in the other light, (H, W, 3), to be denoised with the
    suns; suns: whether there are suns at all; strength: of the world, by which suns are multiplied;
    out: the .npy file to write.
    """

    file: dict[str, Any]
    field: str
    key: str
    full: bool
    map: str
    turn: float
    resting: bool
    factor: int
    samples: int
    seconds: float
    clean: bool
    picture: str
    suns: bool
    strength: float
    out: str


@dataclass
class Pace:
    """How fast pictures are made.

    again: seconds besides paths; path: seconds for a path; clean: seconds for a pixel that is
    denoised, and besides.
    """

    again: float = 0.2
    path: float = 5e-6
    clean: float = _CLEANS[1]

    def render(self, pixels: int, samples: int) -> float:
        """Seconds for a picture."""
        return self.again + self.path * pixels * samples

    def denoise(self, pixels: int) -> float:
        """Seconds to denoise a picture."""
        return _CLEANS[0] + self.clean * pixels

    def learn(self, pixels: int, samples: int, ready: float, spent: float) -> None:
        """Note what a render took. ready: seconds until its first path."""
        self.again += 0.5 * (ready - self.again)
        self.path += 0.5 * (max(spent - ready, 1e-4) / (pixels * samples) - self.path)

    def learn_denoise(self, pixels: int, spent: float) -> None:
        """Note what it took to denoise a picture."""
        self.clean += 0.5 * (max(spent - _CLEANS[0], 0.0) / pixels - self.clean)

    def choose(
        self, sizes: dict[int, int], seconds: float, samples: int, clean: bool
    ) -> tuple[int, int]:
        """Choose the largest picture that there is time for -> (its factor, its samples).

        sizes: by factor, from the least on, how many pixels there are; samples: the most; clean:
        whether it is also denoised.
        """
        factor = max(sizes)
        for some, pixels in sorted(sizes.items()):
            left = seconds - (self.denoise(pixels) if clean else 0.0)
            if self.render(pixels, 1) <= left:
                factor = some
                break
        left = seconds - self.again - (self.denoise(sizes[factor]) if clean else 0.0)
        there = left / (self.path * sizes[factor])
        return factor, int(min(max(there, 1), samples))


class _Lit:
    """A shot on a stage that is kept, in the light of suns."""

    def __init__(self, held: ExitStack, scene: bpy.types.Scene, field: Field) -> None:
        self.field = field
        self.on, self.group = held.enter_context(lit_by(scene, field))
        # the picture is shown for a moment: two of the same light need not be the same to the bit
        self.on.same_noise = False
        layer = self.on.scene.view_layers[0]
        layer.cycles.denoising_store_passes = layer.use_pass_z = False
        self._sky: Sky | None = None
        self._folder = held.enter_context(temporary())
        self._file = self._folder
        self._shown: tuple[str, bool, int] | None = None

    def show(self, of: tuple[str, bool, int], suns: Callable[[], Environment], turn: float) -> None:
        """Light the shot. of: what tells these suns from others; suns: not turned."""
        path = self._folder / f"suns{next(_numbers)}.exr"
        if self._sky is None:
            self._sky = Sky(self.on, suns(), self.group, file=path)
            self.on.scene.world = self._sky.world
            self._file = path
        elif of != self._shown:
            self._sky.show(suns(), path)
            marked.remove_file(self._file, "temporary")
            self._file = path
        self._shown = of
        self._sky.world.cycles.sample_map_resolution = max(of[2], 512)
        self._sky.turn(turn)

    def size(self, factor: int) -> tuple[int, int]:
        """The size of the picture, (width, height)."""
        height, width = self.field.shape
        return math.ceil(width / factor), math.ceil(height / factor)

    def region(self, factor: int) -> Region:
        """The part of the picture that the field has."""
        r = self.field.region
        x, y = r.x // factor, r.y // factor
        right, bottom = (r.x + r.width - 1) // factor + 1, (r.y + r.height - 1) // factor + 1
        return Region(x, y, right - x, bottom - y)

    def render(
        self, factor: int, samples: int, step: Callable[[Progress | Render], None]
    ) -> NDArray[np.float32]:
        """Render -> (h, w, 4): the light of the suns, and the alpha of the picture."""
        render = self.on.scene.render
        render.resolution_percentage = 100
        render.resolution_x, render.resolution_y = width, height = self.size(factor)
        region = self.region(factor)
        set_region(self.on.scene, region)
        self.on.scene.cycles.samples = samples
        parts = run(parts_of(self.on, "rendering suns"), step)
        out = np.zeros((height, width, 4), np.float32)
        out[region.slices][..., :3] = light_in(parts, self.group)
        whole = next((p for name, p in parts.items() if is_combined(name)), None)
        if whole is not None:
            out[region.slices][..., 3] = whole[..., 3]
        return out


class Prepared:
    """The scene that is kept, and the field of its shot."""

    def __init__(self, maps: making.Maps, step: Callable[[Progress | Render], None]) -> None:
        self._maps, self._step = maps, step
        self._held = ExitStack()
        self._file = ""
        self._scene: bpy.types.Scene | None = None
        self._lit: _Lit | None = None
        self._opened: tuple[str, int, Field] | None = None
        self._steer: dict[int, dict[str, NDArray]] = {}
        self.pace = Pace()

    def answer(self, said: dict[str, Any]) -> dict[str, Any]:
        """Make a picture -> its file and how it was made, or why it was not.

        That is `lacks`, where the map is not known here, or `cannot`, where this Blender does not
        denoise. Raises ArtoError.
        """
        asked = Question(**said)
        begun, worked = time.perf_counter(), time.process_time()
        if asked.picture and not denoise.available():
            return {"cannot": True}
        suns, factor, samples, clean = None, 1, 0, bool(asked.picture)
        if asked.suns:
            if asked.map:
                image = arrays.read(Path(asked.map), making.MOST_BYTES)
                self._maps.keep(asked.key, asked.full, image)
            if self._maps.split(asked.key, asked.full) is None:
                return {"lacks": True}
            suns, factor, samples = self._suns(asked)
            if asked.clean and not asked.picture:
                clean = self._cleaned(asked, suns, factor, time.perf_counter() - begun)
        out = self._whole(asked, suns) if asked.picture else suns
        if out is None:
            raise SceneError("nothing was asked for: switch Live off and on")
        arrays.write(Path(asked.out), out)
        return {
            "picture": asked.out,
            "factor": factor,
            "samples": samples,
            "clean": clean,
            "cpu": time.process_time() - worked,
            "next": self.pace.render(self._field(asked.field).region.pixels // 64, 1),
        }

    def _cleaned(
        self, asked: Question, suns: NDArray[np.float32], factor: int, spent: float
    ) -> bool:
        """Denoise the suns alone, in place, where there is time -> whether it was done."""
        field = self._field(asked.field)
        there = factor == 1 or (proxy_folder(field.folder, factor) / HEADER).is_file()
        if not there or spent + self.pace.denoise(suns[..., 0].size) > asked.seconds:
            return False
        if denoise.available():
            suns[..., :3] = self._clean(self._guides(asked.field, factor), suns[..., :3])
        return denoise.available()

    def _suns(self, asked: Question) -> tuple[NDArray[np.float32], int, int]:
        """Render the suns -> (the picture, its factor, its samples)."""
        lit = self._prepared(asked)
        wanted = RESTING if asked.resting else MOVING
        width = self._maps.width(asked.key, asked.full)
        while width > wanted and width % 4 == 0:
            width //= 2

        def suns() -> Environment:
            found = self._maps.split(asked.key, asked.full)
            assert found is not None
            scale = found.lamps.image.shape[1] // width
            return found.lamps.coarser(scale) if scale > 1 else found.lamps

        lit.show((asked.key, asked.full, width), suns, asked.turn)
        whole = lit.field.region.pixels
        factors = [f for f in (1, 2, 4, 8) if f >= asked.factor] if not asked.resting else [1]
        sizes = {f: math.ceil(whole / f**2) for f in factors}
        factor, samples = self.pace.choose(sizes, asked.seconds, asked.samples, asked.clean)
        first, begun = lit.on.pace is None, time.perf_counter()
        picture = lit.render(factor, samples, self._step)
        pace, spent = lit.on.pace, time.perf_counter() - begun
        if pace and not first:  # the first render prepares the scene, which the next does not
            self.pace.learn(sizes[factor], samples, pace.again, spent)
        return picture, factor, samples

    def _whole(self, asked: Question, suns: NDArray[np.float32] | None) -> NDArray[np.float32]:
        """Denoise what the field shows together with the suns -> (H, W, 3)."""
        alpha = self._field(asked.field).layer("alpha")
        picture = arrays.read(Path(asked.picture), MOST_BYTES)
        if suns is not None:
            light = without_outlines(suns, alpha)
            picture = picture + np.float32(asked.strength) * light
        found = self._clean(self._guides(asked.field), picture)
        # a denoiser lets light at outlines spill into empty pixels
        found[(alpha == 0) & ~picture.any(axis=-1)] = 0
        return found

    def _clean(
        self, steer: dict[str, NDArray], picture: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        self._step(Progress(0.5, "denoising"))
        begun = time.perf_counter()
        found = denoise.denoise(steer, np.ascontiguousarray(picture), clean=True, like=self._scene)
        self.pace.learn_denoise(picture[..., 0].size, time.perf_counter() - begun)
        return np.maximum(found, 0)

    def _field(self, folder: str) -> Field:
        """The shot's field, opened anew where it was written anew. Raises FieldError."""
        try:
            written = (Path(folder) / HEADER).stat().st_mtime_ns
        except OSError as e:
            raise FieldError(f"{folder} cannot be read ({e}): capture again") from e
        if self._opened is None or self._opened[:2] != (folder, written):
            self._opened = folder, written, Field(Path(folder))
            self._steer.clear()
        return self._opened[2]

    def _guides(self, folder: str, factor: int = 1) -> dict[str, NDArray]:
        """The guides of the field, at a part of its size, without noise."""
        if factor not in self._steer:
            field = self._field(folder)
            steer = guides.guides_of(field.proxy(factor) if factor > 1 else field)
            noisy = not guides.clean(field)
            self._steer[factor] = guides.denoised(steer, self._scene) if noisy else steer
        return self._steer[factor]

    def _prepared(self, asked: Question) -> _Lit:
        """The shot on its stage. Raises ArtoError."""
        file = File(**asked.file)
        field = self._field(asked.field)
        if file.blend != self._file:
            self.let_go()
            self._scene = _open(file)
            self._file = file.blend
        assert self._scene is not None
        if self._lit is None or self._lit.field is not field:
            self._held.close()
            self._lit = _Lit(self._held, self._scene, field)
        return self._lit

    def let_go(self) -> None:
        """Free the scene."""
        self._held.close()
        self._file, self._scene, self._lit = "", None, None

    @property
    def stage(self) -> Stage | None:
        """The stage that is kept."""
        return self._lit.on if self._lit else None


def without_outlines(suns: NDArray[np.float32], alpha: NDArray[np.float32]) -> NDArray[np.float32]:
    """Leave out light where only the suns' render hits something -> (h, w, 3).

    suns: (h, w, 4), with their render's alpha; alpha: the picture's, (h, w).
    """
    stray = (alpha == 0) & (suns[..., 3] > 0)
    return np.where(stray[..., None], np.float32(0), suns[..., :3])


def _open(file: File) -> bpy.types.Scene:
    """Open a snapshot -> its scene. Raises SceneError, ArtoError."""
    task = Task.read(Path(file.task))
    try:
        bpy.ops.wm.open_mainfile(filepath=file.blend, load_ui=False, use_scripts=file.scripts)
    except RuntimeError as e:
        raise SceneError(f"the copy of the file cannot be opened ({e})") from e
    making.forget()
    sent.forget()
    return opened(task, Path(file.task).parent)
