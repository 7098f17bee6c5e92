"""The light kit as data: lights by kind, direction, size and strength, over a base.

The direction of a light is where its middle stands; its width and height are the angles under which
its sides are seen. So a kit has no distances, and is the same from everywhere in the scene, like an
HDRI.

Angles are degrees. The azimuth runs counterclockwise from +X, seen from above; the elevation is
above the horizon. A roll turns a light clockwise, seen from the scene. Light is scene-linear, in
the working space.

Examples
--------
>>> kit = Kit((Light("Key", stops=2.0),), Base(kind=BaseKind.HDRI, image="//studio.exr"))
>>> kit = kit.with_light(Light("Fill", azimuth=90.0))
>>> [light.name for light in kit.lights], kit.free_name("Key")
(['Key', 'Fill'], 'Key 2')
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum

from ..errors import KitError
from .light import WHITE, Colour, Light, check


class BaseKind(StrEnum):
    """What stands behind all lights. NODES is what other nodes give, and is left alone."""

    BLACK = "BLACK"
    NODES = "NODES"
    GRADIENT = "GRADIENT"
    HDRI = "HDRI"


@dataclass(frozen=True)
class Base:
    """What stands behind all lights, or what the camera sees as the backdrop.

    Parameters
    ----------
    kind : BaseKind
    image : str
        The HDRI: a path, or the name of an image in the file.
    turn : float
        Degrees clockwise from above, as the slider *Rotation* has it.
    blur : float
        The radius in degrees over which the HDRI is blurred.
    strength : float
    top, horizon, bottom : tuple of 3 float
        The colours of a gradient, scene-linear radiance.
    """

    kind: BaseKind = BaseKind.BLACK
    image: str = ""
    turn: float = 0.0
    blur: float = 0.0
    strength: float = 1.0
    top: Colour = WHITE
    horizon: Colour = (0.5, 0.5, 0.5)
    bottom: Colour = (0.05, 0.05, 0.05)

    def __post_init__(self) -> None:
        check(self, "the base")


@dataclass(frozen=True)
class Kit:
    """A world made of lights over a base.

    Parameters
    ----------
    lights : tuple of Light
        From the back to the front: a light that stands before others comes after them.
    base : Base
    backdrop : Base, optional
        What the camera sees in place of base and lights; None where it sees what lights the scene.
    turn : float
        Turns all of it, in degrees, as the slider *Rotation*.
    strength : float
        Scales all of it, as the slider *Strength*.
    tint : tuple of 3 float
        Multiplies all of it, as the slider *Tint*.

    Raises
    ------
    KitError
        Two lights have the same name.
    """

    lights: tuple[Light, ...] = ()
    base: Base = Base()
    backdrop: Base | None = None
    turn: float = 0.0
    strength: float = 1.0
    tint: Colour = WHITE

    def __post_init__(self) -> None:
        check(self, "the kit")
        names = [light.name for light in self.lights]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise KitError(f"two lights of the kit are named '{twice[0]}': give each its own name")

    @property
    def lit(self) -> tuple[Light, ...]:
        """The lights that shine: those that are on, or of these the solo ones where there are any.

        Lights whose amount is 0 are left out.
        """
        alone = any(light.solo and light.on for light in self.lights)
        return tuple(
            light for light in self.lights
            if light.on and light.amount > 0 and (light.solo or not alone)
        )  # fmt: skip

    def free_name(self, like: str) -> str:
        """Give a name that no light of the kit has: the one that is asked for, or with a number.

        Parameters
        ----------
        like : str

        Returns
        -------
        str
        """
        return free_name(like, {light.name for light in self.lights})

    def light(self, name: str) -> Light:
        """Find a light by its name.

        Parameters
        ----------
        name : str

        Returns
        -------
        Light

        Raises
        ------
        KitError
            The kit has no such light.
        """
        found = next((light for light in self.lights if light.name == name), None)
        if found is None:
            raise KitError(f"the kit has no light '{name}'")
        return found

    def with_light(self, light: Light) -> Kit:
        """Put a light in the place of the one of the same name, or before all others.

        Parameters
        ----------
        light : Light

        Returns
        -------
        Kit
        """
        if all(other.name != light.name for other in self.lights):
            return replace(self, lights=(*self.lights, light))
        lights = tuple(light if other.name == light.name else other for other in self.lights)
        return replace(self, lights=lights)


def free_name(like: str, taken: Iterable[str]) -> str:
    """Give a name that is not taken: the one that is asked for, or with a number after it.

    Parameters
    ----------
    like : str
    taken : iterable of str

    Returns
    -------
    str
    """
    names, name, number = set(taken), like, 1
    while name in names:
        number += 1
        name = f"{like} {number}"
    return name
