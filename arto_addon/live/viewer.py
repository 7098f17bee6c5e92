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
from ..resident.prepared import without_outlines

# Seconds that a picture may take while the artist changes the world.
MOVING = 0.06


@dataclass(frozen=True, eq=False)
class Wish:
    """What to show.

    image: a map of the world at strength 1, not turned (`maps`); strength, turn: applied to the
    map; own: brightness of the scene's own lamps; gains: for each group of these lamps; resting:
    whether the picture has full size, however long it takes; view: for the world behind the scene,
    the direction of each pixel, (H, W, 3), 0 outside the render region, None where no world is seen
    behind; suns: a render of the map's suns at strength 1, (h, w, 4) with its alpha, at 1 / of_suns
    of the full size, None where the field shows them; clean: the picture of full size without the
    world behind, (H, W, 3), where it was denoised; alpha: its alpha, (H, W, 1); at: when the
    picture was wished for, in seconds.
    """

    image: NDArray[np.float32]
    strength: float
    turn: float
    own: float
    gains: Mapping[str, float]
    resting: bool
    view: NDArray[np.float32] | None = None
    suns: NDArray[np.float32] | None = None
    of_suns: int = 1
    clean: NDArray[np.float32] | None = None
    alpha: NDArray[np.float32] | None = None
    at: float = field(default_factory=time.perf_counter)


@dataclass(frozen=True, eq=False)
class Drawn:
    """A picture that was worked out.

    picture: (h, w, 4) at 1 / factor of the full size, rows top-down; latency: seconds from the wish
    to the picture; suns: the share of the light of suns that a relight would render by themselves;
    0 where there are none, and for pictures of less than the full size; shown: of full size, what
    the field shows, (H, W, 4), without rendered suns and the world behind.
    """

    wish: Wish
    picture: NDArray[np.float32]
    factor: int
    latency: float
    suns: float = 0.0
    shown: NDArray[np.float32] | None = None


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
    factor = 1 if wish.resting else preview.factor_for(MOVING)
    image = wish.image if wish.resting else _coarse(wish.image)
    environment = Environment(image * np.float32(wish.strength), wish.turn)
    if wish.clean is not None and wish.alpha is not None:
        shown = np.concatenate([wish.clean, wish.alpha], axis=-1)
    else:
        lit = environment
        if wish.suns is not None:
            rest = _rest(wish.image, wish.resting)
            lit = Environment(rest * np.float32(wish.strength), wish.turn)
        light = PatchLight(lit, preview.hemicube)
        shown = preview.picture(light, factor, wish.own, wish.gains)
    picture = shown.copy()
    if wish.suns is not None and wish.clean is None:
        _add(picture, factor, wish.suns, wish.of_suns, wish.strength)
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
    suns = _split(wish.image)[0] if wish.resting else 0.0
    latency = time.perf_counter() - wish.at
    return Drawn(wish, picture, factor, latency, suns, shown if wish.resting else None)


def _add(
    picture: NDArray[np.float32],
    factor: int,
    suns: NDArray[np.float32],
    of_suns: int,
    strength: float,
) -> None:
    """Add suns to a picture (h, w, 4) at 1 / factor of the full size. suns: see `Wish`."""
    h, w = picture.shape[:2]
    if of_suns > factor:
        suns = suns.repeat(of_suns // factor, 0).repeat(of_suns // factor, 1)
    elif of_suns < factor:
        n = factor // of_suns
        down, across = -suns.shape[0] % n, -suns.shape[1] % n
        suns = np.pad(suns, ((0, down), (0, across), (0, 0)), mode="edge")
        rows, columns = suns.shape[0] // n, suns.shape[1] // n
        suns = suns.reshape(rows, n, columns, n, 4).mean(axis=(1, 3), dtype=np.float32)
    h, w = min(h, suns.shape[0]), min(w, suns.shape[1])
    light = without_outlines(suns[:h, :w], picture[:h, :w, 3])
    picture[:h, :w, :3] += np.float32(strength) * light


# The last maps whose suns were looked for: the share of the suns, 0 where they are not worth a
# render, and the map without them. A turn or a strength does not change them.
_splits: list[tuple[NDArray[np.float32], float, NDArray[np.float32]]] = []


def _split(image: NDArray[np.float32]) -> tuple[float, NDArray[np.float32]]:
    """The share of a map's suns in its light, 0 for none, and the map without them, (H, W, 3)."""
    for known, share, rest in _splits:
        if known is image:
            return share, rest
    found = split(Environment(image))
    _splits.append((image, found.share if found.worth else 0.0, found.rest.image))
    del _splits[:-3]
    return _splits[-1][1:]


def _rest(image: NDArray[np.float32], resting: bool) -> NDArray[np.float32]:
    """A map without its suns, coarse while the light moves -> (H, W, 3)."""
    if resting:
        return _split(image)[1]
    known = next((rest for map_, _, rest in _splits if map_ is image), None)
    # to look for the suns in a full map takes longer than a moving picture may
    return _coarse(known) if known is not None else _split(_coarse(image))[1]


# The last maps that were made coarser, and the results: while a world is turned its map is the
# same.
_last: list[tuple[NDArray[np.float32], NDArray[np.float32]]] = []
COARSE = 512


def _coarse(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """A map with blocks of texels averaged, about `COARSE` texels across where the sizes divide."""
    for known, out in _last:
        if known is image:
            return out
    height, width = image.shape[:2]
    scale = width // COARSE
    if scale < 2 or width % scale or height % scale:
        return image
    out = Environment(image).coarser(scale).image
    _last.append((image, out))
    del _last[:-2]
    return out
