"""The thread that works out live pictures: the newest wish wins, the others are never begun."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...core.errors import ArtoError
from ...core.light.environment import Environment
from ...core.light.light import PatchLight
from ...core.preview import Preview

# A picture for a moving hand takes no longer than this.
MOVING = 0.06


@dataclass(frozen=True, eq=False)
class Wish:
    """What to show. image: a map of strength 1 and no turn, see `maps`; own, gains: of the scene's
    own lamps; resting: at full size, however long it takes; view: the directions of the pixels, for
    the world behind, (h, w, 3), 0 where nothing is, None where it is not seen at all."""

    image: NDArray[np.float32]
    strength: float
    turn: float
    own: float
    gains: Mapping[str, float]
    resting: bool
    view: NDArray[np.float32] | None = None
    at: float = field(default_factory=time.perf_counter)


@dataclass(frozen=True, eq=False)
class Drawn:
    """A picture (h, w, 4), at 1 / factor of the size, rows top-down; what it is of, and how many
    seconds after it was wished for it was there."""

    wish: Wish
    picture: NDArray[np.float32]
    factor: int
    latency: float


class Viewer:
    """Works out pictures of a preview in a thread of its own."""

    def __init__(self, preview: Preview) -> None:
        self.preview = preview
        self._condition = threading.Condition()
        self._wish: Wish | None = None
        self._shown: Drawn | None = None
        self._closed = False
        self.trouble = ""
        # how many pictures were made
        self.made = 0
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def wish(self, wish: Wish) -> None:
        """Ask for a picture; what was asked for before and not begun is forgotten."""
        with self._condition:
            self._wish = wish
            self._condition.notify()

    def take(self) -> Drawn | None:
        """The newest picture that was not taken yet."""
        with self._condition:
            shown, self._shown = self._shown, None
            return shown

    @property
    def idle(self) -> bool:
        """Whether nothing is wished for or in the making, or waits to be taken."""
        with self._condition:
            return self._wish is None and self._shown is None and not self._busy

    _busy = False

    def close(self) -> None:
        with self._condition:
            self._closed = True
            self._condition.notify()
        self._thread.join(10)

    def _run(self) -> None:
        while True:
            with self._condition:
                self._busy = False
                while self._wish is None and not self._closed:
                    self._condition.wait()
                if self._closed:
                    return
                wish, self._wish, self._busy = self._wish, None, True
            assert wish
            try:
                shown = show(self.preview, wish)
                self.trouble = ""
            except ArtoError as e:
                self.trouble = str(e)
                continue
            except Exception as e:
                traceback.print_exc()
                self.trouble = f"{type(e).__name__}: {e}"
                continue
            self.made += 1
            with self._condition:
                self._shown = shown


def show(preview: Preview, wish: Wish) -> Drawn:
    """The picture that is wished for. Raises FieldError."""
    image, factor = wish.image, 1
    if not wish.resting:
        image, factor = _coarse(image), preview.factor_for(MOVING)
    environment = Environment(image * np.float32(wish.strength), wish.turn)
    light = PatchLight(environment, preview.hemicube)
    picture = preview.picture(light, factor, wish.own, wish.gains)
    if wish.view is not None:
        # the middle of each pixel of this size
        view = wish.view[factor // 2 :: factor, factor // 2 :: factor]
        view = view[: picture.shape[0], : picture.shape[1]]
        h, w = view.shape[:2]
        there = view.any(axis=-1, keepdims=True)
        picture[:h, :w, :3] += (1 - picture[:h, :w, 3:]) * environment.at(view) * there
        picture[:h, :w, 3:] = np.where(there, 1, picture[:h, :w, 3:])
    return Drawn(wish, picture, factor, time.perf_counter() - wish.at)


# The last map that was made coarser: a hand turns the same one.
_last: list[tuple[NDArray[np.float32], NDArray[np.float32]]] = []
COARSE = 512


def _coarse(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """A map of no more than `COARSE` texels across, each the mean of those that it covers."""
    if _last and _last[0][0] is image:
        return _last[0][1]
    height, width = image.shape[:2]
    scale = width // COARSE
    if scale < 2 or width % scale or height % scale:
        return image
    out = Environment(image).coarser(scale).image
    _last[:] = [(image, out)]
    return out
