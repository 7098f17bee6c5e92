"""The description of a folder of photographs: what each picture is of, and in which light.

`photographs.json` says it (`description_file`). Other descriptions (`.lp`, `lights.txt`, CSV) are
read into the same objects, so that everybody behind this door sees one kind. Nothing here opens a
picture.

Directions and places are those of the thing as the camera sees it: x to the right of the picture, y
up, z from the thing towards the camera.

Examples
--------
>>> lamp = Lamp(direction=(0.0, 0.0, 1.0))
>>> pictures = (Photograph("one.jpg", Kind.LIGHT, lamp=0, exposure=0.5),)
>>> said = Description(pictures, lamps=(lamp,), width=640, height=480)
>>> [photo.file for photo in said.of(Kind.LIGHT)], said.to_json()["lamps"]
(['one.jpg'], [{'direction': (0.0, 0.0, 1.0), 'strength': (1.0, 1.0, 1.0)}])
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

FORMAT = "ARTO photographs"
VERSION = 1
FILE = "photographs.json"
LINEAR, SRGB = "linear", "sRGB"

Point = tuple[float, float, float]


class Kind(StrEnum):
    """What a photograph is of."""

    LIGHT = "light"
    """One lamp shines."""
    PATTERN = "pattern"
    """One patch of the monitors shows one pattern."""
    DARK = "dark"
    """The lens is covered, or the patch that would shine is black: what the camera adds."""
    AMBIENT = "ambient"
    """No lamp shines: the light that is always there."""
    STEP = "grey step"
    """A monitor shows one grey."""
    EMPTY = "empty"
    """The set without the thing, in the light of the set."""
    MASK = "mask"
    """Not a photograph: white where the thing is."""


@dataclass(frozen=True)
class Photograph:
    """One picture.

    Parameters
    ----------
    file : str
        Its name in the folder, with `/` between folders.
    kind : Kind
    lamp : int, optional
        Of kind `light`: the number of the lamp.
    patch, pattern : int, optional
        Of kind `pattern`: the numbers of the patch and of the pattern in its set.
    step : float, optional
        Of kind `grey step`: what the monitor was told to show, 0 to 1.
    side : str, optional
        Of kinds `grey step` and `dark`: the monitor's side, a name of `faces.FACES`.
    angle : float, optional
        Of kind `grey step`: degrees between the camera and the line straight ahead of the screen.
    take : int
        Which repetition of one light and one exposure. Two takes tell the noise.
    exposure : float, optional
        Seconds. None where only the file says so.
    aperture, iso : float, optional
        The f-number, and the speed.
    """

    file: str
    kind: Kind
    lamp: int | None = None
    patch: int | None = None
    pattern: int | None = None
    step: float | None = None
    side: str | None = None
    angle: float | None = None
    take: int = 0
    exposure: float | None = None
    aperture: float | None = None
    iso: float | None = None


@dataclass(frozen=True)
class Lamp:
    """One lamp. It has a direction, a place, or both; a place counts before a direction.

    Parameters
    ----------
    direction : tuple of 3 float, optional
        From the thing to the lamp, of any length but 0. None where the chrome ball tells.
    place : tuple of 3 float, optional
        From the thing's middle, in the units of `Description.span`.
    strength : tuple of 3 float
        Of red, green and blue, relative to the other lamps.
    """

    direction: Point | None = None
    place: Point | None = None
    strength: Point = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Monitors:
    """The monitors around the thing.

    Parameters
    ----------
    sides : tuple of str
        Names of `faces.FACES`.
    patches : int
        Patches a side of a monitor.
    patterns : str
        The name of the pattern set.
    width, height : int
        Pixels of the monitor.
    corners : tuple, optional
        Of each side, its four corners at (u, v) = (0, 0), (1, 0), (1, 1), (0, 1), in the units of
        `Description.span`. By default the sides are those of a cube around the thing.
    curve : tuple of 3 rows of float, optional
        Light of each channel at evenly spaced values from 0 to 1. None where photographs of grey
        steps tell.
    falls : float
        Light at an angle is the cosine of the angle to this power of what it is straight ahead; 0
        for a monitor that is as bright from all sides.
    """

    sides: tuple[str, ...]
    patches: int
    patterns: str
    width: int
    height: int
    corners: tuple[tuple[Point, ...], ...] | None = None
    curve: tuple[tuple[float, ...], ...] | None = None
    falls: float = 0.0


@dataclass(frozen=True)
class Description:
    """What a folder of photographs says of itself.

    Parameters
    ----------
    photographs : tuple of Photograph
    lamps : tuple of Lamp
    monitors : Monitors, optional
    width, height : int, optional
        The pictures' size in pixels. None where the first picture says so.
    curve : str or tuple of 3 rows of float, optional
        The camera's curve: `linear`, `sRGB`, or the light of each channel at evenly spaced values
        of a pixel from 0 to 1. None where it is found from exposures, or assumed.
    span : float, optional
        The width of what the picture shows, at the thing, in the unit of all places.
    focal : float, optional
        The lens for a picture 36 millimetres wide, in millimetres.
    white : tuple of 4 int, optional
        x, y, width and height of a white or grey target that every lamp lights; rows from the top.
    ball : tuple of 3 float, optional
        x, y and radius in pixels of a chrome ball in the pictures.
    reach : float, optional
        Degrees around its direction for which a lamp may stand.
    view : str
        `ahead` where the camera looks along the ground, `down` where it looks down on the thing.
    """

    photographs: tuple[Photograph, ...]
    lamps: tuple[Lamp, ...] = ()
    monitors: Monitors | None = None
    width: int | None = None
    height: int | None = None
    curve: str | tuple[tuple[float, ...], ...] | None = None
    span: float | None = None
    focal: float | None = None
    white: tuple[int, int, int, int] | None = None
    ball: Point | None = None
    reach: float | None = None
    view: str = "ahead"

    def of(self, kind: Kind) -> tuple[Photograph, ...]:
        """Take the photographs of one kind.

        Parameters
        ----------
        kind : Kind

        Returns
        -------
        tuple of Photograph
        """
        return tuple(p for p in self.photographs if p.kind is kind)

    def to_json(self) -> dict[str, Any]:
        """Give what `photographs.json` says.

        Returns
        -------
        dict
        """
        pictures = [_told(p) for p in self.photographs]
        out = {"format": FORMAT, "version": VERSION, **_told(self)}
        return out | {"lamps": [_told(lamp) for lamp in self.lamps], "photographs": pictures}


def _told(thing: Any) -> dict[str, Any]:
    """The values of a dataclass that are not None."""
    return {name: value for name, value in asdict(thing).items() if value is not None}
