"""A light of the kit: a flat shape far away, seen from the scene under an angle.

Examples
--------
>>> key = Light("Key", azimuth=30.0, elevation=45.0, width=40.0, height=20.0, stops=2.0)
>>> key.radiance
(4.0, 4.0, 4.0)
>>> round(key.solid_angle, 4)  # a rectangle: 4 asin(sin(20 degrees) sin(10 degrees))
0.2377
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from enum import StrEnum

from ..description import is_finite
from ..errors import KitError
from .colour import of_kelvin

# The largest angle under which a flat shape is seen, and the smallest.
WIDEST, NARROWEST = 175.0, 0.01
Colour = tuple[float, float, float]
WHITE: Colour = (1.0, 1.0, 1.0)


class Kind(StrEnum):
    """What a light is. A strip is a bar with round ends; a flag is a rectangle that takes light."""

    RECTANGLE = "RECTANGLE"
    ROUND = "ROUND"
    RING = "RING"
    STRIP = "STRIP"
    SUN = "SUN"
    PICTURE = "PICTURE"
    FLAG = "FLAG"


class Blend(StrEnum):
    """What a light does with the light behind it: add to it, stand before it, or filter it."""

    ADD = "ADD"
    OVER = "OVER"
    MULTIPLY = "MULTIPLY"


# The longest name of a light, in bytes: Blender cuts off the label of a node after it.
LONGEST = 63
# name of a number -> (its least, its largest)
BOUNDS: dict[str, tuple[float, float]] = {
    "azimuth": (-1e6, 1e6),
    "elevation": (-90.0, 90.0),
    "roll": (-1e6, 1e6),
    "width": (NARROWEST, WIDEST),
    "height": (NARROWEST, WIDEST),
    "softness": (0.0, 1.0),
    "gradient": (-1.0, 1.0),
    "slope": (-1.0, 1.0),
    "hole": (0.0, 0.99),
    "kelvin": (1000.0, 20000.0),
    "tint": (-1.0, 1.0),
    "strength": (0.0, 1e9),
    "stops": (-30.0, 30.0),
    "amount": (0.0, 1.0),
    "blur": (0.0, 180.0),
    "turn": (-1e6, 1e6),
}


def check(of: object, what: str) -> None:
    """Check the numbers and colours of a light, a base or a kit.

    Parameters
    ----------
    of : dataclass
    what : str
        How a message names it.

    Raises
    ------
    KitError
        A number is out of `BOUNDS`, or a colour is no colour.
    """
    for field in fields(of):  # type: ignore[arg-type]
        value = getattr(of, field.name)
        if field.name in BOUNDS and str(field.type) == "float":
            low, high = BOUNDS[field.name]
            if not is_finite(value) or not low <= value <= high:
                raise KitError(f"{what}: '{field.name}' is from {low:g} to {high:g}, not {value}")
        elif str(field.type) == "Colour" and (
            len(value) != 3 or not all(is_finite(x) and 0 <= x <= 1e9 for x in value)
        ):
            raise KitError(f"{what}: '{field.name}' is three numbers from 0 on, not {value}")
        elif str(field.type) == "str":
            _check_text(value, field.name, what)


def _check_text(text: str, name: str, what: str) -> None:
    """Raise KitError for a text that no file can hold, or a name that Blender would cut off."""
    try:
        size = len(text.encode())
    except UnicodeEncodeError:
        size = -1
    if size < 0 or "\0" in text or (name == "name" and size > LONGEST):
        raise KitError(
            f"{what}: '{name}' is a text of UTF-8 without zeros"
            + (f", of at most {LONGEST} bytes" if name == "name" else "")
        )


@dataclass(frozen=True)
class Light:
    """A light of the kit.

    Parameters
    ----------
    name : str
        Two lights of a kit never have the same name.
    kind : Kind
    blend : Blend
    azimuth, elevation, roll : float
        Degrees.
    width, height : float
        The angles under which the sides are seen, in degrees. A sun is round: its width counts.
    softness : float
        How much of the way from the rim to the middle the edge takes, 0 to 1.
    gradient : float
        How much darker the rim is than the middle, 0 to 1; below 0, the middle than the rim.
    slope : float
        How much darker the lower side is than the upper one, 0 to 1; below 0, the other way.
    hole : float
        The part of a ring's radius that is open.
    colour : tuple of 3 float
    kelvin : float
        Multiplies the colour by that of a black body; 6500 is white.
    tint : float
        Multiplies green by 2 to the power of it: below 0 magenta, above 0 green.
    strength : float
        The radiance where the light is brightest. For a sun the irradiance of a place that faces
        the sun, as of Blender's own sun lamp. For the blend MULTIPLY the factor on the light
        behind: a flag has 0.
    stops : float
        Multiplies the strength by 2 to the power of it.
    amount : float
        Fades the light in: 0 is off, 1 is all of it.
    on, solo, lock : bool
        Whether the light is on. Where lights of the kit are solo, only those are lit. A locked
        light is not changed by tools.
    image : str
        A picture's image: a path, or the name of an image in the file.

    Raises
    ------
    KitError
        A number is out of `BOUNDS`.
    """

    name: str
    kind: Kind = Kind.RECTANGLE
    blend: Blend = Blend.ADD
    azimuth: float = 0.0
    elevation: float = 0.0
    roll: float = 0.0
    width: float = 30.0
    height: float = 30.0
    softness: float = 0.0
    gradient: float = 0.0
    slope: float = 0.0
    hole: float = 0.6
    colour: Colour = WHITE
    kelvin: float = 6500.0
    tint: float = 0.0
    strength: float = 1.0
    stops: float = 0.0
    amount: float = 1.0
    on: bool = True
    solo: bool = False
    lock: bool = False
    image: str = ""

    def __post_init__(self) -> None:
        check(self, f"the light '{self.name}'")

    @property
    def tinted(self) -> Colour:
        """The colour, with Kelvin and tint."""
        red, green, blue = of_kelvin(self.kelvin)
        r, g, b = self.colour
        return r * red, g * green * 2.0**self.tint, b * blue

    @property
    def radiance(self) -> Colour:
        """The radiance where the light is brightest, scene-linear.

        For the blend MULTIPLY the factor on the light behind.
        """
        scale = self.strength * 2.0**self.stops
        if self.kind is Kind.SUN and self.blend is not Blend.MULTIPLY:
            scale /= math.pi * math.sin(math.radians(self.width / 2)) ** 2
        r, g, b = self.tinted
        return r * scale, g * scale, b * scale

    @property
    def sides(self) -> tuple[float, float]:
        """Half of the width and height of the shape at a distance of 1."""
        height = self.width if self.kind is Kind.SUN else self.height
        return math.tan(math.radians(self.width / 2)), math.tan(math.radians(height / 2))

    @property
    def smallest(self) -> float:
        """The smallest angle of what can be seen of the shape, in degrees."""
        if self.kind is Kind.SUN:
            return self.width
        least = min(self.width, self.height)
        return least * (1 - self.hole) / 2 if self.kind is Kind.RING else least

    @property
    def solid_angle(self) -> float:
        """The solid angle of the shape with hard edges, in steradians.

        In closed form for rectangles, discs and suns; a strip and an ellipse by their area where
        they are small.
        """
        half_x, half_y = (math.atan(side) for side in self.sides)
        if self.kind in (Kind.RECTANGLE, Kind.PICTURE, Kind.FLAG):
            return 4 * math.asin(math.sin(half_x) * math.sin(half_y))
        x, y = self.sides
        if self.kind is Kind.STRIP:
            r = min(x, y)
            box = 4 * math.asin(math.sin(half_x) * math.sin(half_y))
            return box * (1 - (4 - math.pi) * r * r / (4 * x * y))
        # Of the circle with the same area at a distance of 1.
        whole = 2 * math.pi * (1 - math.cos(math.atan(math.sqrt(x * y))))
        if self.kind is not Kind.RING:
            return whole
        inner = math.sqrt(x * y) * self.hole
        return whole - 2 * math.pi * (1 - math.cos(math.atan(inner)))
