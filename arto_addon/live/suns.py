"""Suns in live pictures: the resident renderer renders them, and denoises the picture at rest.

A patch holds a whole sun, so the field shows a sun's shadows blurred. While the light moves, the
resident renderer renders the suns alone, small and with few samples. At rest it renders them at
full size and denoises the whole picture.
"""

from __future__ import annotations

import contextlib
import itertools
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import arrays, marked
from ...core.errors import ArtoError
from ..blender import denoise, scripts
from ..job import snapshot
from ..resident.prepared import MOST_BYTES, File, Question
from ..resident.resident import Resident, Said
from ..world.lamp_render import lamp_samples
from .source import Opened
from .viewer import Drawn

# Seconds that a picture of suns may take while the light moves, and at rest for each million
# pixels and besides. The most samples while the light moves.
MOVING, RESTING, RESTING_EACH = 0.22, 1.0, 1.5
MOST_SAMPLES = 4
# Within so many seconds suns count as quick: a moving picture then waits for its suns.
QUICK = 1.0
PICTURE, FIELD, MAP = "suns.npy", "shown.npy", "given.npy"

_numbers = itertools.count(1)


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture that the resident renderer made.

    key: of the world; turn: of its map, in radians; factor: how many times smaller it is; pixels:
    of suns alone at strength 1, (h, w, 4) with their render's alpha, or of a whole clean picture,
    (H, W, 3); seconds: from the question to the answer; cpu: seconds of all threads that the
    resident renderer worked, which other programs change less; samples: of the suns.
    """

    key: str
    turn: float
    factor: int
    pixels: NDArray[np.float32]
    seconds: float
    cpu: float
    samples: int


def why_not(opened: Opened) -> str:
    """Say why a shot has no live suns, in words; empty where it has."""
    about = opened.field.about
    if opened.draft:
        return "the capture is not complete"
    if len(opened.preview.takes) > 1:
        return "the shot has shadow catchers"
    if about.far is False:
        return "the hemicube is near"
    if about.view_layer is None or not opened.field.hemicube.closed:
        return "the patches are not all around"
    return ""


class Suns:
    """The newest picture of the suns, and the newest clean picture."""

    def __init__(
        self, resident: Resident, scene: bpy.types.Scene, layer: str, opened: Opened
    ) -> None:
        """Take the snapshot that the suns are rendered in. Raises SceneError."""
        self._resident = resident
        self._field, self._captured = opened.field.folder, opened.field.about.samples
        self.why = why_not(opened)
        whole = not opened.draft and len(opened.preview.takes) == 1
        self.can_clean = whole and denoise.known() is not False
        self.picture: Picture | None = None
        self.cleaned: tuple[object, Picture] | None = None
        self.trouble = ""
        # seconds that the next picture will take; None before the first, which prepares the scene
        self.next: float | None = None
        self._lacks: set[tuple[str, bool]] = set()
        self._asked_at = 0.0
        self._resting = False
        self._file: File | None = None
        self._folder: Path | None = None
        if not self.why and scene.arto.lamps:
            self._file = self._snapshot(scene, layer)

    def _snapshot(self, scene: bpy.types.Scene, layer: str) -> File:
        name = f"file{next(_numbers)}"
        self._folder = marked.make(self._resident.folder / name, "temporary")
        blend, task = snapshot.take(self._folder, "relight", scene, layer)
        return File(str(blend), str(task), scripts.option() == scripts.ALLOWED)

    @property
    def usable(self) -> bool:
        """Whether suns can be rendered."""
        able = self._file is not None and not self.why and not self.trouble
        return able and not self._resident.short

    @property
    def said(self) -> str:
        """Why there are no live suns, where the artist has to be told; else empty."""
        if self._file is not None and self._resident.short:
            return f"{self._resident.short}: a relight renders the suns"
        return self.trouble

    def of(self, key: str) -> Picture | None:
        """The newest picture of the suns of a world."""
        return self.picture if self.picture and self.picture.key == key else None

    @property
    def quick(self) -> bool:
        """Whether the scene is prepared, so that a picture of suns comes in a moment."""
        alive = self._resident.ended == "" and self.usable
        return alive and self.next is not None and self.next < QUICK

    def ask(
        self,
        scene: bpy.types.Scene,
        key: str,
        full: bool,
        turn: float,
        image: NDArray[np.float32],
        factor: int,
        share: float,
    ) -> None:
        """Ask for a picture of the suns while the light moves.

        key, full, image: the map; factor: how many times smaller than the field the picture may
        be; share: of the suns in all light. Raises SceneError.
        """
        most = min(MOST_SAMPLES, lamp_samples(scene, share, self._captured))
        question = self._question(key, full, turn, factor, most, MOVING, scene.arto.denoise)
        self._send(question, image, None, lambda found: setattr(self, "picture", found))

    def ask_clean(
        self,
        scene: bpy.types.Scene,
        key: str,
        turn: float,
        image: NDArray[np.float32],
        whole: Drawn,
        share: float,
        of: object,
    ) -> None:
        """Ask for the whole picture at rest, with its suns, denoised.

        image: the full map; whole: the picture as it is shown; share: of the suns in all light, 0
        for none; of: kept beside the answer. Raises SceneError.
        """
        picture = whole.shown
        assert picture is not None
        height, width = picture.shape[:2]
        seconds = RESTING + RESTING_EACH * height * width / 1e6
        rendered = share > 0 and whole.wish.suns is not None
        samples = lamp_samples(scene, share, self._captured)
        question = self._question(key, True, turn, 1, samples, seconds, True)
        question |= {"resting": True, "suns": rendered, "strength": whole.wish.strength}
        question["picture"] = str(self._resident.folder / FIELD)

        def keep(found: Picture) -> None:
            self.cleaned = of, found

        self._send(question, image, picture[..., :3], keep)

    def _question(
        self, key: str, full: bool, turn: float, factor: int, samples: int, seconds: float,
        clean: bool,
    ) -> dict[str, object]:  # fmt: skip
        given = str(self._resident.folder / MAP) if (key, full) in self._lacks else ""
        file = asdict(self._file) if self._file else {}
        asked = Question(
            file=file, field=str(self._field), key=key, full=full, map=given, turn=turn,
            resting=False, factor=factor, samples=samples, seconds=seconds,
            clean=clean and self.can_clean, picture="", suns=True, strength=1.0,
            out=str(self._resident.folder / PICTURE),
        )  # fmt: skip
        return asdict(asked)

    def _send(
        self,
        question: dict[str, object],
        image: NDArray[np.float32],
        picture: NDArray[np.float32] | None,
        keep: Callable[[Picture], None],
    ) -> None:
        begun = time.monotonic()
        of = str(question["key"]), bool(question["full"])
        self._asked_at, self._resting = begun, bool(question["resting"])

        def write() -> None:
            if question["map"]:
                arrays.write(Path(str(question["map"])), image)
            if picture is not None:
                arrays.write(Path(str(question["picture"])), picture)

        def done(said: Said) -> None:
            if said.lost or said.found.get("stopped"):
                return
            if said.found.get("lacks"):
                self._lacks.add(of)
                return
            self._lacks.discard(of)
            if said.found.get("cannot"):
                self.can_clean = False
                return
            if said.error:
                self.trouble = said.error
                return
            try:
                pixels = arrays.read(Path(str(question["out"])), MOST_BYTES)
            except (OSError, ValueError) as e:
                self.trouble = f"the picture of the suns cannot be read ({e})"
                return
            seconds = time.monotonic() - begun
            factor, samples = int(said.found["factor"]), int(said.found["samples"])
            cpu = float(said.found["cpu"])
            if question["suns"]:
                self.next = float(said.found["next"])
            keep(Picture(of[0], float(question["turn"]), factor, pixels, seconds, cpu, samples))  # type: ignore[arg-type]

        before = write if question["map"] or picture is not None else None
        self._resident.ask("suns", question, done, before)

    def make_way(self) -> None:
        """End the work at a picture at rest: the light moves again."""
        if self._resting and self._resident.at == "suns":
            self._resident.stop()

    def close(self) -> None:
        """Remove the snapshot."""
        if self._folder is not None:
            with contextlib.suppress(ArtoError):
                marked.remove_quietly(self._folder, "temporary", self._folder.parent)
