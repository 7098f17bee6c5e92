"""What monitors show, and the photographs to take of it (paper 4.2, 4.3).

A patch shows one pattern after the other while all else is black. A pattern is a polynomial of the
patch's coordinates, so the picture on the screen is its light turned into values by the monitor's
curve. Light that falls off with the angle is made up for: what is straight ahead is shown darker,
by one factor for all screens.

Examples
--------
>>> monitors = Monitors(("left",), 2, "linear", 8, 8)
>>> screen, cube = screens_of(monitors)[0], hemicube_of(monitors)
>>> picture(screen, cube, 1, "u", monitors)[..., 0].tolist()[-1]  # of the lower right patch
[0, 0, 0, 0, 99, 163, 206, 240]
>>> [len(photographs(monitors, cube, exposures=(0.1, 1.0))), level(monitors, cube)]
[164, 1.0]
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import FilesError, PhotographsError
from ..hemicube import Hemicube
from ..patterns import PatternSet, monomials, pattern_set
from . import description_file, png_file
from .description import Description, Kind, Monitors, Photograph
from .screen_curve import assumed_curve, value_of
from .screens import Screen, hemicube_of, screen_of, screens_of

# The greys of a calibration. They tell the curve of the camera too, which needs many of them.
STEPS = tuple(step / 64 for step in range(65))
# Degrees at which white is photographed, to find how it falls off.
ANGLES = (0, 20, 40, 60)
BLACK = "black"
WHITE = "white"
# The folder of the pictures to show.
SHOWN = "show"


def patterns_of(monitors: Monitors) -> PatternSet:
    """Find the patterns that monitors can show.

    Parameters
    ----------
    monitors : Monitors

    Returns
    -------
    PatternSet

    Raises
    ------
    PatternError
        There is no such set.
    PhotographsError
        The patterns need light paths told apart, which no camera does.
    """
    patterns = pattern_set(monitors.patterns)
    if any(patterns.paths(name) != "all" for name in patterns.patterns):
        raise PhotographsError(
            f"no monitor can show the patterns '{monitors.patterns}', which tell light paths "
            "apart: choose 'paper', 'moments_uv' or 'packed'"
        )
    return patterns


def level(monitors: Monitors, hemicube: Hemicube, view: str = "ahead") -> float:
    """Compute how bright a pattern of 1 is shown, so that no place of a patch is too dark for it.

    Parameters
    ----------
    monitors : Monitors
    hemicube : Hemicube
    view : str
        See `screens.to_hemicube`.

    Returns
    -------
    float
        Of white straight ahead, 0 to 1.
    """
    if not monitors.falls:
        return 1.0
    least = 1.0
    screens = screens_of(monitors, view)
    at = np.meshgrid([0.0, 1.0], [0.0, 1.0])
    for k in range(len(hemicube)):
        screen = screens[screen_of(hemicube, k, screens)]
        directions = hemicube.directions(k, *at)
        cosines = -(directions @ screen.normal)
        least = min(least, float(cosines.min()))
    return max(least, 1e-3) ** monitors.falls


@lru_cache(maxsize=2)
def _located(screen: Screen, hemicube: Hemicube) -> tuple[NDArray, NDArray, NDArray]:
    """The patch, u and v of each pixel of a screen."""
    return hemicube.locate(screen.places)


def emitted(
    screen: Screen,
    hemicube: Hemicube,
    k: int,
    pattern: str,
    monitors: Monitors,
    whole: float = 1.0,
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Compute the light that the pixels of a patch are to shine for a pattern.

    Parameters
    ----------
    screen : Screen
    hemicube : Hemicube
    k : int
        The number of the patch.
    pattern : str
        Its name in the set.
    monitors : Monitors
    whole : float
        See `level`.

    Returns
    -------
    inside : (h, w) bool
        The pixels of the patch.
    light : (n, 3) float64
        Theirs, straight ahead, as a share of white's.
    """
    patch, u, v = _located(screen, hemicube)
    inside = patch == k
    rows = patterns_of(monitors).emission(pattern)
    m = monomials(u[inside], v[inside])
    # a channel of grains shows their mean: no camera resolves them
    shown = [m[0] / 2 if row is None else np.tensordot(np.array(row), m, axes=1) for row in rows]
    light = np.stack(shown * (3 // len(shown)), axis=-1)
    if monitors.falls:
        light *= (whole / screen.cosines(screen.places[inside]) ** monitors.falls)[:, None]
    return inside, np.clip(light, 0, 1)


def picture(
    screen: Screen,
    hemicube: Hemicube,
    k: int,
    pattern: str,
    monitors: Monitors,
    whole: float = 1.0,
) -> NDArray[np.uint8]:
    """Make the picture that shows a pattern.

    Parameters
    ----------
    screen, hemicube, k, pattern, monitors, whole
        See `emitted`.

    Returns
    -------
    (h, w, 3) uint8
        Values, by the monitor's curve; of a monitor that nobody measured, by a power of 2.2.
    """
    inside, light = emitted(screen, hemicube, k, pattern, monitors, whole)
    curve = assumed_curve() if monitors.curve is None else np.array(monitors.curve)
    out = np.zeros((*inside.shape, 3), np.uint8)
    out[inside] = np.rint(255 * value_of(curve, light)).astype(np.uint8)
    return out


def names_of(monitors: Monitors, hemicube: Hemicube) -> list[tuple[str, int, int, str]]:
    """List what is shown: of each patch, each pattern.

    Parameters
    ----------
    monitors : Monitors
    hemicube : Hemicube

    Returns
    -------
    list of (name, patch, pattern, side)
        The name of the picture without its ending; the numbers of patch and pattern; the screen's
        side.
    """
    patterns, screens = patterns_of(monitors), screens_of(monitors)
    out = []
    for k in range(len(hemicube)):
        side = screens[screen_of(hemicube, k, screens)].side
        for p, name in enumerate(patterns.patterns):
            out.append((f"{side}/{k:04d}_{name}", k, p, side))
    return out


def photographs(
    monitors: Monitors,
    hemicube: Hemicube,
    exposures: Sequence[float] = (1.0,),
    ending: str = "jpg",
    steps: Sequence[float] = STEPS,
) -> tuple[Photograph, ...]:
    """List the photographs to take, by the names that they are to have.

    Parameters
    ----------
    monitors : Monitors
    hemicube : Hemicube
    exposures : sequence of float
        Seconds.
    ending : str
        Of the camera's files.
    steps : sequence of float
        The greys of the calibration.

    Returns
    -------
    tuple of Photograph
        Grey steps of the first side; of each side black; every pattern; and the first pattern a
        second time, which tells the noise.
    """
    out: list[Photograph] = []

    def take(name: str, kind: Kind, **of: object) -> None:
        for i, seconds in enumerate(exposures):
            end = f"_{i}.{ending}" if len(exposures) > 1 else f".{ending}"
            out.append(Photograph(name + end, kind, exposure=seconds, **of))  # type: ignore

    first = monitors.sides[0]
    for step in steps:
        take(f"steps/{round(255 * step):03d}", Kind.STEP, step=step, side=first)
    for side in monitors.sides:
        take(f"{side}/{BLACK}", Kind.DARK, side=side)
    every = names_of(monitors, hemicube)
    for name, k, p, side in every:
        take(name, Kind.PATTERN, patch=k, pattern=p, side=side)
    for name, k, p, side in every[:: max(1, len(every) // 4)][:4]:
        take(f"{name}_again", Kind.PATTERN, patch=k, pattern=p, side=side, take=1)
    return tuple(out)


def write(
    folder: Path,
    monitors: Monitors,
    exposures: Sequence[float] = (1.0,),
    ending: str = "jpg",
    view: str = "ahead",
) -> int:
    """Write the pictures to show, and the description of the photographs to take.

    Parameters
    ----------
    folder : Path
        Gets a folder `show` and `photographs.json`.
    monitors : Monitors
    exposures : sequence of float
        Seconds.
    ending : str
        Of the camera's files.
    view : str
        See `screens.to_hemicube`.

    Returns
    -------
    int
        How many pictures there are to show.

    Raises
    ------
    FilesError
        A file cannot be written, or the folder has photographs that another rig was described for.
    PatternError, PhotographsError
        The monitors cannot be, or cannot show the patterns.
    """
    hemicube, screens = hemicube_of(monitors, view), screens_of(monitors, view)
    patterns_of(monitors)
    whole = level(monitors, hemicube, view)
    said = Description(
        photographs(monitors, hemicube, exposures, ending), monitors=monitors, view=view
    )
    there = folder / description_file.FILE
    if there.exists() and description_file.read(there).monitors is None:
        raise FilesError(f"{there} is of other photographs: choose another folder")
    by_side = {screen.side: screen for screen in screens}
    count = 0

    def put(name: str, pixels: NDArray[np.uint8]) -> None:
        nonlocal count
        path = folder / SHOWN / f"{name}.png"
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as e:
            raise FilesError(f"{path.parent} cannot be made ({e}): choose another folder") from e
        png_file.write(path, pixels)
        count += 1

    size = monitors.height, monitors.width, 3
    for step in STEPS:
        value = round(255 * step)
        put(f"steps/{value:03d}", np.full(size, value, np.uint8))
    put(BLACK, np.zeros(size, np.uint8))
    for name, k, p, side in names_of(monitors, hemicube):
        pattern = pattern_set(monitors.patterns).patterns[p]
        put(name, picture(by_side[side], hemicube, k, pattern, monitors, whole))
    description_file.write(folder, said)
    return count
