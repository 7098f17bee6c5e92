"""Maps of light kits, worked out in the window while an artist's hand is on a light.

The nodes of a kit are known, so no render is needed for a rough map. A map of full size comes from
Cycles when the world rests, as of any world.
"""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.errors import KitError
from ...core.kit.light import Kind
from ...core.kit.model import Base, BaseKind, Kit
from ...core.kit.shine import base_map, map_of
from ...core.light.environment import Environment
from ..blender.colour import working_space
from ..kit import base as of_base
from ..kit import kit as kits
from ..shot.pixels import image as digest_of

# The rows of a map.
ROWS = 128


class Quick:
    """Makes rough maps of kits; the map of the base is kept, as an HDRI has many pixels."""

    def __init__(self) -> None:
        self._base: tuple[object, NDArray[np.float64]] | None = None

    def map_of(self, world: bpy.types.World, without: str = "") -> NDArray[np.float32] | None:
        """The map (H, W, 3) of a world at strength 1, not turned.

        without: the name of a light that is left out.
        None for a world that only Cycles can tell: not all of it is a kit, nodes work out a value,
        or there are pictures whose colours have to be converted.
        """
        if kits.turns(world) is None:
            return None
        try:
            kit = kits.read(world)
        except KitError:
            return None
        if any(light.kind is Kind.PICTURE for light in kit.lit):
            return None
        behind = self._behind(kit.base)
        if behind is None:
            return None
        lights = tuple(light for light in kit.lights if light.name != without)
        plain = Kit(lights, kit.base, tint=kit.tint)
        return map_of(plain, ROWS, behind).image

    def _behind(self, base: Base) -> NDArray[np.float64] | None:
        """The map of a base; None where only Cycles can tell it."""
        if base.kind is not BaseKind.HDRI:
            return base_map(base, ROWS)
        image = of_base.image_of(base.image) if base.image else None
        if (
            image is None
            or image.source not in {"FILE", "GENERATED"}
            or not image.is_float
            or image.colorspace_settings.name != working_space()
            or not image.has_data
        ):
            return None
        key = digest_of(image), tuple(image.size), base
        if self._base is None or self._base[0] != key:
            found = base_map(base, ROWS, Environment(_pixels(image)))
            self._base = key, found
        return self._base[1]


def _pixels(image: bpy.types.Image) -> NDArray[np.float32]:
    """The pixels of an HDRI (H, W, 3), rows top-down."""
    width, height = image.size
    pixels = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    colours = pixels.reshape(height, width, image.channels)[::-1, :, :3]
    return np.ascontiguousarray(colours)
