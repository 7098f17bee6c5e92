"""Photographs of monitors' patterns as a capture set (paper 4.2, 5).

A basis image is the photograph of a pattern without that of black, over the light of white. What
the camera adds, what the monitor shines at black, and the light of the room are in both, and go.

Examples
--------
>>> import tempfile
>>> from arto.core.capture.capture_set import CaptureSet
>>> from arto.core.photographs.shown import photographs
>>> said = Description(photographs=(), monitors=Monitors(("top",), 1, "white", 64, 64))
>>> said = replace(said, photographs=photographs(said.monitors, hemicube_of(said.monitors)))
>>> def taken(photos):  # a thing that shines half of what shines on it, in a dim room
...     shown = {Kind.DARK: 0.1, Kind.STEP: 0.1 + 2 * (photos[0].step or 0) ** 2.2}
...     return np.full((4, 6, 3), shown.get(photos[0].kind, 0.1 + 0.5 * 2))
>>> with tempfile.TemporaryDirectory() as folder:
...     for share in write(Path(folder), said, taken):
...         pass
...     there = CaptureSet(Path(folder)).read(0)
>>> round(float(there.basis.mean()), 6)
0.5
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import exr
from ..capture import head as heads
from ..capture.head import CaptureHead
from ..capture.names import COMBINED, group_name
from ..capture.tile_entry import TileEntry, sums_of
from ..errors import PhotographsError
from ..hemicube import Hemicube
from ..patterns import UU, VV, PatternSet
from ..region import Region
from . import noise as noises
from .description import Description, Kind, Monitors, Photograph
from .screen_curve import falls_of, measured_curve
from .screens import hemicube_of, screen_of, screens_of
from .shown import level, patterns_of

# Gives the light of some photographs of one thing in one light, of several exposures.
Taken = Callable[[tuple[Photograph, ...]], NDArray]
# The part of a picture of a screen, around its middle, that is taken for a grey step.
MIDDLE = 1 / 3


@dataclass(frozen=True)
class Calibrated:
    """What photographs of the screen tell.

    Parameters
    ----------
    monitors : Monitors
        With the curve and the fall-off that were measured.
    white : (3,) float64
        The light of white above black, straight ahead, in the unit of the pictures; 1 where no
        photograph tells.
    black : float
        The light of black as a share of white's.
    """

    monitors: Monitors
    white: NDArray[np.float64]
    black: float


def groups_of(said: Description, kind: Kind) -> dict[tuple[Any, ...], tuple[Photograph, ...]]:
    """Put the exposures of one light together.

    Parameters
    ----------
    said : Description
    kind : Kind

    Returns
    -------
    dict of tuple to tuple of Photograph
        By patch, pattern, side, step, angle and take.
    """
    out: dict[tuple[Any, ...], tuple[Photograph, ...]] = {}
    for photo in said.of(kind):
        key = photo.patch, photo.pattern, photo.side, photo.step, photo.angle or 0.0, photo.take
        out[key] = (*out.get(key, ()), photo)
    return out


def calibrated(said: Description, taken: Taken) -> Calibrated:
    """Measure the monitor by the photographs of its screen.

    Parameters
    ----------
    said : Description
        Without grey steps, the curve is what the description says.
    taken : callable

    Returns
    -------
    Calibrated

    Raises
    ------
    PhotographsError
        There are no monitors, or the grey steps tell no curve.
    """
    monitors = said.monitors
    if monitors is None:
        raise PhotographsError("these photographs are not of monitors: say 'monitors'")
    found = groups_of(said, Kind.STEP)
    straight = {key: group for key, group in found.items() if key[4] == 0}
    aside = {key: group for key, group in found.items() if key[3] == 1}
    white, black = np.ones(3), 0.0
    if straight:
        steps = np.array([key[3] for key in straight])
        lights = np.stack([_middle(taken(group)) for group in straight.values()])
        monitors = replace(monitors, curve=_rows(measured_curve(steps, lights)))
        dark, bright = lights[steps == 0].mean(axis=0), lights[steps == 1].mean(axis=0)
        white, black = bright - dark, float(dark.sum() / bright.sum())
    if len({key[4] for key in aside}) > 1:
        degrees = np.array([key[4] for key in aside])
        lights = np.stack([_middle(taken(group)) for group in aside.values()]).sum(axis=-1)
        monitors = replace(monitors, falls=falls_of(degrees, lights))
    return Calibrated(monitors, white, black)


def _rows(curve: NDArray) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(x) for x in row) for row in curve)


def _middle(picture: NDArray) -> NDArray[np.float64]:
    """(3,): the median light of the middle of a picture."""
    height, width = picture.shape[:2]
    y, x = (max(1, round(n * MIDDLE)) for n in (height, width))
    top, left = (height - y) // 2, (width - x) // 2
    part = picture[top : top + y, left : left + x].reshape(-1, 3)
    middle = np.nanmedian(part, axis=0)
    if not np.isfinite(middle).all():
        raise PhotographsError(
            "a photograph of the screen is saturated or black in its middle: take other exposures"
        )
    # the mean of what is near: a median of few values has their steps
    near = np.abs(part - middle) <= 0.05 * np.maximum(middle, 1e-12)
    sums = np.where(near, part, 0).sum(axis=0)
    return np.where(near.any(axis=0), sums / np.maximum(near.sum(axis=0), 1), middle)


@dataclass(frozen=True)
class Noise:
    """The noise of photographs, see `noise.measured`, in the unit of the pictures.

    Parameters
    ----------
    taken : tuple of 2 float
        Of the photographs.
    left : tuple of 2 float
        Of what `noise.without_noise` makes of them.
    """

    taken: tuple[float, float]
    left: tuple[float, float]

    def over(self, unit: float) -> Noise:
        """Give the noise of pictures that are divided by a light.

        Parameters
        ----------
        unit : float

        Returns
        -------
        Noise
        """
        (a, b), (c, d) = self.taken, self.left
        return Noise((a / unit**2, b / unit), (c / unit**2, d / unit))


def measured_noise(said: Description, taken: Taken) -> Noise | None:
    """Measure the noise by the patterns that were photographed twice.

    Parameters
    ----------
    said : Description
    taken : callable

    Returns
    -------
    Noise or None
        None where nothing was taken twice.
    """
    found = groups_of(said, Kind.PATTERN)
    again = [key for key in found if key[5] == 1 and (*key[:5], 0) in found]
    if not again:
        return None
    pairs = [[taken(found[*key[:5], take]) for key in again] for take in (0, 1)]
    before = noises.measured(*map(np.concatenate, pairs))
    after = [
        np.concatenate([noises.without_noise(_whole(p)[None], before)[0] for p in x]) for x in pairs
    ]
    return Noise(before, noises.measured(*after))


def _whole(light: NDArray) -> NDArray:
    """The light of a photograph. What is saturated is as bright as the brightest that is not."""
    unknown = ~np.isfinite(light)
    if not unknown.any():
        return light
    known = light[~unknown]
    return np.where(unknown, known.max() if known.size else 0.0, light)


def check(said: Description, hemicube: Hemicube, patterns: PatternSet) -> None:
    """Check that there is a photograph of every pattern.

    Parameters
    ----------
    said : Description
    hemicube : Hemicube
    patterns : PatternSet

    Raises
    ------
    PhotographsError
        A pattern was not photographed, or there are patches that the monitors do not have.
    """
    there = {(p.patch, p.pattern) for p in said.of(Kind.PATTERN)}
    wanted = {(k, p) for k in range(len(hemicube)) for p in range(len(patterns))}
    if missing := sorted(wanted - there):
        k, p = missing[0]
        raise PhotographsError(
            f"{len(missing)} of {len(wanted)} photographs are missing, the first that of patch {k} "
            f"({hemicube.patch_name(k)}) with the pattern '{patterns.patterns[p]}'"
        )
    if more := sorted(there - wanted):
        raise PhotographsError(
            f"there is a photograph of patch {more[0][0]} with pattern {more[0][1]}, and the "
            f"monitors have {len(hemicube)} patches and {len(patterns)} patterns"
        )


def basis_images(
    said: Description,
    k: int,
    hemicube: Hemicube,
    patterns: PatternSet,
    measured: Calibrated,
    taken: Taken,
) -> NDArray[np.float64]:
    """Make the basis images of one patch.

    Parameters
    ----------
    said : Description
    k : int
        The number of the patch.
    hemicube : Hemicube
    patterns : PatternSet
    measured : Calibrated
    taken : callable

    Returns
    -------
    (P, H, W, 3) float64
        Scene-linear, for a pattern of radiance 1; below 0 where noise is greater than the light.
    """
    found, dark = groups_of(said, Kind.PATTERN), groups_of(said, Kind.DARK)
    screens = screens_of(measured.monitors, said.view)
    side = screens[screen_of(hemicube, k, screens)].side
    black = [group for key, group in dark.items() if key[2] in (side, None)]
    base = np.mean([_whole(taken(group)) for group in black], axis=0) if black else 0.0
    unit = level(said.monitors or measured.monitors, hemicube, said.view) * measured.white
    out = []
    for p in range(len(patterns)):
        takes = [group for key, group in found.items() if key[:2] == (k, p)]
        out.append((np.mean([_whole(taken(group)) for group in takes], axis=0) - base) / unit)
    return np.stack(out)


def write(
    folder: Path,
    said: Description,
    taken: Taken,
    clean: bool = True,
    alpha: NDArray | None = None,
    **about: Any,
) -> Iterator[float]:
    """Write photographs of monitors as a capture set of one tile, a file for each patch.

    Parameters
    ----------
    folder : Path
    said : Description
    taken : callable
    clean : bool
        Whether noise is taken out, where something was photographed twice.
    alpha : (H, W) float, optional
        How much of each pixel is the thing; by default all.
    **about : object
        What else `capture.json` says, by its names there.

    Yields
    ------
    float
        The share that is done.

    Raises
    ------
    CaptureSetError, ExrError
        The folder cannot be written.
    PhotographsError
        A photograph is missing, or the screen cannot be measured.
    """
    measured = calibrated(said, taken)
    hemicube, patterns = hemicube_of(measured.monitors, said.view), patterns_of(measured.monitors)
    check(said, hemicube, patterns)
    noise = measured_noise(said, taken)
    if noise is not None:
        unit = level(said.monitors or measured.monitors, hemicube, said.view) * float(
            measured.white.mean()
        )
        noise = noise.over(unit)
    names, shape = [], (0, 0)
    for k in range(len(hemicube)):
        images = basis_images(said, k, hemicube, patterns, measured, taken)
        filtered = noises.without_noise(images, noise.taken) if clean and noise else None
        kept = np.maximum(images, 0).astype(np.float32) if filtered is None else filtered
        shape = kept.shape[1:3]
        combined = np.ones((*shape, 4), np.float32)
        if alpha is not None:
            combined[..., 3] = alpha
            kept = kept * combined[..., 3:]
        combined[..., :3] = kept.sum(axis=0, dtype=np.float64)
        layers = {COMBINED: combined}
        for image, name in zip(kept, patterns.patterns, strict=True):
            layers[f"Combined_{group_name(k, name)}"] = image
        names.append(f"tile_0000_{k:04d}.exr")
        exr.write(folder / names[-1], layers)
        yield (k + 1) / (len(hemicube) + 1)
    region = Region(0, 0, shape[1], shape[0])
    tile = TileEntry(region, tuple(names), done=True, sums=sums_of(folder, names))
    left = None if noise is None else noise.left if clean else noise.taken
    plain = CaptureHead(hemicube, patterns, shape[0], shape[1], (tile,), noise=left)
    told = {"choice": choice_of(patterns), "separate": False}
    heads.write(folder, heads.from_json(plain.to_json() | told | about, folder))
    yield 1.0


def choice_of(patterns: PatternSet) -> str:
    """Choose what photographs of some patterns are fitted with.

    Parameters
    ----------
    patterns : PatternSet

    Returns
    -------
    str
        `auto` where the patterns tell spreads; the paper's search where they only tell their sum;
        else `whole`.
    """
    if patterns.identified[UU] and patterns.identified[VV]:
        return "auto"
    return "search" if patterns.rank > 3 else "whole" if patterns.rank == 1 else "auto"
