"""Photographs that are opened: their sizes and exposures are checked, their curve and shifts known.

Nothing of a picture is kept in memory. `light` reads the rows that it is asked for.

Examples
--------
>>> from arto.core.photographs.description import Lamp
>>> from arto.core.photographs.reader import InMemory
>>> said = Description((Photograph("a", Kind.LIGHT, lamp=0),), (Lamp((0.0, 0.0, 1.0)),))
>>> half = InMemory(np.full((4, 6, 3), 0.5), linear=True)
>>> there = Photographs(Path("there"), said, lambda path: half)
>>> there.shape, float(there.light(said.photographs).max()), there.assumed
((4, 6), 0.5, '')
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import PhotographsError
from . import agree
from . import curve as curves
from .curve import DARKEST, Curve
from .description import LINEAR, SRGB, Description, Kind, Photograph
from .reader import Picture, Reader
from .shift import Shift, edges, middle, put_back, shift_of

# Exposures nearer than this ratio are one.
SAME = 1.02
# Groups of exposures that tell the curve, pixels of each, rows of a large picture; enough greys.
GROUPS, PIXELS, ROWS, GREYS = 8, 100, 512, 6
# Pixels of a picture that are looked at whole.
SMALL = 1 << 22


class Photographs:
    """The photographs of a folder, opened.

    Parameters
    ----------
    folder : Path
    said : Description
        As `folder.read` gives it.
    reader : callable
        Opens a picture, see `reader.Reader`.

    Raises
    ------
    PhotographsError
        A picture cannot be read, two have different sizes, or exposures are missing.
    """

    def __init__(self, folder: Path, said: Description, reader: Reader) -> None:
        self.folder = folder
        self._pictures: dict[str, Picture] = {}
        for photo in said.photographs:
            self._pictures[photo.file] = reader(folder / photo.file)
        first = said.photographs[0].file
        self.shape = self._pictures[first].shape
        for name, picture in self._pictures.items():
            if picture.shape != self.shape:
                (h, w), (y, x) = self.shape, picture.shape
                raise PhotographsError(
                    f"'{first:.80}' is {w} x {h} and '{name:.80}' is {x} x {y}: photographs of one "
                    "shot have one size"
                )
        height, width = self.shape
        if (said.height or height, said.width or width) != self.shape:
            raise PhotographsError(
                f"the photographs are {width} x {height}, and their description says "
                f"{said.width} x {said.height}"
            )
        self.said = replace(said, height=height, width=width, photographs=self._exposed(said))
        self.assumed = ""
        self.moved: dict[str, Shift] = {}

    def _exposed(self, said: Description) -> tuple[Photograph, ...]:
        """The photographs with what their files say of the exposure."""
        out = []
        for photo in said.photographs:
            there = self._pictures[photo.file]
            out.append(
                replace(
                    photo,
                    exposure=photo.exposure or there.exposure,
                    aperture=photo.aperture or there.aperture,
                    iso=photo.iso or there.iso,
                )
            )
        lit = [p for p in out if p.kind is not Kind.MASK]
        without = [p for p in lit if p.exposure is None]
        if without and len(without) < len(lit):
            raise PhotographsError(
                f"'{without[0].file:.80}' does not say its exposure, and others do: say it in "
                "photographs.json, or in the files' names (as in lamp_1-60s.jpg)"
            )
        for group in groups(lit).values():
            if len(group) > 1 and group[0].exposure is None:
                raise PhotographsError(
                    f"'{group[0].file:.60}' and '{group[1].file:.60}' are of one light, and do not "
                    "say their exposures: say them in photographs.json, or in the files' names "
                    "(as in lamp_1-60s.jpg)"
                )
        return tuple(out)

    @property
    def pictures(self) -> dict[str, Picture]:
        """The pictures, by their names."""
        return self._pictures

    @property
    def focal(self) -> float | None:
        """The lens for a picture 36 millimetres wide, in millimetres, if something tells it."""
        noted = (p.focal for p in self._pictures.values())
        return self.said.focal or next((f for f in noted if f), None)

    def group(self, kind: Kind, **of: Any) -> tuple[Photograph, ...]:
        """Take the photographs of one light.

        Parameters
        ----------
        kind : Kind
        **of : object
            Values of the photographs, by their names in `Photograph`.

        Returns
        -------
        tuple of Photograph
            All exposures and takes.
        """
        return tuple(
            p for p in self.said.of(kind) if all(getattr(p, n) == v for n, v in of.items())
        )

    @cached_property
    def curve(self) -> Curve:
        """The camera's curve: what is said, or what exposures tell, or sRGB's, which is `assumed`.

        Raises PhotographsError where exposures are there and do not tell.
        """
        said = self.said.curve
        if isinstance(said, str):
            return Curve(None) if said == LINEAR else curves.srgb()
        if said is not None:
            return curves.of_rows(said)
        lit = [p for p in self.said.photographs if p.kind is not Kind.MASK]
        if all(self._pictures[p.file].linear for p in lit):
            return Curve(None)
        several = [g for g in groups(lit).values() if len(_times(g)) > 1]
        if not several:
            if found := self._agreeing(lit):
                self.assumed = found
                return Curve(None)
            self.assumed = (
                f"the camera's curve is taken for that of {SRGB}, because no light was "
                "photographed with two exposures"
            )
            return curves.srgb()
        # greys of a monitor are even pictures of all brightnesses: they tell it best
        greys = [g for g in several if g[0].kind is Kind.STEP]
        some = np.unique(np.linspace(0, len(several) - 1, GROUPS).round().astype(int))
        return self._found(greys if len(greys) >= GREYS else [several[i] for i in some])

    def _agreeing(self, lit: Sequence[Photograph]) -> str:
        """Why values are taken for light, in words; "" where sRGB's curve agrees as well."""
        lamps = [lamp.place or lamp.direction for lamp in self.said.lamps]
        first = [self.group(Kind.LIGHT, lamp=k)[:1] for k in range(len(lamps))]
        several = len(lamps) < agree.FEWEST or len(lit) > len(lamps)
        if several or None in lamps or () in first:
            return ""
        directions = np.array(lamps, np.float64)
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        strengths = np.array([lamp.strength for lamp in self.said.lamps])[:, None]
        values = [self._sample(photo).reshape(-1, 3) for (photo,) in first]
        step = max(1, len(values[0]) // PIXELS**2)
        some = np.stack([v[::step] for v in values])
        return agree.why_light(some, directions, strengths)

    def _found(self, several: list[tuple[Photograph, ...]]) -> Curve:
        """The curve that groups of exposures tell."""
        exposures = sorted({t for g in several for t in _times(g)})
        # exposures of all groups in one table: a group lacks those that it was not taken with
        rows, levels = [], 255
        for group in several:
            values = np.full((PIXELS, len(exposures), 3), -1.0, np.float32)
            there = {p.file: self._sample(p) for p in group}
            levels = max(levels, *(self._pictures[p.file].levels for p in group))
            one = sorted(group, key=_time)[len(group) // 2]
            at = _places(there[one.file], one.kind is Kind.STEP)
            for photo in group:
                column = int(np.argmin(np.abs(np.log(np.array(exposures) / _time(photo)))))
                values[: len(at), column] = there[photo.file].reshape(-1, 3)[at]
            rows.append(values[: len(at)])
        return curves.find(np.concatenate(rows), np.array(exposures), levels)

    def _sample(self, photo: Photograph) -> NDArray[np.float32]:
        """Values of a photograph, or of some rows in its middle."""
        height, width = self.shape
        if height * width <= SMALL:
            return self._values(photo, 0, height)
        first = max(0, height // 2 - ROWS // 2)
        return self._values(photo, first, min(height, first + ROWS))

    def _values(self, photo: Photograph, first: int, last: int) -> NDArray[np.float32]:
        """Rows of a photograph, put back where it moved."""
        picture, shift = self._pictures[photo.file], self.moved.get(photo.file)
        if shift is None:
            return picture.rows(first, last)
        height = self.shape[0]
        low, high = max(0, min(first + shift.y, height - 1)), min(height, max(last + shift.y, 1))
        rows = picture.rows(low, high)
        at = np.clip(np.arange(first, last) + shift.y, low, high - 1) - low
        return put_back(rows[at], shift.x, 0)

    def light(
        self, group: Sequence[Photograph], first: int = 0, last: int | None = None
    ) -> NDArray[np.float32]:
        """Compute the light of one group of exposures.

        Parameters
        ----------
        group : sequence of Photograph
            Of one light: exposures, and takes, which are averaged.
        first, last : int
            Rows; all by default.

        Returns
        -------
        (rows, W, 3) float32
            Scene-linear for an exposure of 1. NaN in a pixel that is saturated in all exposures.
        """
        light, saturated = self.measured(group, first, last)
        light[saturated] = np.nan
        return light

    def measured(
        self, group: Sequence[Photograph], first: int = 0, last: int | None = None
    ) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """Compute the light of one group of exposures, and where it is more than that.

        Parameters
        ----------
        group, first, last : as of `light`

        Returns
        -------
        light : (rows, W, 3) float32
        saturated : (rows, W) bool
        """
        last = self.shape[0] if last is None else last
        takes: dict[int, list[Photograph]] = {}
        for photo in group:
            takes.setdefault(photo.take, []).append(photo)
        total, saturated = np.zeros((last - first, self.shape[1], 3)), np.zeros(0, np.bool_)
        for number, some in enumerate(takes.values()):
            values = np.stack([self._values(p, first, last) for p in some])
            times = np.array([_time(p) for p in some])
            light, bright, _ = curves.merged(values, times, self.curve)
            total += light / len(takes)
            saturated = bright if number == 0 else saturated | bright
        return total.astype(np.float32), saturated

    def find_shifts(self) -> Iterator[float]:
        """Find which photographs moved against the others, and put them back from now on: `moved`.

        Yields
        ------
        float
            The share that is done.
        """
        self.moved = {}
        lit = [p for p in self.said.photographs if p.kind not in (Kind.MASK, Kind.STEP, Kind.DARK)]
        every = list(groups(lit).values())
        rows, columns = middle(self.shape, len(every))
        best: list[Photograph] = []
        own: dict[str, NDArray] = {}
        for number, group in enumerate(every):
            seen = {
                p.file: self._pictures[p.file].rows(rows.start, rows.stop)[:, columns].copy()
                for p in group
            }
            one = max(group, key=lambda p: _shows(seen[p.file]))
            best.append(one)
            own[one.file] = self._edges(seen[one.file])
            for photo in group:
                if photo is not one and _shows(seen[photo.file]) > 0.02:
                    there = self._edges(seen[photo.file])
                    self._note(photo, shift_of(own[one.file], there))
            yield 0.8 * (number + 1) / len(every)
        for _ in range(2):
            mean = sum(
                put_back(own[p.file], s.x, s.y) if (s := self.moved.get(p.file)) else own[p.file]
                for p in best
            )
            for photo in best:
                was = self.moved.get(photo.file)
                mine = put_back(own[photo.file], was.x, was.y) if was else own[photo.file]
                if len(best) > 2:
                    self._note(photo, shift_of(np.asarray(mean - mine), own[photo.file]))
        # exposures moved against the best one of their light, and that one against the others
        for group, one in zip(every, best, strict=True):
            base = self.moved.get(one.file)
            for photo in group:
                if base and photo is not one:
                    there = self.moved.get(photo.file, Shift(0, 0, 0.0, True))
                    x, y = there.x + base.x, there.y + base.y
                    self._note(photo, Shift(x, y, there.better + base.better, True))
        yield 1.0

    def _note(self, photo: Photograph, shift: Shift) -> None:
        self.moved.pop(photo.file, None)
        if shift.moved:
            self.moved[photo.file] = shift

    def _edges(self, values: NDArray) -> NDArray[np.float32]:
        return edges(self.curve.light(values).sum(axis=-1)).astype(np.float32)

    def check_light(self) -> None:
        """Check that the photographs show something.

        Raises
        ------
        PhotographsError
            All are black.
        """
        lit = [*self.said.of(Kind.LIGHT), *self.said.of(Kind.PATTERN)]
        for photo in lit:
            values = self._sample(photo)
            limit = DARKEST if self._pictures[photo.file].levels else 0.0
            if not np.isfinite(values).all():
                raise PhotographsError(f"'{photo.file:.80}' has pixels that are no number")
            if float(np.percentile(values, 99.9)) > limit:
                return
        raise PhotographsError(
            "all photographs are black: photograph with a longer exposure, or with the lamps on"
        )


def groups(photos: Sequence[Photograph]) -> dict[tuple[Any, ...], tuple[Photograph, ...]]:
    """Put the exposures of one light together.

    Parameters
    ----------
    photos : sequence of Photograph

    Returns
    -------
    dict of tuple to tuple of Photograph
        By all that decides the light, and the take.
    """
    out: dict[tuple[Any, ...], tuple[Photograph, ...]] = {}
    for p in photos:
        key = p.kind, p.lamp, p.patch, p.pattern, p.step, p.side, p.angle, p.take
        out[key] = (*out.get(key, ()), p)
    return out


def _time(photo: Photograph) -> float:
    """How much light a photograph lets in."""
    return (photo.exposure or 1.0) * (photo.iso or 100.0) / 100.0 / (photo.aperture or 1.0) ** 2


def _times(group: Sequence[Photograph]) -> list[float]:
    """The exposures of a group that differ."""
    out: list[float] = []
    for time in sorted(_time(p) for p in group):
        if not out or time > out[-1] * SAME:
            out.append(time)
    return out


def _shows(values: NDArray) -> float:
    """The share of pixels between black and white."""
    grey = values.mean(axis=-1)
    return float(((grey > 0.05) & (grey < 0.95)).mean())


def _places(values: NDArray, one_light: bool = False) -> NDArray[np.intp]:
    """Pixels of a photograph that are as their neighbours, spread over all values it has."""
    if one_light:
        return np.linspace(0, values[..., 0].size - 1, PIXELS).astype(np.intp)
    grey = values.mean(axis=-1)
    rough = np.zeros(grey.shape)
    for axis in (0, 1):
        rough = np.maximum(rough, np.abs(grey - np.roll(grey, 1, axis)))
        rough = np.maximum(rough, np.abs(grey - np.roll(grey, -1, axis)))
    even = np.flatnonzero(rough <= max(float(np.percentile(rough, 40)), 1e-6))
    order = even[np.argsort(grey.ravel()[even], kind="stable")]
    # as many dark as bright ones: by value, not by how many there are
    wanted = np.linspace(float(grey.min()), float(grey.max()), PIXELS)
    at = np.searchsorted(grey.ravel()[order], wanted).clip(0, len(order) - 1)
    return np.unique(order[at])
