"""The thread that works out live pictures. A newer wish replaces one that was not begun."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...core.errors import ArtoError, FieldError
from ...core.light.environment import Environment
from ...core.light.lamps import split
from ...core.light.light import PatchLight
from ...core.preview import Preview
from ...core.relight import over

# Seconds that a picture may take while the artist changes the world.
MOVING = 0.06


@dataclass(frozen=True, eq=False)
class Wish:
    """What to show.

    image: a map of the world at strength 1, not turned (`maps`); strength, turn: applied to the
    map; own: brightness of the scene's own lamps; gains: for each group of these lamps; resting:
    whether the picture has full size, however long it takes; view: for the world behind the scene,
    the direction of each pixel, (H, W, 3), 0 outside the render region, None where no world is seen
    behind; at: when the picture was wished for, in seconds.
    """

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
    """A picture that was worked out.

    picture: (h, w, 4) at 1 / factor of the full size, rows top-down; latency: seconds from the wish
    to the picture; suns: the share of the light of suns that a relight would render by themselves;
    0 where there are none, and for pictures of less than the full size.
    """

    wish: Wish
    picture: NDArray[np.float32]
    factor: int
    latency: float
    suns: float = 0.0


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
        """Ask for a picture. An earlier wish that was not begun is dropped."""
        with self._condition:
            self._wish = wish
            self._condition.notify()

    def take(self) -> Drawn | None:
        """The newest picture; None where there is none since the last call."""
        with self._condition:
            shown, self._shown = self._shown, None
            return shown

    @property
    def idle(self) -> bool:
        """Whether no picture is wished for, being made, or waiting to be taken."""
        with self._condition:
            return self._wish is None and self._shown is None and not self._busy

    _busy = False

    def close(self, wait: bool = True) -> None:
        """End the thread, after the picture that it is at. wait: until it has ended."""
        with self._condition:
            self._closed = True
            self._condition.notify()
        if wait:
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
    """Work out the picture of a wish. Raises FieldError."""
    image, factor = wish.image, 1
    if not wish.resting:
        image, factor = _coarse(image), preview.factor_for(MOVING)
    environment = Environment(image * np.float32(wish.strength), wish.turn)
    light = PatchLight(environment, preview.hemicube)
    picture = preview.picture(light, factor, wish.own, wish.gains)
    if wish.view is not None:
        # the direction in the middle of each of the larger pixels
        view = wish.view[factor // 2 :: factor, factor // 2 :: factor]
        view = view[: picture.shape[0], : picture.shape[1]]
        h, w = view.shape[:2]
        there = view.any(axis=-1, keepdims=True)
        through = preview.through(factor)
        through = None if through is None else through[:h, :w]
        behind = over(picture[:h, :w], environment.at(view), through)
        picture[:h, :w] = np.where(there, behind, picture[:h, :w])
    if not np.isfinite(picture).all():
        raise FieldError(
            "the picture is infinite or not a number in some pixels: look what is so bright in the "
            "world, or capture again"
        )
    suns = _suns(wish.image) if wish.resting else 0.0
    return Drawn(wish, picture, factor, time.perf_counter() - wish.at, suns)


# The last map whose suns were looked for, and their share: a turn or a strength does not change it.
_lit: list[tuple[NDArray[np.float32], float]] = []


def _suns(image: NDArray[np.float32]) -> float:
    """The share of a map's light that suns have which are worth a render; 0 for none."""
    if not _lit or _lit[0][0] is not image:
        found = split(Environment(image))
        _lit[:] = [(image, found.share if found.worth else 0.0)]
    return _lit[0][1]


# The last map that was made coarser, and the result: while a world is turned its map is the same.
_last: list[tuple[NDArray[np.float32], NDArray[np.float32]]] = []
COARSE = 512


def _coarse(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """A map with blocks of texels averaged, about `COARSE` texels across where the sizes divide."""
    if _last and _last[0][0] is image:
        return _last[0][1]
    height, width = image.shape[:2]
    scale = width // COARSE
    if scale < 2 or width % scale or height % scale:
        return image
    out = Environment(image).coarser(scale).image
    _last[:] = [(image, out)]
    return out
